"""The coloured point cloud of a capture, as a small binary PLY that other tools open."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, UInt8

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_file

_VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
_PROPERTIES = (
    "float x",
    "float y",
    "float z",
    "uchar red",
    "uchar green",
    "uchar blue",
)
_MAX_HEADER = 4096
_TEXT_BYTES = 12
"""Six numbers of one digit, each with a separator: the shortest line that holds a point."""


class Points(NamedTuple):
    """World positions (metres where the capture is metric) and display colours 0..255."""

    xyz: Float32[np.ndarray, "n 3"]
    rgb: UInt8[np.ndarray, "n 3"]


def write_points(path: Path, points: Points) -> None:
    """Binary little-endian PLY with x y z (float) and red green blue (uchar)."""
    vertices = np.empty(len(points.xyz), _VERTEX)
    vertices["xyz"], vertices["rgb"] = points.xyz, points.rgb
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header = "\n".join([*lines, *(f"property {p}" for p in _PROPERTIES), "end_header", ""])
    with atomic_file(Path(path)) as temporary, open(temporary, "wb") as stream:
        stream.write(header.encode("ascii"))
        stream.write(vertices.tobytes())


def read_points(path: Path) -> Points:
    """The inverse of `write_points`; the same properties as text are read too (nerfstudio's own).

    Raises InputError when the file is missing, FormatError when its header is another one, when
    it claims more points than it has bytes for (checked before allocating), or holds NaN.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    with open(path, "rb") as stream:
        header = stream.read(_MAX_HEADER)
        end = header.find(b"end_header\n")
        if not header.startswith(b"ply\n") or end < 0:
            raise FormatError(f"{path} is not a PLY file.")
        lines = header[:end].decode("ascii", "replace").splitlines()
        text = "format ascii 1.0" in lines
        count = _vertex_count(path, lines)
        offset = end + len(b"end_header\n")
        room = (path.stat().st_size - offset) // (_TEXT_BYTES if text else _VERTEX.itemsize)
        if count > room:
            raise FormatError(f"{path} claims {count} points, its bytes hold {room}.")
        stream.seek(offset)
        if text:
            points = _text_points(path, stream.read(), count)
        else:
            vertices = np.frombuffer(stream.read(count * _VERTEX.itemsize), _VERTEX)
            points = Points(vertices["xyz"].astype(np.float32), vertices["rgb"].copy())
    if not np.isfinite(points.xyz).all():
        raise FormatError(f"{path} has points that are not finite.")
    return points


def _text_points(path: Path, raw: bytes, count: int) -> Points:
    try:
        values = np.array(raw.split()[: 6 * count], float).reshape(count, 6)
    except ValueError as error:
        raise FormatError(f"{path} is not {count} lines of six numbers: {error}.") from error
    if count and not ((values[:, 3:] >= 0) & (values[:, 3:] <= 255)).all():
        raise FormatError(f"{path} has colours outside 0..255.")
    return Points(values[:, :3].astype(np.float32), values[:, 3:].astype(np.uint8))


def _vertex_count(path: Path, lines: list[str]) -> int:
    wanted = [f"property {p}" for p in _PROPERTIES]
    properties = [
        line.replace("uint8", "uchar").replace("float32", "float")
        for line in lines
        if line.startswith("property")
    ]
    counts = [line.split()[-1] for line in lines if line.startswith("element vertex ")]
    known = {"format binary_little_endian 1.0", "format ascii 1.0"} & set(lines)
    if len(known) != 1 or properties != wanted:
        raise FormatError(f"{path} must be little-endian or text with {', '.join(_PROPERTIES)}.")
    if len(counts) != 1 or not counts[0].isdigit():
        raise FormatError(f"{path} does not say how many points it holds.")
    return int(counts[0])

"""Plain 3DGS PLY, the file that other Gaussian viewers open.

Vertex properties, all scalar: x y z nx ny nz f_dc_0..2 f_rest_0..(3(K-1)-1) opacity scale_0..2
rot_0..3. `opacity` is a logit, `scale` a logarithm, `rot` w-x-y-z, and f_rest is channel-major:
all coefficients of red, then green, then blue. Reading back what was written is lossless.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from luxcore.errors import FormatError
from luxcore.files.atomic import atomic_file
from luxcore.files.input import check_input_file
from luxcore.splats.gaussians import Gaussians
from luxcore.splats.ply_header import PlyHeader, read_header

_ANTIALIASED = "antialiased 1"
_POSITION = ("x", "y", "z")
_COLOR = ("f_dc_0", "f_dc_1", "f_dc_2")
_SCALE = ("scale_0", "scale_1", "scale_2")
_ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")
_REQUIRED = (*_POSITION, *_COLOR, "opacity", *_SCALE, *_ROTATION)
_REST_COUNTS = (0, 9, 24, 45)

MAX_LOGIT = 16.0
"""Opacities of exactly 0 and 1 are ±infinity as logits; they are read as ±16 (1e-7 away)."""


def write_ply(path: Path, gaussians: Gaussians) -> None:
    """Write `gaussians` as binary little-endian float32, atomically."""
    rest = 3 * (gaussians.sh.shape[1] - 1)
    names = (*_POSITION, "nx", "ny", "nz", *_COLOR, *(f"f_rest_{i}" for i in range(rest)))
    names = (*names, "opacity", *_SCALE, *_ROTATION)
    table = np.zeros((len(gaussians), len(names)), "<f4")
    table[:, :3] = gaussians.means
    table[:, 6:9] = gaussians.sh[:, 0]
    table[:, 9 : 9 + rest] = gaussians.sh[:, 1:].transpose(0, 2, 1).reshape(len(gaussians), rest)
    table[:, 9 + rest] = gaussians.opacity_logits
    table[:, 10 + rest : 13 + rest] = gaussians.log_scales
    table[:, 13 + rest :] = gaussians.quats
    comments = [f"comment {_ANTIALIASED}"] if gaussians.antialiased else []
    lines = ["ply", "format binary_little_endian 1.0", *comments]
    lines += [f"element vertex {len(gaussians)}", *(f"property float {n}" for n in names)]
    with atomic_file(Path(path)) as temporary, open(temporary, "wb") as stream:
        stream.write("\n".join([*lines, "end_header", ""]).encode("ascii"))
        stream.write(table.tobytes())


def read_ply(path: Path) -> Gaussians:
    """Read any 3DGS PLY: binary of either byte order or text, spherical harmonics of degree 0–3.

    Raises InputError when the file is missing and FormatError when it is not a 3DGS PLY, claims
    more than it holds (checked before anything is allocated), or has values that are not finite.
    """
    path = Path(path)
    check_input_file(path)
    with open(path, "rb") as stream:
        header = read_header(stream, path, path.stat().st_size)
        _check_names(path, header)
        table = header.read_vertices(stream, path)
    return _gaussians(path, header, table)


def _gaussians(path: Path, header: PlyHeader, table: np.ndarray) -> Gaussians:
    rest = _rest_names(header)
    opacity = np.clip(table["opacity"].astype(np.float32), -MAX_LOGIT, MAX_LOGIT)
    columns = {
        "means": _columns(table, _POSITION),
        "quats": _columns(table, _ROTATION),
        "log_scales": _columns(table, _SCALE),
        "opacity_logits": opacity,
    }
    dc, higher = _columns(table, _COLOR), _columns(table, rest)
    higher = higher.reshape(len(table), 3, len(rest) // 3).transpose(0, 2, 1)
    columns["sh"] = np.ascontiguousarray(np.concatenate([dc[:, None], higher], axis=1))
    for name, values in columns.items():
        _check_finite(path, name, values)
    return Gaussians(**columns, antialiased=_ANTIALIASED in header.comments)


def _columns(table: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    values = np.empty((len(table), len(names)), np.float32)
    with np.errstate(over="ignore"):
        for column, name in enumerate(names):
            values[:, column] = table[name]
    return values


def _rest_names(header: PlyHeader) -> tuple[str, ...]:
    count = sum(name.startswith("f_rest_") for name in header.names)
    return tuple(f"f_rest_{i}" for i in range(count))


def _check_names(path: Path, header: PlyHeader) -> None:
    missing = [name for name in _REQUIRED if name not in header.names]
    if missing:
        raise FormatError(f"{path} is not a 3DGS PLY: vertex property {missing[0]} is missing.")
    rest = _rest_names(header)
    if len(rest) not in _REST_COUNTS or any(name not in header.names for name in rest):
        raise FormatError(
            f"{path} has {len(rest)} f_rest properties; 3DGS has f_rest_0 to f_rest_8, 23 or 44."
        )


def _check_finite(path: Path, name: str, values: np.ndarray) -> None:
    bad = ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    if bad.any():
        raise FormatError(
            f"{path} has {np.count_nonzero(bad)} of {len(values)} Gaussians whose {name} are not "
            f"finite, the first is vertex {int(np.argmax(bad))}."
        )

"""PLY headers: parsed and checked against the size of the file before anything is allocated."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from luxcore.errors import FormatError

_MAX_HEADER_BYTES = 65_536
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2"},
    **{"ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str]]


@dataclass(frozen=True)
class PlyHeader:
    """Where the vertices of a PLY are and what they hold."""

    format: str
    dtype: np.dtype
    count: int
    offset: int
    comments: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vertex properties, in file order."""
        return self.dtype.names or ()

    def read_vertices(self, stream: BinaryIO, path: Path) -> np.ndarray:
        """All vertices as a structured array. Raises FormatError when text is not numbers."""
        stream.seek(self.offset)
        if self.format != "ascii":
            return np.frombuffer(stream.read(self.count * self.dtype.itemsize), self.dtype)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                table = np.loadtxt(stream, dtype=np.float64, max_rows=self.count, ndmin=2)
        except (ValueError, UnicodeDecodeError) as error:
            raise FormatError(f"{path} has a vertex that is not a row of numbers.") from error
        expected = (self.count, len(self.names)) if self.count else table.shape
        if table.shape != expected:
            raise FormatError(f"{path} claims {self.count} vertices, its text holds {len(table)}.")
        wide = np.dtype([(name, "f8") for name in self.names])
        return np.ascontiguousarray(table).view(wide)[:, 0] if table.size else np.empty(0, wide)


def read_header(stream: BinaryIO, path: Path, file_bytes: int) -> PlyHeader:
    """Parse the header of a PLY with scalar vertex properties.

    Raises FormatError when it is not PLY, when a vertex property is a list or of unknown type,
    or when the vertices would need more bytes than the file has left.
    """
    raw = stream.read(_MAX_HEADER_BYTES)
    end = raw.find(b"end_header")
    newline = raw.find(b"\n", end)
    if not raw.startswith(b"ply") or end < 0 or newline < 0:
        raise FormatError(f"{path} is not a PLY file: it has no complete header.")
    lines = raw[:end].decode("ascii", "replace").splitlines()[1:]
    form, elements, comments = _parse(path, lines)
    offset = newline + 1
    for element in elements:
        dtype = _dtype(path, element, _ORDERS[form])
        _check_size(path, element, form, dtype, file_bytes - offset)
        if element.name == "vertex":
            return PlyHeader(form, dtype, element.count, offset, comments)
        if form == "ascii":
            raise FormatError(f"{path} has text element {element.name} before its vertices.")
        offset += element.count * dtype.itemsize
    raise FormatError(f"{path} holds no vertex element.")


def _parse(path: Path, lines: list[str]) -> tuple[str, list[_Element], tuple[str, ...]]:
    form, elements, comments = "", [], []
    for line in lines:
        words = line.split()
        match words:
            case [] | ["obj_info", *_]:
                continue
            case ["comment", *rest]:
                comments.append(" ".join(rest))
            case ["format", name, _] if name in _ORDERS:
                form = name
            case ["element", name, count] if _is_count(count):
                elements.append(_Element(name, int(count), []))
            case ["property", "list", _, _, name] if elements:
                elements[-1].properties.append((name, "list"))
            case ["property", kind, name] if elements:
                elements[-1].properties.append((name, kind))
            case _:
                raise FormatError(f"{path} has a PLY header line that means nothing: {line:.80}.")
    if not form:
        raise FormatError(f"{path} does not name a PLY format.")
    return form, elements, tuple(comments)


def _is_count(text: str) -> bool:
    # Eighteen digits stay below 2^63; Python refuses to convert thousands of digits.
    return text.isascii() and text.isdigit() and len(text) <= 18


def _dtype(path: Path, element: _Element, order: str) -> np.dtype:
    for name, kind in element.properties:
        if kind not in _TYPES:
            raise FormatError(
                f"{path}: property {name:.40} of {element.name:.40} must be a number, "
                f"got {kind:.40}."
            )
    names = [name for name, _ in element.properties]
    if not names or len(set(names)) != len(names):
        raise FormatError(f"{path}: element {element.name:.40} has no or repeated properties.")
    return np.dtype([(name, order + _TYPES[kind]) for name, kind in element.properties])


def _check_size(path: Path, element: _Element, form: str, dtype: np.dtype, left: int) -> None:
    # A number and its separator take two characters at least.
    stride = 2 * len(dtype.names or ()) if form == "ascii" else dtype.itemsize
    # The last line of a text file may lack its newline.
    if element.count * stride > left + (form == "ascii"):
        raise FormatError(
            f"{path} claims {element.count} of {element.name:.40}, {element.count * stride} bytes; "
            f"it has {left} bytes left."
        )

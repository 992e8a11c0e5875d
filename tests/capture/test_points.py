"""Point clouds: exact round trip; hostile files end in a sentence before anything is allocated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plyfile
import pytest

from luxcore.capture import Points, read_points, write_points
from luxcore.errors import FormatError


@pytest.fixture
def ply(tmp_path: Path) -> Path:
    rng = np.random.Generator(np.random.PCG64(1))
    xyz = rng.normal(size=(11, 3)).astype(np.float32)
    write_points(tmp_path / "p.ply", Points(xyz, rng.integers(0, 256, (11, 3), dtype=np.uint8)))
    return tmp_path / "p.ply"


def test_another_reader_sees_the_same_points(ply: Path) -> None:
    ours = read_points(ply)
    vertex = plyfile.PlyData.read(str(ply))["vertex"]
    assert np.array_equal(np.stack([vertex[c] for c in "xyz"], 1), ours.xyz)
    assert np.array_equal(np.stack([vertex[c] for c in ("red", "green", "blue")], 1), ours.rgb)


def test_no_points(tmp_path: Path) -> None:
    empty = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    write_points(tmp_path / "e.ply", empty)
    assert len(read_points(tmp_path / "e.ply").xyz) == 0


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        (b"vertex 11", b"vertex 1099511627776", "claims 1099511627776 points"),
        (b"vertex 11", b"vertex 12", "claims 12 points"),
        (b"vertex 11", b"vertex -1", "how many points"),
        (b"little_endian", b"big_endian", "little-endian"),
        (b"float x", b"list uchar int x", "must be binary"),
        (b"end_header", b"end-header", "not a PLY"),
    ],
)
def test_hostile_headers(ply: Path, old: bytes, new: bytes, fact: str) -> None:
    ply.write_bytes(ply.read_bytes().replace(old, new))
    with pytest.raises(FormatError, match=fact):
        read_points(ply)


def test_nan_is_refused(ply: Path) -> None:
    raw = bytearray(ply.read_bytes())
    start = raw.index(b"end_header\n") + len(b"end_header\n")
    raw[start : start + 4] = np.float32(np.nan).tobytes()
    ply.write_bytes(bytes(raw))
    with pytest.raises(FormatError, match="not finite"):
        read_points(ply)

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
        (b"float x", b"list uchar int x", "must be little-endian"),
        (b"end_header", b"end-header", "not a PLY"),
    ],
)
def test_hostile_headers(ply: Path, old: bytes, new: bytes, fact: str) -> None:
    ply.write_bytes(ply.read_bytes().replace(old, new))
    with pytest.raises(FormatError, match=fact):
        read_points(ply)


def test_nerfstudios_text_points(tmp_path: Path) -> None:
    properties = "".join(f"property float {c}\n" for c in "xyz")
    properties += "".join(f"property uint8 {c}\n" for c in ("red", "green", "blue"))
    header = f"ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n"
    path = tmp_path / "sparse_pc.ply"
    path.write_text(header + "1.5 -2 3e-1 255 0 7\n0 0 1 1 2 3\n")
    points = read_points(path)
    assert points.xyz == pytest.approx(np.array([[1.5, -2, 0.3], [0, 0, 1]]))
    assert points.rgb.tolist() == [[255, 0, 7], [1, 2, 3]]
    for body, fact in (
        ("1 2 3 4 5 6\n", "its bytes hold 1"),
        ("1 2 3 4 5 6\n1 2 3 x 5 66\n", "six numbers"),
        ("1 2 3 4 5 6\n1 2 3 4 5 666\n", "outside 0..255"),
    ):
        path.write_text(header + body)
        with pytest.raises(FormatError, match=fact):
            read_points(path)


def test_nan_is_refused(ply: Path) -> None:
    raw = bytearray(ply.read_bytes())
    start = raw.index(b"end_header\n") + len(b"end_header\n")
    raw[start : start + 4] = np.float32(np.nan).tobytes()
    ply.write_bytes(bytes(raw))
    with pytest.raises(FormatError, match="not finite"):
        read_points(ply)

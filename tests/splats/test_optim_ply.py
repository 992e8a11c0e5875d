"""3DGS PLY files: lossless both ways, and hostile ones refused before anything is allocated."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from luxcore.errors import FormatError, InputError
from luxcore.splats.gaussians import Gaussians, color_from_sh, sh_from_color
from luxcore.splats.ply import MAX_LOGIT, read_ply, write_ply


def random_gaussians(n: int, degree: int = 0, seed: int = 0) -> Gaussians:
    random = np.random.default_rng(seed)

    def normal(*shape: int) -> np.ndarray:
        return random.normal(size=shape).astype(np.float32)

    return Gaussians(
        normal(n, 3), normal(n, 4), normal(n, 3), normal(n), normal(n, (degree + 1) ** 2, 3)
    )


def assert_same(a: Gaussians, b: Gaussians) -> None:
    for name in ("means", "quats", "log_scales", "opacity_logits", "sh"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert a.antialiased == b.antialiased


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("n", [0, 1, 37])
def test_round_trip_is_lossless(tmp_path: Path, n: int, degree: int) -> None:
    written = random_gaussians(n, degree)
    write_ply(tmp_path / "a.ply", written)
    assert_same(read_ply(tmp_path / "a.ply"), written)


def test_low_pass_mode_is_recorded(tmp_path: Path) -> None:
    plain = random_gaussians(3)
    filtered = Gaussians(
        plain.means, plain.quats, plain.log_scales, plain.opacity_logits, plain.sh, True
    )
    write_ply(tmp_path / "a.ply", filtered)
    assert read_ply(tmp_path / "a.ply").antialiased


def test_rest_coefficients_are_channel_major(tmp_path: Path) -> None:
    """Viewers read f_rest_0..2 of degree 1 as the three coefficients of red."""
    gaussians = random_gaussians(1, degree=1)
    write_ply(tmp_path / "a.ply", gaussians)
    floats = np.frombuffer((tmp_path / "a.ply").read_bytes()[-4 * 26 :], "<f4")
    np.testing.assert_array_equal(floats[9:12], gaussians.sh[0, 1:, 0])


@pytest.mark.parametrize("form", ["binary_big_endian", "ascii"])
def test_other_encodings_read_the_same(tmp_path: Path, form: str) -> None:
    expected = random_gaussians(5)
    write_ply(tmp_path / "a.ply", expected)
    header, body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    table = np.frombuffer(body, "<f4")
    header = header.replace(b"binary_little_endian", form.encode()) + b"end_header\n"
    if form == "ascii":
        rows = [" ".join(repr(float(v)) for v in row) for row in table.reshape(5, -1)]
        body = "\n".join(rows).encode()
    else:
        body = table.astype(">f4").tobytes()
    (tmp_path / "b.ply").write_bytes(header + body)
    assert_same(read_ply(tmp_path / "b.ply"), expected)


def test_opacity_zero_and_one_stay_finite(tmp_path: Path) -> None:
    """Their logits are infinite: taken as they are, the first gradient is NaN."""
    gaussians = random_gaussians(2)
    gaussians.opacity_logits[:] = [np.inf, -np.inf]
    write_ply(tmp_path / "a.ply", gaussians)
    np.testing.assert_array_equal(
        read_ply(tmp_path / "a.ply").opacity_logits, [MAX_LOGIT, -MAX_LOGIT]
    )


def edited(tmp_path: Path, old: bytes, new: bytes) -> Path:
    write_ply(tmp_path / "good.ply", random_gaussians(4, degree=1))
    raw = (tmp_path / "good.ply").read_bytes()
    assert old in raw
    (tmp_path / "bad.ply").write_bytes(raw.replace(old, new, 1))
    return tmp_path / "bad.ply"


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        (b"element vertex 4", b"element vertex 1000000000", "claims 1000000000 of vertex"),
        (b"element vertex 4", b"element vertex 5", "claims 5 of vertex"),
        (b"element vertex 4", b"element vertex -4", "means nothing"),
        (b"element vertex 4", b"element vertex " + b"9" * 5000, "means nothing"),
        (b"element vertex 4", b"element face 4", "no vertex element"),
        (b"float opacity", b"list uchar float opacity", "must be a number, got list"),
        (b"float opacity", b"quaternion opacity", "must be a number, got quaternion"),
        (b"property float opacity\n", b"", "property opacity is missing"),
        (b"property float f_rest_8\n", b"", "8 f_rest properties"),
        (b"float f_rest_1\n", b"float f_rest_0\n", "repeated properties"),
        (b"float f_rest_1\n", b"float f_rest_77\n", "9 f_rest properties"),
        (b"binary_little_endian", b"binary_middle_endian", "means nothing"),
        (b"format binary_little_endian 1.0\n", b"", "does not name a PLY format"),
        (b"end_header", b"end_of_header", "no complete header"),
        (b"ply\n", b"PK\x03\x04", "no complete header"),
        (b"binary_little_endian", b"ascii", "not a row of numbers"),
    ],
)
def test_malformed_files_are_refused(tmp_path: Path, old: bytes, new: bytes, fact: str) -> None:
    path = edited(tmp_path, old, new)
    tracemalloc.start()
    with pytest.raises(FormatError, match=fact) as caught:
        read_ply(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert str(path) in str(caught.value)
    # A billion claimed vertices are 92 GB: nothing of that size may be asked for.
    assert peak < 5_000_000


def test_values_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    gaussians = random_gaussians(6)
    gaussians.log_scales[4, 1] = np.nan
    write_ply(tmp_path / "a.ply", gaussians)
    with pytest.raises(FormatError, match=r"1 of 6 Gaussians whose log_scales .* vertex 4"):
        read_ply(tmp_path / "a.ply")


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_ply(tmp_path / "none.ply")


def test_degree_zero_colour_round_trip() -> None:
    color = np.random.default_rng(0).random((9, 3), np.float32)
    np.testing.assert_allclose(color_from_sh(sh_from_color(color)), color, atol=1e-6)

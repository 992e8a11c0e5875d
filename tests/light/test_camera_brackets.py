"""A photographer's bracket: a known camera is recovered, a public set agrees with its reference."""

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from luxcore.cli.hdr import command
from luxcore.errors import FormatError, InputError
from luxcore.files.exr import read_exr_image
from luxcore.files.photos import read_photo
from luxcore.light.camera_brackets import (
    exif_exposure,
    merge_photos,
    parse_times,
    recover_response,
)

TIMES = [1 / 60, 1 / 15, 1 / 4]


def scene() -> np.ndarray:
    """Radiance over 11 stops, smooth, three channels."""
    y, x = np.mgrid[:48, :64] / 48
    base = 2.0 ** (8 * x / x.max() - 3)
    return (base[..., None] * (1 + 0.3 * np.sin(3 * y)[..., None] * [1.0, 0.8, 0.6])).clip(1e-3)


def camera_photo(radiance: np.ndarray, time: float) -> np.ndarray:
    """A camera with an s-shaped curve of its own."""
    exposure = (radiance * time).clip(0, 1)
    return np.round(255 * (0.8 * exposure ** (1 / 2.2) + 0.2 * exposure ** (1 / 1.4)))


def save_bracket(folder: Path, times: list[float], exif: bool = True) -> list[Path]:
    paths = []
    for i, time in enumerate(times):
        image = Image.fromarray(camera_photo(scene(), time).astype(np.uint8))
        tags = Image.Exif()
        if exif:
            tags[0x8769] = {33434: time}
        paths.append(folder / f"{i}.png")
        image.save(paths[-1], exif=tags)
    return paths


def test_radiance_of_a_known_camera_is_recovered_up_to_one_factor(tmp_path):
    merged = merge_photos(save_bracket(tmp_path, TIMES))
    truth = scene()
    seen = (truth * TIMES[0] < 0.9).all(-1) & (truth * TIMES[-1] > 0.02).all(-1)
    ratio = merged.radiance[seen] / truth[seen]
    ratio /= np.median(ratio, axis=0)
    # OpenCV leaves each channel one free factor; over 6 stops the ratio must stay level.
    assert np.percentile(np.abs(ratio - 1), 90) < 0.05


def test_public_set_agrees_with_its_reference_curves(shared_data):
    root = shared_data / "hdr-frobisher"
    paths = sorted((root / "frobisher_001").glob("*.jpg"))
    curve = recover_response([read_photo(p) for p in paths], [exif_exposure(p) for p in paths])
    expected = np.load(
        root / "colour_hdri/calibration/test_camera_response_function_Debevec1997_crfs.npy"
    )
    # Both are known up to a factor, and take other pixels and weights; the ends differ by how each
    # treats values that it hardly sees.
    values = np.arange(16, 200)
    ours, theirs = curve / curve[128], expected / expected[128]
    assert np.abs(ours[values] / theirs[values] - 1).max() < 0.1


def test_curve_never_falls(shared_data):
    paths = sorted((shared_data / "hdr-frobisher" / "frobisher_001").glob("*.jpg"))
    curve = recover_response([read_photo(p) for p in paths], [0.125, 1.0, 8.0])
    assert (np.diff(curve, axis=0) >= 0).all()


def test_exif_counts_aperture_and_sensitivity(tmp_path):
    tags = Image.Exif()
    tags.get_ifd(0x8769).update({33434: 0.5, 33437: 2.0, 34855: 400})
    Image.new("RGB", (4, 4)).save(tmp_path / "a.jpg", exif=tags)
    assert exif_exposure(tmp_path / "a.jpg") == pytest.approx(0.5 * 4 / 4)


@pytest.mark.parametrize(
    ("text", "times"), [("1/30,1/60", [1 / 30, 1 / 60]), (" 0.5 , 2", [0.5, 2.0])]
)
def test_times_are_read(text, times):
    assert parse_times(text) == pytest.approx(times)


@pytest.mark.parametrize(
    "text", ["", "1/0", "-1", "fast", "1/30,,1/60", "1e9", "nan", "1e400", "1e-999999999"]
)
def test_bad_times_are_one_sentence(text):
    with pytest.raises(InputError, match="exposure time"):
        parse_times(text)


@pytest.mark.parametrize("size", [(1, 1), (9, 40), (12, 1300)])
def test_photos_too_small_for_the_response_are_refused(tmp_path, size):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path, value in zip(paths, (40, 80), strict=True):
        Image.new("RGB", size, (value, value, value)).save(path)
    with pytest.raises(InputError, match=rf"a\.png is {size[0]}x{size[1]}; a bracket needs"):
        merge_photos(paths, [0.1, 0.2])


def test_a_header_that_claims_too_much_is_damage(tmp_path):
    path = save_bracket(tmp_path, TIMES)[0]
    data = bytearray(path.read_bytes())
    header = b"IHDR" + struct.pack(">II", 60_000, 60_000) + data[24:29]
    data[12:33] = header + struct.pack(">I", zlib.crc32(header))
    path.write_bytes(data)
    with pytest.raises(FormatError, match=r"0\.png is not a readable picture: .* exceeds limit"):
        exif_exposure(path)


def test_what_cannot_be_merged_is_said(tmp_path):
    paths = save_bracket(tmp_path, TIMES)
    Image.new("RGB", (9, 9)).save(tmp_path / "small.png")
    (tmp_path / "cut.png").write_bytes(paths[0].read_bytes()[:60])
    with pytest.raises(InputError, match="at least two photos"):
        merge_photos(paths[:1])
    with pytest.raises(InputError, match=r"small\.png is 9x9"):
        merge_photos([paths[0], tmp_path / "small.png"], [0.1, 0.2])
    with pytest.raises(InputError, match=r"small\.png has no exposure time"):
        merge_photos([paths[0], tmp_path / "small.png"])
    with pytest.raises(InputError, match="3 photos came with 2"):
        merge_photos(paths, [0.1, 0.2])
    with pytest.raises(InputError, match="same exposure"):
        merge_photos(paths[:2], [0.1, 0.1])
    with pytest.raises(FormatError, match=r"cut\.png"):
        merge_photos([paths[0], tmp_path / "cut.png"], [0.1, 0.2])


def test_command_writes_linear_light(tmp_path):
    paths = save_bracket(tmp_path, TIMES, exif=False)
    out = tmp_path / "x.exr"
    arguments = [*map(str, paths), "--times", "1/60,1/15,1/4", "--out", str(out), "--json"]
    result = CliRunner().invoke(command, ["merge", *arguments])
    assert result.exit_code == 0, result.output
    counts = json.loads(result.output)
    assert counts["photos"] == 3
    assert set(counts) == {"photos", "clipped", "black", "gaps", "unknown", "disagreeing"}
    assert read_exr_image(out).shape == (48, 64, 3)


def test_command_tells_of_every_count(tmp_path):
    paths = save_bracket(tmp_path, TIMES, exif=False)
    arguments = [*map(str, paths), "--times", "1/60,1/15,1/4", "--out", str(tmp_path / "x.exr")]
    line = CliRunner().invoke(command, ["merge", *arguments]).output
    names = ("white in all", "black in all", "between exposures", "not finite", "contradictory")
    assert all(name in line for name in names), line


def test_command_refuses_other_formats_before_it_reads(tmp_path):
    result = CliRunner().invoke(command, ["merge", "missing.png", "--out", str(tmp_path / "x.png")])
    assert isinstance(result.exception, InputError)
    assert "must end in .exr" in str(result.exception)

"""OpenEXR files from strangers, and what half precision does to light."""

import json
import resource
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from luxcore.errors import FormatError, InputError, LuxError
from luxcore.files.exr import HALF_MAX, read_exr, read_exr_image, write_exr


@pytest.fixture
def image(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    path = tmp_path / "a.exr"
    write_exr(path, {"image": rng.random((24, 32, 3))})
    return path


def patch_window(path: Path, window: tuple[int, int, int, int]) -> None:
    """Let the header claim another data window."""
    data = path.read_bytes()
    mark = b"dataWindow\0box2i\0" + struct.pack("<i", 16)
    at = data.index(mark) + len(mark)
    path.write_bytes(data[:at] + struct.pack("<4i", *window) + data[at + 16 :])


def read_cost(path: Path) -> dict:
    """Seconds and peak megabytes that reading takes beyond importing, and how it ends."""
    code = (
        "import json, resource, sys, time\n"
        "from pathlib import Path\n"
        "from luxcore.errors import FormatError\n"
        "from luxcore.files import exr\n"
        "exr._library()\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "start = time.process_time()\n"
        "try:\n    exr.read_exr(Path(sys.argv[1])); end = 'read'\n"
        "except FormatError as error:\n    end = str(error)\n"
        "peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before\n"
        "print(json.dumps({'end': end, 'mb': peak / 1024, 's': time.process_time() - start}))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    return json.loads(result.stdout.splitlines()[-1])


@pytest.mark.parametrize(
    "window",
    [
        (0, 0, 99_999, 99_999),
        (0, 0, 30_000, 30_000),
        (0, 0, 2**31 - 1, 10),
        (-(2**31), 0, 2**31 - 1, 10),
        (10, 10, 0, 0),
        (0, 0, -1, -1),
    ],
    ids=["100000²", "30000²", "2^31", "2^32", "inverted", "no pixels"],
)
def test_a_header_that_lies_about_size_costs_nothing(image, window):
    patch_window(image, window)
    cost = read_cost(image)
    assert "a.exr" in cost["end"]
    assert cost["mb"] < 200


def test_cut_in_half(image):
    data = image.read_bytes()
    image.write_bytes(data[: len(data) // 2])
    with pytest.raises(FormatError, match=r"a\.exr"):
        read_exr(image)


def test_pixels_overwritten_by_garbage_are_seen_as_damage(tmp_path):
    path = tmp_path / "a.exr"
    import OpenEXR

    pixels = np.ones((8, 8), np.float32)
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": pixels}).write(str(path))
    data = path.read_bytes()
    path.write_bytes(data[:-16] + b"\xff" * 16)
    with pytest.raises(FormatError, match="4 values that are not finite"):
        read_exr(path)
    assert not np.isfinite(read_exr(path, finite=False)["image"]).all()


def test_garbage_after_the_end_changes_nothing(image):
    before = read_exr(image)["image"]
    image.write_bytes(image.read_bytes() + b"garbage" * 20)
    assert np.array_equal(read_exr(image)["image"], before)


@pytest.mark.parametrize("content", [b"", b"v/1\x01", b"not an image", bytes(4096)])
def test_files_that_are_no_exr(tmp_path, content):
    path = tmp_path / "x.exr"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"x\.exr"):
        read_exr(path)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_exr(tmp_path / "none.exr")


def test_tiled_and_mixed_precision_are_read(tmp_path):
    import OpenEXR

    path = tmp_path / "t.exr"
    planes = {
        "R": np.full((20, 30), 0.5, np.float16),
        "G": np.full((20, 30), 0.25, np.float32),
        "B": np.full((20, 30), 7, np.uint32),
    }
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 16
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, planes).write(str(path))
    pixels = read_exr(path)["image"]
    assert pixels.dtype == np.float32
    assert np.allclose(pixels[3, 4], [0.5, 0.25, 7])


def test_deep_images_are_refused(image):
    data = image.read_bytes()
    # The version field's bit 11 and the type say "deep"; the pixels need not follow.
    flags = struct.unpack("<I", data[4:8])[0] | 0x800
    data = data[:4] + struct.pack("<I", flags) + data[8:]
    old = b"type\0string\0" + struct.pack("<i", 13) + b"scanlineimage"
    new = b"type\0string\0" + struct.pack("<i", 12) + b"deepscanline"
    assert old in data
    image.write_bytes(data.replace(old, new))
    with pytest.raises(FormatError, match=r"a\.exr"):
        read_exr(image)


def test_two_channels_of_one_name(image):
    data = image.read_bytes()
    image.write_bytes(data.replace(b"\0G\0", b"\0B\0", 1))
    with pytest.raises(FormatError, match=r"a\.exr"):
        read_exr(image)


def test_data_window_apart_from_display_window(tmp_path):
    import OpenEXR

    path = tmp_path / "w.exr"
    planes = {c: np.full((6, 9), i, np.float32) for i, c in enumerate("RGB")}
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "dataWindow": (np.array([-3, 2], np.int32), np.array([5, 7], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([99, 99], np.int32)),
    }
    OpenEXR.File(header, planes).write(str(path))
    assert read_exr_image(path).shape == (6, 9, 3)


def test_public_samples(shared_data):
    root = shared_data / "exr-samples"
    for name in ("TestImages/GammaChart.exr", "DisplayWindow/t03.exr"):
        assert read_exr_image(root / name).shape[2] == 3
    for path in sorted((root / "Damaged").iterdir()):
        with pytest.raises(FormatError):
            read_exr(path)
    with pytest.raises(FormatError, match="not finite"):
        read_exr(root / "TestImages" / "AllHalfValues.exr")


def test_what_half_cannot_hold_is_clipped_and_counted(tmp_path):
    light = np.array([[[1e5, 70_000.0, 65_504.0], [-1e5, 1.0, 0.0]]])
    clipped = write_exr(tmp_path / "h.exr", {"light": light})
    assert clipped == 3
    # Casting alone would have given infinity.
    assert np.abs(read_exr(tmp_path / "h.exr")["light"]).max() == HALF_MAX
    assert write_exr(tmp_path / "tiny.exr", {"light": np.array([[1e-9, 2e-8, 1e-7, 0.0]])}) == 2
    assert write_exr(tmp_path / "f.exr", {"light": light}, half=False) == 0
    assert np.allclose(read_exr(tmp_path / "f.exr")["light"], light)


@pytest.mark.parametrize(
    ("layers", "fact"),
    [
        ({}, "no layers"),
        ({"a": np.zeros((0, 4, 3))}, "layer a"),
        ({"a": np.zeros((4, 4, 2))}, "layer a"),
        ({"a": np.full((4, 4), np.nan)}, "not finite"),
        ({"a": np.zeros((4, 4)), "b": np.zeros((4, 5))}, "layer b"),
    ],
)
def test_what_cannot_be_written_is_said_and_leaves_nothing(tmp_path, layers, fact):
    with pytest.raises(InputError, match=fact):
        write_exr(tmp_path / "x.exr", layers)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_takes_no_more_is_said_of_the_file(tmp_path):
    path = tmp_path / "big.exr"
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        with pytest.raises(LuxError, match=r"/big\.exr cannot be written") as caught:
            write_exr(path, {"image": np.random.default_rng(0).random((100, 100, 3))})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert "/.big" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_library_is_not_older_than_its_known_holes():
    import OpenEXR

    version = tuple(int(n) for n in OpenEXR.__version__.split(".")[:3])
    # SECURITY.md of OpenEXR: 38 advisories are closed from here on.
    assert version >= (3, 4, 14)


def test_damage_in_environments_is_counted_and_suns_are_kept(tmp_path):
    from luxcore.render.hdri import mean_luminance, usable_radiance

    sky = np.full((8, 16, 3), 0.5)
    sky[2, 3] = 1e5
    write_exr(tmp_path / "sun.exr", {"sky": sky}, half=False)
    assert mean_luminance(tmp_path / "sun.exr") > 100
    write_exr(tmp_path / "black.exr", {"sky": np.zeros((8, 16, 3))})
    with pytest.raises(InputError, match=r"black\.exr"):
        mean_luminance(tmp_path / "black.exr")
    # A sky with a NaN cannot be written by us: take the bytes of a finite one and put it in.
    import OpenEXR

    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {c: np.ones((8, 16), np.float32) for c in "RGB"}
    planes["G"][1, 1], planes["R"][2, 2], planes["B"][3, 3] = np.nan, -2.0, np.inf
    OpenEXR.File(header, planes).write(str(tmp_path / "nan.exr"))
    radiance, changed = usable_radiance(tmp_path / "nan.exr")
    assert changed == 3
    assert radiance[1, 1, 1] == radiance[2, 2, 0] == 0
    assert radiance[3, 3, 2] == 65504
    assert usable_radiance(tmp_path / "sun.exr")[1] == 0


def test_two_channels_are_neither_grey_nor_colour(tmp_path: Path) -> None:
    import OpenEXR

    plane = np.ones((4, 6), np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"R": plane, "G": plane}).write(str(tmp_path / "two.exr"))
    with pytest.raises(FormatError, match="neither grey nor colour"):
        read_exr_image(tmp_path / "two.exr")


def test_alpha_is_not_the_picture(tmp_path: Path) -> None:
    import OpenEXR

    planes = {"Y": np.full((4, 6), 0.25, np.float32), "A": np.ones((4, 6), np.float32)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(str(tmp_path / "grey.exr"))
    np.testing.assert_array_equal(read_exr_image(tmp_path / "grey.exr"), 0.25)


def save_channels(path: Path, values: dict[str, float]) -> Path:
    """One part with a channel of one value for each name."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: np.full((4, 6), value, np.float32) for name, value in values.items()}
    OpenEXR.File(header, planes).write(str(path))
    return path


def layer(name: str, value: float) -> dict[str, float]:
    return {f"{name}.{channel}": value for channel in "RGB"}


BLENDER = {**layer("ViewLayer.Combined", 0.5), "ViewLayer.Depth.Z": 3.0}
BLENDER |= {**layer("ViewLayer.DiffCol", 0.9), **layer("ViewLayer.Noisy", 0.1)}


@pytest.mark.parametrize(
    "values",
    [
        {"R": 0.5, "G": 0.5, "B": 0.5, **layer("fill", 0.9), "Z": 3.0},
        BLENDER,
        {**BLENDER, **layer("ViewLayer.Combined", 0.7), **layer("Composite.Combined", 0.5)},
        {**layer("beauty", 0.5), "depth.Z": 3.0, "normal.X": 1.0, "normal.Y": 0.0},
        {"Z": 3.0, **layer("beauty", 0.5)},
    ],
    ids=["unnamed", "Blender", "composite", "only colour", "beside depth"],
)
def test_of_several_layers_the_picture_is_taken(tmp_path: Path, values: dict[str, float]) -> None:
    path = save_channels(tmp_path / "layers.exr", values)
    np.testing.assert_array_equal(read_exr_image(path), 0.5)
    np.testing.assert_array_equal(read_exr(path)["image"][..., :3], 0.5)


def test_layers_that_leave_a_choice_are_named(tmp_path: Path) -> None:
    path = save_channels(tmp_path / "two.exr", {**layer("key", 0.2), **layer("fill", 0.3)})
    with pytest.raises(FormatError, match=r"two\.exr holds several layers, fill and key"):
        read_exr_image(path)
    write_exr(tmp_path / "parts.exr", {n: np.ones((4, 6, 3)) for n in ("ambient", "desk", "wall")})
    with pytest.raises(FormatError, match="several layers, ambient, desk and wall"):
        read_exr_image(tmp_path / "parts.exr")
    assert list(read_exr(tmp_path / "parts.exr")) == ["ambient", "desk", "wall"]


def test_of_several_parts_the_beauty_pass_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "parts.exr"
    names = ("ViewLayer.Diffuse Color", "ViewLayer.Combined", "ViewLayer.Depth")
    write_exr(path, {name: np.full((4, 6, 3), i / 2) for i, name in enumerate(names)})
    np.testing.assert_array_equal(read_exr_image(path), 0.5)


@pytest.mark.parametrize("names", ["Z", "XYZ"])
def test_depth_and_directions_are_no_picture(tmp_path: Path, names: str) -> None:
    path = save_channels(tmp_path / "depth.exr", dict.fromkeys(names, 3.0))
    with pytest.raises(FormatError, match=r"depth\.exr has the channels? .*Z, neither grey nor"):
        read_exr_image(path)


def test_a_part_that_cannot_be_read_is_damage_and_the_library_is_silent(tmp_path: Path, capfd):
    rng = np.random.default_rng(0)
    path = tmp_path / "cut.exr"
    write_exr(path, {name: rng.random((24, 32, 3)) for name in "abc"})
    path.write_bytes(path.read_bytes()[:-50])
    with pytest.raises(FormatError, match="2 of its 3 parts can be read"):
        read_exr(path)
    path.write_bytes(path.read_bytes()[:-4000])
    with pytest.raises(FormatError, match=r"cut\.exr"):
        read_exr(path)
    assert capfd.readouterr() == ("", "")


def test_a_folder_is_said_to_be_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder, not a file"):
        read_exr(tmp_path)

"""One photo: it adds up, keeps its size and texture, and bad input ends in one sentence."""

from __future__ import annotations

import json
import resource
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from luxcore.cli.decompose import command
from luxcore.decompose.photo import decompose_photo
from luxcore.errors import DivergedError, InputError, LuxError
from luxcore.files.exr import read_exr_image
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.light.burning import burning_lamps
from luxcore.models.backends import open_decomposer
from luxcore.models.interface import BackendSettings, Decomposer, Decomposition
from tests.models.sketched import sketched_crops, write_tiny_weights


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_weights(tmp_path_factory.mktemp("weights"))[0]


@pytest.fixture(scope="module")
def decomposer(weights: Path) -> Decomposer:
    return open_decomposer("small", BackendSettings(str(weights), options={"long_side_px": 64}))


def scene(size: int = 96) -> tuple[np.ndarray, np.ndarray]:
    """A sketched room's photo with the masks of its visible lamps."""
    crop = sketched_crops(1, size)[0]
    seen = crop.masks.any((1, 2))
    return np.minimum(crop.image_linear, 16).astype(np.float32), crop.masks[seen]


@pytest.mark.parametrize("size", [(64, 96), (97, 61), (16, 200)])
def test_any_size_adds_up_and_keeps_its_size(decomposer: Decomposer, size: tuple) -> None:
    rng = np.random.default_rng(0)
    photo = rng.random((*size, 3)).astype(np.float32)
    masks = np.zeros((2, *size), bool)
    masks[0, 2:6, 2:6] = masks[1, 9:14, 20:30] = True
    result = decompose_photo(photo, masks, decomposer, on=np.array([True, True]))
    assert result.light.olat.shape == (2, *size, 3)
    np.testing.assert_allclose(result.light.recomposed(), photo, atol=1e-5)
    assert result.recomposition_db > 60


def test_the_same_photo_gives_the_same_bits(decomposer: Decomposer) -> None:
    photo, masks = scene()
    first, again = (decompose_photo(photo, masks, decomposer) for _ in range(2))
    np.testing.assert_array_equal(first.light.olat, again.light.olat)


def test_exposure_changes_units_only(decomposer: Decomposer) -> None:
    photo, masks = scene()
    plain = decompose_photo(photo, masks, decomposer)
    dim = decompose_photo(photo / 8, masks, decomposer, exposure=8.0)
    np.testing.assert_allclose(dim.light.olat * 8, plain.light.olat, rtol=1e-4, atol=1e-5)


def test_all_products_come_from_one_prediction(decomposer: Decomposer) -> None:
    photo, masks = scene()
    on = np.ones(len(masks), bool)
    light = decompose_photo(photo, masks, decomposer, on=on).light
    off = light.one_light_off(0)
    np.testing.assert_allclose(off + light.contributions()[0], light.recomposed(), atol=1e-4)


def test_a_lamp_that_is_off_gets_light_and_scale_zero(decomposer: Decomposer) -> None:
    photo, masks = scene()
    on = np.ones(len(masks), bool)
    on[0] = False
    light = decompose_photo(photo, masks, decomposer, on=on).light
    assert (light.scale[0] == 0).all()
    assert light.olat[0].max() > 0
    assert light.contributions()[0].max() == light.olat[0].max()


def test_no_lamps_leave_the_photo_as_ambient(decomposer: Decomposer) -> None:
    photo, masks = scene()
    light = decompose_photo(photo, masks[:0], decomposer).light
    np.testing.assert_allclose(light.ambient, photo, rtol=1e-6)


def test_a_model_that_produces_nan_is_named() -> None:
    class Broken:
        name = "broken"

        def decompose(self, image_linear, masks, on, geometry, seed):  # type: ignore[no-untyped-def]
            nan = np.full_like(image_linear, np.nan)
            return Decomposition(nan, nan[None], np.ones((1, 3), np.float32))

    photo, masks = scene(32)
    with pytest.raises(DivergedError, match="model broken produced ambient light"):
        decompose_photo(photo, masks[:1], Broken())


def test_a_shining_mask_is_on_and_a_pale_shade_is_off() -> None:
    photo = np.full((100, 100, 3), 0.2, np.float32)
    masks = np.zeros((3, 100, 100), bool)
    masks[0, 10:20, 10:20] = masks[1, 60:70, 60:70] = masks[2, 80:85, 10:15] = True
    photo[masks[0]], photo[masks[1]], photo[masks[2]] = 5.0, 0.3, 0.02
    assert burning_lamps(photo, masks).tolist() == [True, False, False]
    assert burning_lamps(photo * 0, masks).tolist() == [False, False, False]


@pytest.mark.slow
def test_twelve_megapixels_stay_below_four_gigabytes(decomposer: Decomposer) -> None:
    photo = np.random.default_rng(0).random((3000, 4000, 3), np.float32)
    masks = np.zeros((2, 3000, 4000), bool)
    masks[0, 100:300, 100:300] = masks[1, 2000:2200, 3000:3300] = True
    light = decomposer.decompose(photo, masks, np.array([True, True]), None, 0)
    np.testing.assert_allclose(light.recomposed()[::50], photo[::50], atol=1e-4)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 4e6


def write_scene(folder: Path) -> tuple[Path, list[Path]]:
    photo, masks = scene()
    write_png(folder / "photo.png", agx(photo))
    paths = [folder / f"mask_{k}.png" for k in range(len(masks))]
    for path, mask in zip(paths, masks, strict=True):
        write_png(path, mask)
    return folder / "photo.png", paths


def run(folder: Path, weights: Path, photo: Path, *arguments: object) -> dict:
    options = ["--out", folder / "out", "--weights", weights, "--json", *arguments]
    result = CliRunner().invoke(command, [str(a) for a in (photo, *options)])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return json.loads(result.stdout)


def test_the_command_writes_all_products(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    about = run(tmp_path, weights, photo, "--mask", masks[0], "--off", masks[1])
    assert [lamp["on"] for lamp in about["lamps"]][1] is False
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names >= {"ambient.exr", "light_00.exr", "light_01.exr", "lights.json", "blend.html"}
    assert read_exr_image(tmp_path / "out" / "light_00.exr").shape == (96, 96, 3)
    pictures = {p.name for p in (tmp_path / "out" / "pictures").iterdir()}
    assert {"light_00_ev0.png", "light_00_ev2.png", "light_00_ev4.png"} <= pictures
    assert about["recomposition_db"] > 35


@pytest.mark.parametrize("mode", ["CMYK", "RGBA", "I;16", "LA", "P"])
def test_photos_of_all_kinds_are_taken(tmp_path: Path, weights: Path, mode: str) -> None:
    photo, masks = write_scene(tmp_path)
    if mode == "I;16":
        grey = np.asarray(Image.open(photo).convert("L"), np.uint16) * 257
        Image.fromarray(grey).save(tmp_path / "other.png")
        path = tmp_path / "other.png"
    else:
        path = tmp_path / ("other.tif" if mode == "CMYK" else "other.png")
        Image.open(photo).convert(mode).save(path)
    assert run(tmp_path, weights, path, "--mask", masks[0])["recomposition_db"] > 35


def test_an_exif_rotation_is_applied_before_masks_are_matched(
    tmp_path: Path, weights: Path
) -> None:
    photo, masks = write_scene(tmp_path)
    image = Image.open(photo).crop((0, 0, 96, 64))
    exif = Image.Exif()
    exif[274] = 6
    image.save(tmp_path / "turned.jpg", exif=exif)
    turned = Image.open(masks[0]).crop((0, 0, 96, 64)).rotate(-90, expand=True)
    turned.save(tmp_path / "mask.png")
    if np.asarray(turned).max() == 0:
        pytest.skip("the lamp lies outside the cropped photo")
    run(tmp_path, weights, tmp_path / "turned.jpg", "--mask", tmp_path / "mask.png")
    assert read_exr_image(tmp_path / "out" / "ambient.exr").shape == (96, 64, 3)


def complaint(tmp_path: Path, weights: Path, photo: Path, *arguments: object) -> str:
    with pytest.raises(LuxError) as caught:
        run(tmp_path, weights, photo, *arguments)
    assert not (tmp_path / "out").exists()
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_bad_photos_end_in_one_sentence(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    cut = tmp_path / "cut.png"
    cut.write_bytes(photo.read_bytes()[:2000])
    assert "cut.png is not a readable picture" in complaint(
        tmp_path, weights, cut, "--mask", masks[0]
    )
    write_png(tmp_path / "dot.png", np.ones((1, 1, 3)))
    write_png(tmp_path / "dot_mask.png", np.ones((1, 1)))
    assert "dot.png is 1x1" in complaint(
        tmp_path, weights, tmp_path / "dot.png", "--mask", tmp_path / "dot_mask.png"
    )
    missing = complaint(tmp_path, weights, tmp_path / "none.png", "--mask", masks[0])
    assert "none.png does not exist" in missing


def test_bad_masks_end_in_one_sentence(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    write_png(tmp_path / "empty.png", np.zeros((96, 96)))
    assert "empty.png is an empty mask" in complaint(
        tmp_path, weights, photo, "--mask", tmp_path / "empty.png"
    )
    write_png(tmp_path / "small.png", np.ones((48, 48)))
    assert "small.png is 48x48, the photo is 96x96" in complaint(
        tmp_path, weights, photo, "--mask", tmp_path / "small.png"
    )
    write_png(tmp_path / "all.png", np.ones((96, 96)))
    assert "all.png covers the whole photo" in complaint(
        tmp_path, weights, photo, "--mask", tmp_path / "all.png"
    )
    assert "overlap by more than half" in complaint(
        tmp_path, weights, photo, "--mask", masks[0], "--mask", masks[0]
    )


def test_bad_weights_and_options_end_in_one_sentence(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    pickled = tmp_path / "model.safetensors"
    pickled.write_bytes(b"\x80\x04\x95 no tensors here")
    assert "not a safetensors file" in complaint(tmp_path, pickled, photo, "--mask", masks[0])
    for option, words in (("steps=3", "no option steps"), ("wide", "NAME=VALUE")):
        text = complaint(tmp_path, weights, photo, "--mask", masks[0], "--option", option)
        assert words in text


def test_a_folder_with_the_photo_in_it_is_not_replaced(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    before = sorted(p.name for p in tmp_path.iterdir())
    arguments = [photo, "--mask", masks[0], "--weights", weights, "--out", tmp_path]
    call = CliRunner().invoke(command, [str(a) for a in arguments])
    assert isinstance(call.exception, InputError)
    assert "which would be lost" in str(call.exception)
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_second_call_replaces_the_first(tmp_path: Path, weights: Path) -> None:
    photo, masks = write_scene(tmp_path)
    run(tmp_path, weights, photo, "--mask", masks[0], "--mask", masks[1])
    run(tmp_path, weights, photo, "--mask", masks[0])
    assert not (tmp_path / "out" / "light_01.exr").exists()

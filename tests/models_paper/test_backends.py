"""Both models behind the project's interface, end to end on random bases of some kilobytes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.cameras import look_at
from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.models.backends import open_decomposer, open_harmonizer
from luxcore.models.diffusion.brackets import merged_light, olat_exposure, olat_picture
from luxcore.models.diffusion.frames import model_size
from luxcore.models.flux_kontext.backend import KontextDecomposer
from luxcore.models.flux_kontext.editor import encode_prompts, load_editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings
from luxcore.models.flux_kontext.prompts import LightOffPrompt, OlatPrompt
from luxcore.models.flux_kontext.weights_folder import TrainedEditor, save_editor
from luxcore.models.interface import (
    BackendSettings,
    Decomposer,
    Decomposition,
    Geometry,
    Harmonizer,
    Reference,
    View,
)
from luxcore.models.multiview_unet.weights_folder import load_base, save_multiview
from luxcore.settings.paper_models import KontextSampling, KontextSettings, MultiViewSettings

HEIGHT, WIDTH = 70, 90
FAST = {"steps": 1, "device": "cpu"}


def photo(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.01, 1.5, (HEIGHT, WIDTH, 3)).astype(np.float32)


def lamp_masks() -> np.ndarray:
    masks = np.zeros((3, HEIGHT, WIDTH), bool)
    masks[0, 5:20, 10:25] = True
    masks[1, 40:60, 50:70] = True
    return masks  # lamp 2 is not seen


@pytest.fixture(scope="module")
def sv_weights(flux_base: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sv")
    settings = KontextSettings(base=str(flux_base), lora_rank=2, prompt_tokens=16)
    editor = load_editor(settings, torch.float32, seed=0)
    save_editor(folder, editor, encode_prompts(settings), settings)
    return folder


def mv_weights(sd_base: Path, folder: Path, variant: str) -> Path:
    settings = MultiViewSettings(base=str(sd_base), variant=variant, joint_channels_min=0)
    model = load_base(settings)
    torch.nn.init.normal_(
        model.module.unet.conv_in.weight, std=0.1, generator=torch.Generator().manual_seed(1)
    )
    save_multiview(folder, model, settings)
    return folder


# --- single view --------------------------------------------------------------------------------


def test_decomposer_takes_a_photo_apart(sv_weights: Path) -> None:
    model = open_decomposer(
        "flux-kontext", BackendSettings(sv_weights=str(sv_weights), options=FAST)
    )
    assert isinstance(model, Decomposer)
    image, on = photo(), np.array([True, False, True])
    light = model.decompose(image, lamp_masks(), on, None, seed=0)
    again = model.decompose(image, lamp_masks(), on, None, seed=0)
    assert light.olat.shape == (3, HEIGHT, WIDTH, 3)
    assert light.olat[:2].any(axis=(1, 2, 3)).all()
    assert not light.olat[2].any()  # not seen: part of the ambient light
    assert not light.scale[1:].any()  # off, and not seen
    for values in (light.ambient, light.olat, light.scale):
        assert np.isfinite(values).all()
        assert (values >= 0).all()
        assert values.dtype == np.float32
    assert (light.ambient <= image).all()
    assert np.array_equal(light.olat, again.olat)
    assert np.array_equal(light.ambient, again.ambient)


def test_a_photo_without_burning_lamps_is_its_own_ambient_light(sv_weights: Path) -> None:
    model = open_decomposer(
        "flux-kontext", BackendSettings(sv_weights=str(sv_weights), options=FAST)
    )
    image = photo()
    off = model.decompose(image, lamp_masks(), np.zeros(3, bool), None, seed=0)
    assert np.array_equal(off.ambient, image)
    none = model.decompose(image, np.zeros((0, HEIGHT, WIDTH), bool), np.zeros(0, bool), None, 0)
    assert np.array_equal(none.recomposed(), image)


class PerfectEditor:
    """Answers every instruction with the truth, as a display picture."""

    module = vae = None
    multiple = 16

    def __init__(self, ambient: np.ndarray, lights: np.ndarray) -> None:
        self.ambient, self.lights, self.off = ambient, lights, np.zeros(len(lights), bool)

    def edit(self, shown, mask, prompt, embeddings, sampling, seed) -> torch.Tensor:
        lamp = 0 if bool(mask[0, 0, 0, 0] > 0.5) else 1
        match prompt:
            case OlatPrompt():
                light = self.lights[lamp]
                made = olat_picture(light, olat_exposure([light]), prompt.brightness.exposure_ev)
            case LightOffPrompt():
                self.off[lamp] = True
                made = agx(self.ambient + self.lights[~self.off].sum(0))
        return torch.from_numpy(made.astype(np.float32)).permute(2, 0, 1)[None]

    def mask_input(self, mask: torch.Tensor) -> torch.Tensor:
        return mask

    def files(self) -> dict[str, dict[str, torch.Tensor]]:
        return {}


def test_a_perfect_model_is_merged_solved_and_recomposed() -> None:
    """What is left is the tone curve's 8-bit-free round trip and the solver's weights."""
    rng = np.random.default_rng(3)
    ambient = rng.uniform(0.02, 0.3, (64, 64, 3)).astype(np.float32)
    lights = rng.uniform(0.01, 2.0, (2, 64, 64, 3)).astype(np.float32)
    masks = np.zeros((2, 64, 64), bool)
    masks[0, :32], masks[1, 32:] = True, True
    editor = PerfectEditor(ambient, lights)
    trained = TrainedEditor(editor, PromptEmbeddings({}, {}))
    model = KontextDecomposer(trained, KontextSampling())
    image = ambient + lights.sum(0)
    light = model.decompose(image, masks, np.ones(2, bool), None, seed=0)
    np.testing.assert_allclose(light.ambient, ambient, rtol=0.02, atol=2e-3)
    contribution = light.olat * light.scale[:, None, None]
    np.testing.assert_allclose(contribution, lights, rtol=0.03, atol=5e-3)
    error = np.mean((agx(light.recomposed()) - agx(image)) ** 2)
    assert -10 * np.log10(error) > 45


def test_brackets_come_back_from_eight_bits() -> None:
    """The lamp itself, the lit wall and the dark corner, within the tone curve's steps."""
    light = np.geomspace(0.003, 100, 64 * 3).reshape(8, 8, 3).astype(np.float32)
    exposure = olat_exposure([light])
    pictures = [np.round(olat_picture(light, exposure, ev) * 255) / 255 for ev in (0.0, -2.0, -4.0)]
    merged = merged_light([picture.astype(np.float32) for picture in pictures], exposure)
    lit = light * exposure > 0.02
    assert np.median(np.abs(merged - light)[lit] / light[lit]) < 0.02


def test_olat_exposure_does_not_depend_on_the_unit_and_survives_darkness() -> None:
    light = photo()
    assert olat_exposure([1000 * light]) * 1000 == pytest.approx(olat_exposure([light]), rel=1e-4)
    assert olat_exposure([0 * light]) == 1
    spark = 0 * light
    spark[0, 0] = 5
    assert olat_exposure([spark]) == pytest.approx(0.7 / 5)


# --- many views ---------------------------------------------------------------------------------


def views(count: int, on: bool = True) -> list[View]:
    made = []
    for index in range(count):
        eye = np.array([0.2 * index, 0.0, 1.5])
        camera = look_at(eye, np.array([3.0, 2.0, 1.0]), 70.0, WIDTH, HEIGHT)
        flat = np.zeros((HEIGHT, WIDTH), np.float32)
        geometry = Geometry(camera, flat, np.zeros((HEIGHT, WIDTH, 3), np.float32))
        switched = np.array([on, False, on])
        made.append(View(photo(index), lamp_masks(), switched, geometry))
    return made


def reference(view: View) -> Reference:
    lights = np.stack([0.3 * view.image_linear, 0.1 * view.image_linear, 0 * view.image_linear])
    scale = np.array([[1, 0.9, 0.8], [0, 0, 0], [0, 0, 0]], np.float32)
    ambient = np.maximum(view.image_linear - scale[0] * lights[0], 0)
    light = Decomposition(ambient, lights, scale)
    return Reference(view, light, np.array([True, True, False]))


@pytest.mark.parametrize("variant", ["mv", "mv-edit"])
def test_harmonizer_lights_every_view(tmp_path: Path, sd_base: Path, variant: str) -> None:
    folder = mv_weights(sd_base, tmp_path, variant)
    settings = BackendSettings(mv_weights=str(folder), options={**FAST, "guidance": 1.5})
    model = open_harmonizer("multiview-unet", settings)
    assert isinstance(model, Harmonizer)
    photos = views(3)
    results = model.run_pass(photos[1:], [reference(photos[0])], seed=0)
    again = model.run_pass(photos[1:], [reference(photos[0])], seed=0)
    assert len(results) == 2
    for view, light, twin in zip(photos[1:], results, again, strict=True):
        assert light.olat.shape == (3, HEIGHT, WIDTH, 3)
        assert light.olat[:2].any(axis=(1, 2, 3)).all()
        assert light.scale[0] == pytest.approx([1, 0.9, 0.8])
        assert not light.scale[1].any()
        assert (light.ambient <= view.image_linear).all()
        for name in ("ambient", "olat", "scale"):
            values = getattr(light, name)
            assert np.isfinite(values).all()
            assert (values >= 0).all()
            assert np.array_equal(values, getattr(twin, name))
    # No reference knows lamp 2, and no view shows it.
    assert not any(light.olat[2].any() for light in results)


def test_views_with_lamps_off_keep_their_photo_as_ambient_light(
    tmp_path: Path, sd_base: Path
) -> None:
    folder = mv_weights(sd_base, tmp_path, "mv")
    settings = BackendSettings(mv_weights=str(folder), options=FAST)
    model = open_harmonizer("multiview-unet", settings)
    photos = views(2, on=False)
    [light] = model.run_pass(photos[1:], [reference(photos[0])], seed=0)
    assert np.array_equal(light.ambient, photos[1].image_linear)
    assert light.olat[0].any()
    assert not light.scale.any()
    assert model.run_pass([], [], seed=0) == []


def test_pass_limits_are_said_in_one_sentence(tmp_path: Path, sd_base: Path) -> None:
    folder = mv_weights(sd_base, tmp_path, "mv")
    settings = BackendSettings(mv_weights=str(folder), options=FAST)
    model = open_harmonizer("multiview-unet", settings)
    photos = views(2)
    with pytest.raises(InputError, match="at most 15 views with references, got 16"):
        model.run_pass(photos[:1] * 15, [reference(photos[1])], seed=0)
    blind = View(photos[0].image_linear, photos[0].masks, photos[0].on, None)
    with pytest.raises(InputError, match="needs the camera of every view"):
        model.run_pass([blind], [reference(photos[1])], seed=0)


# --- what goes wrong ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["flux-kontext", "multiview-unet"])
def test_absent_weights_are_one_sentence(name: str) -> None:
    opener = open_decomposer if name == "flux-kontext" else open_harmonizer
    with pytest.raises(InputError, match=f"{name} ships no weights"):
        opener(name, BackendSettings())
    with pytest.raises(InputError, match="nowhere is no local folder"):
        opener(name, BackendSettings(sv_weights="nowhere", mv_weights="nowhere"))
    with pytest.raises(InputError, match="unknown key stpes"):
        opener(name, BackendSettings(options={"stpes": 3}))


def test_unknown_device_is_one_sentence(sv_weights: Path) -> None:
    settings = BackendSettings(sv_weights=str(sv_weights), options={"device": "abacus"})
    with pytest.raises(InputError, match='no device "abacus"'):
        open_decomposer("flux-kontext", settings)


@pytest.mark.parametrize(
    ("photo_size", "inner"),
    [
        ((512, 512), (512, 512)),
        ((1000, 700), (992, 688)),
        ((3000, 4000), (880, 1168)),
        ((1, 1), (16, 16)),
    ],
)
def test_photos_of_any_size_get_a_size_that_fits(
    photo_size: tuple[int, int], inner: tuple[int, int]
) -> None:
    assert model_size(*photo_size, 1024 * 1024, 16) == inner
    assert inner[0] * inner[1] <= 1024 * 1024


@pytest.mark.slow
def test_two_processes_learn_what_one_learns(tmp_path: Path) -> None:
    """accelerate's data parallelism on two CPU processes; gradients are summed in another order."""
    script = Path(__file__).parent / "two_processes.py"
    for count in (1, 2):
        subprocess.run(
            [
                sys.executable,
                "-m",
                "accelerate.commands.launch",
                "--cpu",
                "--num_machines=1",
                "--mixed_precision=no",
                "--dynamo_backend=no",
                f"--num_processes={count}",
                str(script),
                str(tmp_path / str(count)),
            ],
            check=True,
            timeout=300,
        )
    from luxcore.models.diffusion.weights import read_weights

    one, two = (read_weights(tmp_path / str(n) / "model" / "w.safetensors") for n in (1, 2))
    for name in one:
        torch.testing.assert_close(one[name], two[name], rtol=1e-4, atol=1e-5)

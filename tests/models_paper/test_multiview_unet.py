"""The multi-view U-Net on a random base of some kilobytes."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.cameras import Camera, look_at
from luxcore.data.crops import LitCrop
from luxcore.data.multiview import MultiViewSets
from luxcore.errors import InputError
from luxcore.models.diffusion.loop import train
from luxcore.models.diffusion.noise import alphas_cumprod, noise_scheduler
from luxcore.models.diffusion.options import training_digest
from luxcore.models.diffusion.rooms import LitSets
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.weights import read_weights
from luxcore.models.multiview_unet.attention import ViewAttention
from luxcore.models.multiview_unet.condition import MV_CHANNELS, Condition
from luxcore.models.multiview_unet.examples import ViewExamples
from luxcore.models.multiview_unet.rays import plucker_rays
from luxcore.models.multiview_unet.sampling import sample
from luxcore.models.multiview_unet.trainee import MultiViewTrainee
from luxcore.models.multiview_unet.weights_folder import (
    MultiViewModel,
    load_base,
    open_multiview,
    save_multiview,
)
from luxcore.settings.paper_models import (
    DataSettings,
    LoopSettings,
    MultiViewSettings,
    MultiViewTraining,
    NoiseSettings,
    TrainingPhase,
)
from tests.models_paper.room import panorama

LATENT = 4


@pytest.fixture
def settings(sd_base: Path) -> MultiViewSettings:
    return MultiViewSettings(base=str(sd_base), joint_channels_min=0)


@pytest.fixture
def model(settings: MultiViewSettings) -> MultiViewModel:
    """With the new input channels no longer zero, as after some training."""
    model = load_base(settings)
    with torch.no_grad():
        generator = torch.Generator().manual_seed(1)
        weight = model.module.unet.conv_in.weight
        weight.copy_(torch.randn(weight.shape, generator=generator) * 0.1)
    model.module.eval()
    return model


def condition(views: int, references: int, scenes: int = 1, edits: bool = False) -> Condition:
    generator = torch.Generator().manual_seed(views)

    def latents(channels: int) -> torch.Tensor:
        return torch.randn(scenes, views, channels, LATENT, LATENT, generator=generator)

    is_reference = torch.zeros(scenes, views, dtype=torch.bool)
    is_reference[:, :references] = True
    return Condition(
        photo=latents(4),
        reference=latents(4),
        is_reference=is_reference,
        rays=latents(6),
        task=torch.zeros(scenes),
        present=torch.ones(scenes, views, dtype=torch.bool),
        light_mask=latents(1).abs() if edits else None,
    )


def predict(model: MultiViewModel, told: Condition, timestep: int = 500) -> torch.Tensor:
    noisy = torch.randn(told.photo.shape, generator=torch.Generator().manual_seed(7))
    with torch.no_grad():
        return model.module.predict(noisy, torch.tensor(timestep), told)


def test_input_layer_has_the_paper_s_channels(settings: MultiViewSettings) -> None:
    assert MV_CHANNELS == 4 + 4 + 4 + 1 + 6 + 1
    assert load_base(settings).module.unet.conv_in.in_channels == 20
    edit = load_base(settings.model_copy(update={"variant": "mv-edit"}))
    assert edit.module.unet.conv_in.in_channels == 21


def test_a_fresh_model_does_not_see_its_condition(settings: MultiViewSettings) -> None:
    """New input channels start at zero: training starts from the base. Padding is excluded, and
    joint attention alone does make views depend on each other."""
    fresh = load_base(settings)
    fresh.module.eval()
    told = condition(3, 1)
    other = replace(told, photo=told.photo + 1, rays=told.rays * 2, task=torch.ones(1))
    assert torch.equal(predict(fresh, told), predict(fresh, other))


@pytest.mark.parametrize("views", [1, 4, 14])
def test_padding_changes_no_view(model: MultiViewModel, views: int) -> None:
    """15 views with padding against the same views without. Float32 sums over other lengths: the
    bound is some units in the last place of values around 1."""
    padded = condition(15, 1)
    padded.present[:, views:] = False
    alone = Condition(
        photo=padded.photo[:, :views],
        reference=padded.reference[:, :views],
        is_reference=padded.is_reference[:, :views],
        rays=padded.rays[:, :views],
        task=padded.task,
        present=padded.present[:, :views],
    )
    noisy = torch.randn(1, 15, 4, LATENT, LATENT, generator=torch.Generator().manual_seed(7))
    timestep = torch.tensor(300)
    with torch.no_grad():
        with_padding = model.module.predict(noisy, timestep, padded)[:, :views]
        without = model.module.predict(noisy[:, :views], timestep, alone)
        louder = replace(padded, photo=padded.photo.clone())
        louder.photo[:, views:] *= 100
        still = model.module.predict(noisy, timestep, louder)[:, :views]
    torch.testing.assert_close(with_padding, without, rtol=0, atol=1e-5)
    assert torch.equal(still, with_padding)


def test_views_exchange_information_only_where_attention_is_joint(
    model: MultiViewModel, settings: MultiViewSettings
) -> None:
    told = condition(3, 1)
    changed = replace(told, reference=told.reference + 1)  # only view 0 is a reference
    moved = (predict(model, changed) - predict(model, told)).abs().amax(dim=(0, 2, 3, 4))
    assert (moved > 1e-6).all()
    apart = load_base(settings.model_copy(update={"joint_channels_min": 10_000}))
    apart.module.eval()
    apart.module.unet.conv_in.load_state_dict(model.module.unet.conv_in.state_dict())
    moved = (predict(apart, changed) - predict(apart, told)).abs().amax(dim=(0, 2, 3, 4))
    assert moved[0] > 1e-6
    assert (moved[1:] == 0).all()


def test_a_single_view_and_the_order_of_views(model: MultiViewModel) -> None:
    one = predict(model, condition(1, 0))
    assert one.shape == (1, 1, 4, LATENT, LATENT)
    assert torch.isfinite(one).all()
    told = condition(4, 1)
    order = torch.tensor([2, 0, 3, 1])
    turned = replace(
        told,
        photo=told.photo[:, order],
        reference=told.reference[:, order],
        is_reference=told.is_reference[:, order],
        rays=told.rays[:, order],
    )
    noisy = torch.randn(told.photo.shape, generator=torch.Generator().manual_seed(7))
    with torch.no_grad():
        straight = model.module.predict(noisy, torch.tensor(500), told)
        permuted = model.module.predict(noisy[:, order], torch.tensor(500), turned)
    torch.testing.assert_close(permuted, straight[:, order], rtol=0, atol=1e-5)


@pytest.mark.parametrize("timestep", [0, 999])
@pytest.mark.parametrize("zero_snr", [True, False])
def test_loss_is_finite_at_both_ends_of_the_schedule(
    settings: MultiViewSettings, timestep: int, zero_snr: bool
) -> None:
    noise = NoiseSettings(zero_terminal_snr=zero_snr)
    model = load_base(settings.model_copy(update={"noise": noise}))
    told = condition(2, 1)
    clean = torch.randn(told.photo.shape, generator=torch.Generator().manual_seed(3))
    loss = model.module(
        clean=clean,
        noise=torch.randn(clean.shape, generator=torch.Generator().manual_seed(4)),
        level=torch.tensor([float(timestep)]),
        photo=told.photo,
        is_reference=told.is_reference,
        rays=told.rays,
        task=told.task,
        present=told.present,
    )
    loss.sum().backward()
    assert torch.isfinite(loss).all()
    gradients = [p.grad for p in model.module.parameters() if p.grad is not None]
    assert all(torch.isfinite(gradient).all() for gradient in gradients)


def test_references_and_padding_are_not_scored(model: MultiViewModel) -> None:
    """Their targets may be anything: the loss and its gradient stay the same."""
    told = condition(4, 1)
    told.present[:, 3] = False
    generator = torch.Generator().manual_seed(3)
    clean, noise = (torch.randn(told.photo.shape, generator=generator) for _ in range(2))
    other = noise.clone()
    other[:, 3] += 5
    tensors = {
        "clean": clean,
        "level": torch.tensor([500.0]),
        "photo": told.photo,
        "is_reference": told.is_reference,
        "rays": told.rays,
        "task": told.task,
        "present": told.present,
    }
    with torch.no_grad():
        assert torch.equal(
            model.module(noise=noise, **tensors), model.module(noise=other, **tensors)
        )
        all_given = {**tensors, "is_reference": torch.ones(1, 4, dtype=torch.bool)}
        assert float(model.module(noise=noise, **all_given)) == 0


def test_guidance_with_an_empty_condition_is_no_guidance(model: MultiViewModel) -> None:
    told = condition(3, 0)
    assert told.is_empty
    plain = sample(model.module, told, steps=2, guidance=1.0, seed=5)
    guided = sample(model.module, told, steps=2, guidance=7.0, seed=5)
    assert torch.isfinite(plain).all()
    assert torch.equal(plain, guided)


def test_guidance_moves_away_from_the_emptied_condition(model: MultiViewModel) -> None:
    told = condition(3, 1)
    emptied = told.emptied()
    assert emptied.is_empty
    assert torch.equal(emptied.rays, told.rays)
    assert torch.equal(emptied.photo, told.photo)
    plain, guided, strong = (
        sample(model.module, told, steps=1, guidance=g, seed=5) for g in (1.0, 2.0, 3.0)
    )
    assert not torch.equal(plain, guided)
    # One DDIM step is affine in the answer, and the answer in the guidance.
    torch.testing.assert_close(strong - plain, 2 * (guided - plain), rtol=1e-3, atol=1e-4)


def test_sampling_repeats_and_follows_the_seed(model: MultiViewModel) -> None:
    told = condition(2, 1)
    first, again = (sample(model.module, told, 2, 2.0, seed=0) for _ in range(2))
    assert torch.equal(first, again)
    assert not torch.equal(first, sample(model.module, told, 2, 2.0, seed=1))


def test_mv_edit_is_guided_by_light_masks(settings: MultiViewSettings) -> None:
    edit = load_base(settings.model_copy(update={"variant": "mv-edit"}))
    edit.module.eval()
    torch.nn.init.normal_(
        edit.module.unet.conv_in.weight, std=0.1, generator=torch.Generator().manual_seed(1)
    )
    told = condition(2, 0, edits=True)
    assert not told.is_empty
    assert told.emptied().is_empty
    assert not torch.equal(predict(edit, told), predict(edit, told.emptied()))


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_large_logits_do_not_overflow_half_precision(dtype: torch.dtype) -> None:
    """Logits near 4e6 (fp16 ends at 65,504): softmax must still give a convex combination."""
    from diffusers.models.attention_processor import Attention

    torch.manual_seed(0)
    attention = Attention(query_dim=16, heads=1, dim_head=16, bias=False, upcast_attention=True)
    for layer in (attention.to_q, attention.to_k):
        torch.nn.init.eye_(layer.weight)
    attention = attention.to(dtype).requires_grad_(False)
    tokens = torch.full((2, 3, 16), 1000.0, dtype=dtype)
    tokens[:, 1] *= -1
    present = torch.tensor([[True, True]])
    mixed = ViewAttention(joint=True)(attention, tokens, present=present)
    assert torch.isfinite(mixed).all()


def test_saved_and_reloaded_model_predicts_the_same_bits(
    tmp_path: Path, model: MultiViewModel, settings: MultiViewSettings
) -> None:
    save_multiview(tmp_path, model, settings)
    back = open_multiview(tmp_path, base="")
    # torch takes other kernels, and rounds otherwise, where a parameter might need a gradient.
    model.module.requires_grad_(False)
    told = condition(3, 1)
    assert torch.equal(predict(model, told), predict(back, told))
    assert {p.suffix for p in tmp_path.iterdir()} == {".json", ".safetensors"}


def test_weights_of_another_u_net_are_refused(
    tmp_path: Path, model: MultiViewModel, settings: MultiViewSettings
) -> None:
    other = settings.model_copy(update={"variant": "mv-edit"})
    save_multiview(tmp_path, model, other)
    with pytest.raises(InputError, match=r"conv_in\.weight must have shape"):
        open_multiview(tmp_path, base="")


@pytest.mark.parametrize("views", [1, 2, 15])
def test_log_snr_is_shifted_by_the_logarithm_of_the_views(views: int) -> None:
    plain = NoiseSettings(zero_terminal_snr=False)
    shifted = torch.logit(alphas_cumprod(plain, views)) - torch.logit(alphas_cumprod(plain, 1))
    torch.testing.assert_close(shifted, torch.full_like(shifted, -math.log(views)))
    scheduler = noise_scheduler(plain, views)
    # The scheduler multiplies 1000 float32 factors: relative errors up to 1000 · 6e-8.
    torch.testing.assert_close(
        scheduler.alphas_cumprod.double(), alphas_cumprod(plain, views), rtol=1e-3, atol=0
    )


def test_schedule_ends_in_pure_noise() -> None:
    alphas = noise_scheduler(NoiseSettings(), 15).alphas_cumprod
    assert float(alphas[-1]) == 0
    assert (alphas.diff() < 0).all()
    assert noise_scheduler(NoiseSettings(), 15).config.timestep_spacing == "trailing"


def _cameras(offset: np.ndarray) -> list[Camera]:
    eyes = [np.array([0.0, 0, 1.5]), np.array([1.0, 0.2, 1.4]), np.array([0.3, 1.1, 1.6])]
    return [look_at(offset + eye, offset + np.array([3.0, 3, 1]), 70.0, 64, 48) for eye in eyes]


def test_plucker_rays_are_lines() -> None:
    rays = plucker_rays(_cameras(np.zeros(3)), 6, 8).numpy()
    directions, moments = rays[:, :3], rays[:, 3:]
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((directions * moments).sum(1), 0, atol=1e-6)
    assert np.linalg.norm(moments, axis=1).max() <= 1 + 1e-6
    assert not moments[0].any()  # the first camera is the origin


def test_plucker_rays_of_one_point_meet_there() -> None:
    """moment = point × direction holds for any point of the line, in the first camera's frame."""
    cameras = _cameras(np.zeros(3))
    first = cameras[0]
    unit = max(np.linalg.norm(c.centre - first.centre) for c in cameras)
    rays = plucker_rays(cameras, 48, 64).numpy()
    world = np.array([2.0, 1.5, 1.2])
    point = first.c2w[:3, :3].T @ (world - first.centre) / unit
    for camera, ray in zip(cameras, rays, strict=True):
        local = camera.viewmat[:3, :3] @ world + camera.viewmat[:3, 3]
        u = local[0] / local[2] * camera.fx + camera.cx
        v = local[1] / local[2] * camera.fy + camera.cy
        direction, moment = np.split(ray[:, int(v), int(u)], 2)
        # The nearest pixel centre is up to half a pixel away.
        assert (
            np.linalg.norm(np.cross(point, direction) - moment)
            < 1.5 * np.linalg.norm(point) / camera.fx
        )


@pytest.mark.parametrize("distance_m", [0.0, 1e6])
def test_plucker_rays_do_not_depend_on_where_the_room_lies(distance_m: float) -> None:
    """At 1e6 m float64 positions keep 1e-10 m; relative to a metre that leaves float32 exact."""
    near = plucker_rays(_cameras(np.zeros(3)), 6, 8)
    far = plucker_rays(_cameras(np.array([distance_m, -distance_m, distance_m])), 6, 8)
    assert torch.isfinite(far).all()
    torch.testing.assert_close(far, near, rtol=0, atol=1e-6)


def test_plucker_rays_of_equal_cameras_and_of_one() -> None:
    camera = _cameras(np.zeros(3))[1]
    one = plucker_rays([camera], 6, 8)
    two = plucker_rays([camera, camera], 6, 8)
    assert torch.equal(two[0], two[1])
    assert torch.equal(two[0], one[0])
    assert not one[:, 3:].any()


# --- training -----------------------------------------------------------------------------------

SIDE = 32


@pytest.fixture(scope="module")
def sets() -> MultiViewSets:
    rooms = [panorama(offset_m=0.0), panorama(offset_m=0.5)]
    return MultiViewSets(rooms, (SIDE, SIDE), seed=0)


class FewViews:
    """A room that has only two views, however many are asked for."""

    def __init__(self, sets: MultiViewSets) -> None:
        self.sets = sets

    def crops(self, index: int, views: int) -> list[LitCrop]:
        return self.sets.crops(index, min(views, 2))


def examples_of(sets: LitSets, **changes: object) -> ViewExamples:
    data = DataSettings(side=64)
    return ViewExamples(sets, data, MultiViewSettings(**changes), seed=0)


def test_sets_follow_from_their_key(sets: MultiViewSets) -> None:
    examples = examples_of(sets)
    first, again, other = (examples[ExampleKey(i, 3)] for i in (4, 4, 5))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["photo"], other["photo"])
    assert first["photo"].shape == first["target"].shape == (3, 3, SIDE, SIDE)
    assert first["rays"].shape == (3, 6, SIDE // 8, SIDE // 8)
    assert first["present"].all()


def test_references_show_the_lamp_and_something_is_left(sets: MultiViewSets) -> None:
    examples = examples_of(sets, reference_dropout=0.0, max_references=14)
    for position in range(12):
        example = examples[ExampleKey(position, 3)]
        is_reference, shows = example["is_reference"], example["mask"].any(dim=(1, 2, 3))
        assert 1 <= int(is_reference.sum()) <= 2
        assert shows[is_reference].all()
    dropped = examples_of(sets, reference_dropout=1.0)[ExampleKey(0, 3)]
    assert not dropped["is_reference"].any()
    assert not dropped["mask"].any()
    edit = examples_of(sets, variant="mv-edit", reference_dropout=0.0)[ExampleKey(0, 3)]
    assert not edit["is_reference"].any()
    assert edit["mask"].any()


def test_a_room_with_few_views_is_padded(sets: MultiViewSets) -> None:
    example = examples_of(FewViews(sets), reference_dropout=0.0)[ExampleKey(1, 5)]
    assert example["present"].tolist() == [True, True, False, False, False]
    assert example["photo"].shape[0] == 5
    assert not example["photo"][2:].any()
    alone = examples_of(sets, reference_dropout=0.0)[ExampleKey(1, 1)]
    assert not alone["is_reference"].any()  # the only view is the one to learn


def trained(
    base: Path, out: Path, sets: LitSets, variant: str = "mv", **changes: object
) -> tuple[Path, list[float]]:
    settings = MultiViewTraining(
        model=MultiViewSettings(base=str(base), variant=variant, joint_channels_min=0),
        data=DataSettings(side=64),
        loop=LoopSettings(
            workers=0, mixed_precision="no", checkpoint_every=2, log_every=1, **changes
        ),
        phases=(
            TrainingPhase(steps=2, batch_size=2, views=2),
            TrainingPhase(steps=1, batch_size=1, views=3),
        ),
    )
    model = load_base(settings.model)
    model.module.unet.enable_gradient_checkpointing()
    examples = ViewExamples(sets, settings.data, settings.model, seed=0)
    trainee = MultiViewTrainee(model, examples, settings)
    losses: list[float] = []

    class Losses:
        def metrics(self, step: int, values: dict[str, float]) -> None:
            losses.append(values["loss"])

        def picture(self, step: int, name: str, image: np.ndarray) -> None:
            assert image.shape == (4 * SIDE, 3 * SIDE, 3)

    digest = training_digest(settings)
    folder = train(trainee, settings.phases, settings.loop, out, digest, Losses())
    return folder, losses


@pytest.mark.usefixtures("fresh_accelerator")
def test_training_resumes_to_the_same_bits_across_phases(
    tmp_path: Path, sd_base: Path, sets: MultiViewSets
) -> None:
    """AdamW on the whole U-Net, its running average, 2 then 3 views; cut at the change."""
    whole, losses = trained(sd_base, tmp_path / "whole", sets, validate_every=3)
    parts = tmp_path / "parts"
    shutil.copytree(tmp_path / "whole" / "checkpoint", parts / "checkpoint")
    shutil.rmtree(parts / "checkpoint" / "00000003")
    again, later = trained(sd_base, parts, sets)
    assert len(losses) == 3
    assert later == losses[2:]
    one, two = (read_weights(f / "unet.safetensors") for f in (whole, again))
    assert all(torch.equal(one[name], two[name]) for name in one)
    assert one["unet.conv_in.weight"][:, 4:].any()  # the new channels have learned
    open_multiview(whole, base="")


@pytest.mark.usefixtures("fresh_accelerator")
def test_mv_edit_trains(tmp_path: Path, sd_base: Path, sets: MultiViewSets) -> None:
    folder, losses = trained(sd_base, tmp_path, FewViews(sets), variant="mv-edit")
    assert np.isfinite(losses).all()
    open_multiview(folder, base="")


def test_one_scene_is_learned(model: MultiViewModel) -> None:
    """Forty steps on one scene and one noise: the loss falls well below where it started."""
    told = condition(3, 1)
    generator = torch.Generator().manual_seed(3)
    clean, noise = (torch.randn(told.photo.shape, generator=generator) for _ in range(2))
    optimizer = torch.optim.AdamW(model.module.parameters(), lr=5e-3)
    losses = []
    for _ in range(40):
        loss = model.module(
            clean=clean,
            noise=noise,
            level=torch.tensor([500.0]),
            photo=told.photo,
            is_reference=told.is_reference,
            rays=told.rays,
            task=told.task,
            present=told.present,
        ).mean()
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        losses.append(loss.item())
    assert losses[-1] < 0.5 * losses[0]

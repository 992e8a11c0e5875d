"""The multi-view U-Net on a random base of some kilobytes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from luxcore.errors import InputError
from luxcore.models.diffusion.noise import alphas_cumprod, noise_scheduler
from luxcore.models.multiview_unet.attention import ViewAttention
from luxcore.models.multiview_unet.condition import MV_CHANNELS, Condition
from luxcore.models.multiview_unet.sampling import sample
from luxcore.models.multiview_unet.weights_folder import (
    MultiViewModel,
    load_base,
    open_multiview,
    save_multiview,
)
from luxcore.settings.paper_models import (
    MultiViewSettings,
    NoiseSettings,
)
from tests.models_paper.scenes import LATENT, condition


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

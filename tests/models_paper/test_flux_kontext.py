"""The single-view model and its variants on random bases of some kilobytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from luxcore.errors import FormatError, InputError
from luxcore.models.diffusion.base import load_component
from luxcore.models.diffusion.weights import read_weights, trainable, write_weights
from luxcore.models.flux_kontext.editor import KontextEditor, encode_prompts, load_editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings, load_embeddings
from luxcore.models.flux_kontext.lora import lora_parameters
from luxcore.models.flux_kontext.mask import MaskTokens, add_mask_tokens, mask_added
from luxcore.models.flux_kontext.packing import pack, position_ids
from luxcore.models.flux_kontext.prompts import (
    Brightness,
    LightKind,
    LightOffPrompt,
    OlatPrompt,
    all_prompts,
    kind_named,
)
from luxcore.models.flux_kontext.weights_folder import open_editor, save_editor
from luxcore.settings.paper_models import (
    KontextSampling,
)
from tests.models_paper.edits import photo_and_mask, settings_of, tensors

SAMPLING = KontextSampling(steps=2)


def test_instructions_are_the_papers_templates() -> None:
    texts = [prompt.text for prompt in all_prompts()]
    assert len(texts) == len(set(texts)) == 4 * len(LightKind)
    assert OlatPrompt(LightKind.FLOOR, Brightness.LOW).text == (
        "OLAT. Darken the room to a night scene: eliminate all light sources and window light. "
        "The only light source should be the selected floor lamp, on at low brightness, "
        "according to the selection mask."
    )
    assert LightOffPrompt(LightKind.LIGHT).text == (
        "LTOFF. Only turn off the selected light, according to the selection mask. "
        "Keep the remaining light sources unchanged."
    )
    assert [b.exposure_ev for b in (Brightness.HIGH, Brightness.MEDIUM, Brightness.LOW)] == [
        0,
        -2,
        -4,
    ]
    names = ("Ceiling", "table", "LED_Sign_Text")
    assert [kind_named(n) for n in names] == [LightKind.CEILING, LightKind.TABLE, LightKind.LIGHT]


def test_embeddings_are_encoded_once_and_kept(tmp_path: Path, embeddings: PromptEmbeddings) -> None:
    path = tmp_path / "prompts.safetensors"
    embeddings.save(path)
    back = load_embeddings(path)
    ours, theirs = embeddings.batch(all_prompts()), back.batch(all_prompts())
    assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))
    assert ours[0].shape == (20, 16, 32)
    tensors = read_weights(path)
    tensors.popitem()
    write_weights(path, tensors)
    with pytest.raises(InputError, match="other instructions"):
        load_embeddings(path)


def test_packing_is_that_of_the_pipeline() -> None:
    from diffusers import FluxKontextPipeline

    latents = torch.randn(2, 16, 6, 8, generator=torch.Generator().manual_seed(0))
    theirs = FluxKontextPipeline._pack_latents(latents, 2, 16, 6, 8)
    assert torch.equal(pack(latents), theirs)
    ids = FluxKontextPipeline._prepare_latent_image_ids(1, 3, 4, "cpu", torch.float32)
    assert torch.equal(position_ids(3, 4, 0), ids)


def test_mask_patches_lie_on_the_tokens_of_their_pixels() -> None:
    """A mask in one 16x16 patch changes the token that is packed from the latents there."""
    tokens = MaskTokens(64)
    torch.nn.init.ones_(tokens.linear.weight)
    mask = torch.zeros(1, 1, 48, 64)
    mask[..., 16:32, 48:64] = 1  # row 1, column 3 of 3 x 4
    changed = tokens(mask).sum(-1)[0].nonzero().flatten().tolist()
    latents = torch.zeros(1, 16, 6, 8)
    latents[..., 2:4, 6:8] = 1
    assert changed == pack(latents).sum(-1)[0].nonzero().flatten().tolist() == [7]


def test_only_the_photo_s_tokens_get_the_mask() -> None:
    hidden, mask = torch.zeros(1, 5, 3), torch.ones(1, 2, 3)
    assert add_mask_tokens(hidden, mask)[0, :, 0].tolist() == [0, 0, 0, 1, 1]


def test_a_fresh_mask_layer_leaves_the_base_s_answer(
    editor: KontextEditor, embeddings: PromptEmbeddings, flux_base: Path
) -> None:
    """Zero-initialised mask layer and LoRA: the answer is the untouched base's, bit for bit."""
    from diffusers import FluxTransformer2DModel

    given = tensors(editor, embeddings)
    base = load_component(FluxTransformer2DModel, flux_base, "transformer", torch.float32)
    ids = torch.cat([position_ids(4, 4, 0), position_ids(4, 4, 1)])
    noisy = 0.5 * given["clean"] + 0.5 * given["noise"]
    with torch.no_grad():
        ours = editor.module.velocity(
            noisy,
            given["level"],
            given["condition"],
            given["mask"],
            given["sequence"],
            given["pooled"],
        )
        plain = base(
            hidden_states=torch.cat([pack(noisy), pack(given["condition"])], dim=1),
            timestep=given["level"],
            guidance=torch.tensor([3.5]),
            pooled_projections=given["pooled"],
            encoder_hidden_states=given["sequence"],
            txt_ids=torch.zeros(16, 3),
            img_ids=ids,
        ).sample[:, :16]
    torch.testing.assert_close(ours, plain, rtol=0, atol=1e-6)


def test_a_trained_mask_layer_changes_the_answer_and_the_hook_goes_away(
    editor: KontextEditor, embeddings: PromptEmbeddings
) -> None:
    photo, mask = photo_and_mask()
    before = editor.edit(photo, mask, all_prompts()[0], embeddings, SAMPLING, seed=0)
    torch.nn.init.ones_(editor.module.mask_tokens.linear.weight)
    with_mask = editor.edit(photo, mask, all_prompts()[0], embeddings, SAMPLING, seed=0)
    empty = editor.edit(photo, 0 * mask, all_prompts()[0], embeddings, SAMPLING, seed=0)
    assert not torch.equal(before, with_mask)
    assert torch.equal(before, empty)
    assert not editor.module.transformer._forward_pre_hooks


def test_mask_added_leaves_no_hook_after_an_error() -> None:
    module = torch.nn.Identity()

    def fail() -> Iterator[None]:
        with mask_added(module, torch.zeros(1, 1, 1), None):
            raise KeyboardInterrupt
        yield

    with pytest.raises(KeyboardInterrupt):
        list(fail())
    assert not module._forward_pre_hooks


@pytest.mark.parametrize("size", [(64, 64), (48, 80)])
def test_editing_keeps_the_size_repeats_and_follows_the_seed(
    editor: KontextEditor, embeddings: PromptEmbeddings, size: tuple[int, int]
) -> None:
    photo = torch.rand(1, 3, *size, generator=torch.Generator().manual_seed(2))
    mask = torch.ones(1, 1, *size)
    first, again, other = (
        editor.edit(photo, mask, all_prompts()[3], embeddings, SAMPLING, seed) for seed in (0, 0, 1)
    )
    assert first.shape == photo.shape
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
    assert float(first.min()) >= 0
    assert float(first.max()) <= 1


def test_token_variant_puts_the_mask_beside_the_photo(
    flux_base: Path, embeddings: PromptEmbeddings
) -> None:
    token = load_editor(settings_of(flux_base, "token"), torch.float32, seed=0)
    assert set(token.files()) == {"lora.safetensors"}
    assert position_ids(2, 3, 1, first_column=3)[:, 2].tolist() == [3, 4, 5, 3, 4, 5]
    photo, mask = photo_and_mask()
    seen = token.edit(photo, mask, all_prompts()[0], embeddings, SAMPLING, seed=0)
    other = token.edit(photo, 1 - mask, all_prompts()[0], embeddings, SAMPLING, seed=0)
    assert seen.shape == photo.shape
    assert not torch.equal(seen, other)


def test_lora_sits_in_every_attention_layer(editor: KontextEditor) -> None:
    """8 layers in a double block, 3 in a single one, two matrices each."""
    names = lora_parameters(editor.module.transformer)
    assert len(names) == 2 * (8 + 3)
    assert "transformer.transformer_blocks.0.attn.to_out.0.lora_A.weight" in names
    assert {p.shape[0] for n, p in names.items() if ".lora_A." in n} == {4}
    trained = trainable(editor.module)
    assert len(trained) == len(names) + 2
    assert all(p.dtype == torch.float32 for p in trained.values())


def test_single_blocks_output_is_adapted_only_when_asked_for(flux_base: Path) -> None:
    more = load_editor(settings_of(flux_base, lora_single_out=True), torch.float32, seed=0)
    names = lora_parameters(more.module.transformer)
    assert len(names) == 2 * (8 + 3 + 1)
    assert "transformer.proj_out.lora_A.weight" not in names


def test_adapters_start_from_the_seed(flux_base: Path) -> None:
    def first(seed: int) -> torch.Tensor:
        editor = load_editor(settings_of(flux_base), torch.float32, seed)
        name = "transformer.transformer_blocks.0.attn.to_q.lora_A.weight"
        return lora_parameters(editor.module.transformer)[name]

    assert torch.equal(first(0), first(0))
    assert not torch.equal(first(0), first(1))


def test_diffusers_reads_our_lora(tmp_path: Path, editor: KontextEditor, flux_base: Path) -> None:
    """The file is in diffusers' own form: its loader takes every key."""
    from diffusers import FluxKontextPipeline, FluxTransformer2DModel

    for parameter in lora_parameters(editor.module.transformer).values():
        torch.nn.init.normal_(parameter, generator=torch.Generator().manual_seed(9))
    write_weights(tmp_path / "lora.safetensors", lora_parameters(editor.module.transformer))
    plain = load_component(FluxTransformer2DModel, flux_base, "transformer", torch.float32)
    pipeline = FluxKontextPipeline(
        scheduler=editor.scheduler,
        vae=editor.vae,
        text_encoder=None,
        tokenizer=None,
        text_encoder_2=None,
        tokenizer_2=None,
        transformer=plain,
    )
    pipeline.load_lora_weights(tmp_path, weight_name="lora.safetensors", prefix="transformer")
    layer = plain.transformer_blocks[0].attn.to_q
    ours = editor.module.transformer.transformer_blocks[0].attn.to_q
    tokens = torch.randn(2, 32, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        torch.testing.assert_close(layer(tokens), ours(tokens), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("variant", ["mask-add", "token", "sd"])
def test_saved_and_reloaded_editor_makes_the_same_picture(
    tmp_path: Path, flux_base: Path, sd_base: Path, embeddings: PromptEmbeddings, variant: str
) -> None:
    settings = settings_of(sd_base if variant == "sd" else flux_base, variant)
    known = encode_prompts(settings) if variant == "sd" else embeddings
    editor = load_editor(settings, torch.float32, seed=0)
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for parameter in trainable(editor.module).values():
            parameter += 0.05 * torch.randn(parameter.shape, generator=generator)
    editor.module.requires_grad_(False).eval()
    save_editor(tmp_path, editor, known, settings)
    photo, mask = photo_and_mask()
    back = open_editor(tmp_path, base="", dtype=torch.float32)
    prompt = OlatPrompt(LightKind.WALL, Brightness.MEDIUM)
    before = editor.edit(photo, mask, prompt, known, SAMPLING, seed=0)
    after = back.editor.edit(photo, mask, prompt, back.embeddings, SAMPLING, seed=0)
    assert torch.equal(before, after)
    assert {p.suffix for p in tmp_path.iterdir()} == {".json", ".safetensors"}


@pytest.fixture
def saved(tmp_path: Path, editor: KontextEditor, embeddings: PromptEmbeddings) -> Path:
    save_editor(tmp_path, editor, embeddings, settings_of(Path("moved")))
    return tmp_path


def test_a_moved_base_is_given_by_name(saved: Path, flux_base: Path) -> None:
    assert open_editor(saved, str(flux_base), torch.float32).embeddings.sequence
    with pytest.raises(InputError, match="moved"):
        open_editor(saved, "", torch.float32)


def test_lora_whose_keys_match_nothing_is_refused(saved: Path, flux_base: Path) -> None:
    lora = read_weights(saved / "lora.safetensors")
    renamed = {f"base_model.{name}": value for name, value in lora.items()}
    write_weights(saved / "lora.safetensors", renamed)
    with pytest.raises(InputError, match="22 of 22 tensors match no layer"):
        open_editor(saved, str(flux_base), torch.float32)


def test_nan_in_the_mask_layer_is_refused(saved: Path, flux_base: Path) -> None:
    from safetensors.torch import save_file

    mask = read_weights(saved / "mask.safetensors")
    mask["linear.bias"][0] = float("nan")
    save_file(mask, saved / "mask.safetensors")
    with pytest.raises(FormatError, match=r"mask\.safetensors: tensor linear\.bias"):
        open_editor(saved, str(flux_base), torch.float32)


def test_a_base_that_is_damaged_or_partial_is_refused(tmp_path: Path, flux_base: Path) -> None:
    import shutil

    from diffusers import AutoencoderKL

    shutil.copytree(flux_base / "vae", tmp_path / "vae")
    weights = tmp_path / "vae" / "diffusion_pytorch_model.safetensors"
    tensors = read_weights(weights)
    name = "decoder.conv_in.weight"
    write_weights(weights, {k: v for k, v in tensors.items() if k != name})
    with pytest.raises(FormatError, match=r"lacks 1 tensors .*decoder\.conv_in\.weight"):
        load_component(AutoencoderKL, tmp_path, "vae", torch.float32)
    weights.write_bytes(b"cut")
    with pytest.raises(FormatError, match="does not load as AutoencoderKL"):
        load_component(AutoencoderKL, tmp_path, "vae", torch.float32)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_loss_is_finite_at_both_ends_of_the_flow(
    editor: KontextEditor, embeddings: PromptEmbeddings, level: float
) -> None:
    loss = editor.module(**{**tensors(editor, embeddings), "level": torch.tensor([level])})
    loss.sum().backward()
    assert torch.isfinite(loss).all()
    gradients = [p.grad for p in trainable(editor.module).values()]
    assert all(gradient is not None for gradient in gradients)
    assert all(torch.isfinite(gradient).all() for gradient in gradients)


def test_levels_of_the_flow_cover_its_range(editor: KontextEditor) -> None:
    generator = torch.Generator().manual_seed(0)
    levels = torch.stack([editor.module.draw_level(generator) for _ in range(2000)])
    assert 0 < float(levels.min()) < 0.005
    assert 0.995 < float(levels.max()) <= 1
    assert float(levels.mean()) == pytest.approx(0.5, abs=4 / (12 * 2000) ** 0.5)  # 4 sigma

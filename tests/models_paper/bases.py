"""Random bases of a few kilobytes in the layout of the real ones, so that tests need no weights."""

from __future__ import annotations

from pathlib import Path

import torch

WORDS = "abcdefghijklmnopqrstuvwxyz"


def write_flux_base(folder: Path) -> Path:
    """FLUX.1 Kontext: transformer with guidance, 16-channel autoencoder, CLIP, T5, tokenizers."""
    from diffusers import AutoencoderKL, FlowMatchEulerDiscreteScheduler, FluxTransformer2DModel

    torch.manual_seed(0)
    FluxTransformer2DModel(
        in_channels=64,
        num_layers=1,
        num_single_layers=1,
        attention_head_dim=16,
        num_attention_heads=2,
        joint_attention_dim=32,
        pooled_projection_dim=32,
        guidance_embeds=True,
        axes_dims_rope=(4, 6, 6),
    ).save_pretrained(folder / "transformer")
    _autoencoder(AutoencoderKL, 16, shift=0.1).save_pretrained(folder / "vae")
    FlowMatchEulerDiscreteScheduler(use_dynamic_shifting=True).save_pretrained(folder / "scheduler")
    _write_clip(folder)
    _write_t5(folder)
    return folder


def write_sd_base(folder: Path) -> Path:
    """Stable Diffusion 2.1: U-Net with linear projections, 4-channel autoencoder, CLIP."""
    from diffusers import AutoencoderKL, UNet2DConditionModel

    torch.manual_seed(0)
    UNet2DConditionModel(
        sample_size=8,
        in_channels=4,
        out_channels=4,
        down_block_types=("CrossAttnDownBlock2D", "DownBlock2D"),
        up_block_types=("UpBlock2D", "CrossAttnUpBlock2D"),
        block_out_channels=(8, 16),
        layers_per_block=1,
        cross_attention_dim=32,
        attention_head_dim=(2, 4),
        norm_num_groups=4,
        use_linear_projection=True,
        upcast_attention=True,
    ).save_pretrained(folder / "unet")
    _autoencoder(AutoencoderKL, 4, shift=None).save_pretrained(folder / "vae")
    _write_clip(folder)
    return folder


def _autoencoder(kind: type, channels: int, shift: float | None) -> torch.nn.Module:
    return kind(
        down_block_types=("DownEncoderBlock2D",) * 4,
        up_block_types=("UpDecoderBlock2D",) * 4,
        block_out_channels=(4, 4, 4, 4),
        layers_per_block=1,
        norm_num_groups=2,
        latent_channels=channels,
        scaling_factor=0.4,
        shift_factor=shift,
    )


def _write_clip(folder: Path) -> None:
    from tokenizers import Tokenizer, models, pre_tokenizers
    from transformers import CLIPTextConfig, CLIPTextModel, PreTrainedTokenizerFast

    config = CLIPTextConfig(
        vocab_size=40,
        hidden_size=32,
        intermediate_size=32,
        num_hidden_layers=1,
        num_attention_heads=2,
        projection_dim=32,
        eos_token_id=39,
        bos_token_id=38,
        pad_token_id=37,
    )
    CLIPTextModel(config).save_pretrained(folder / "text_encoder")
    vocabulary = {word: i for i, word in enumerate(["[UNK]", *WORDS])} | {"[PAD]": 37, "[EOS]": 39}
    tokenizer = Tokenizer(models.WordLevel(vocabulary, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    PreTrainedTokenizerFast(
        tokenizer_object=tokenizer,
        unk_token="[UNK]",
        pad_token="[PAD]",
        eos_token="[EOS]",
        model_max_length=77,
    ).save_pretrained(folder / "tokenizer")


def _write_t5(folder: Path) -> None:
    from tokenizers import Tokenizer, models, pre_tokenizers
    from transformers import PreTrainedTokenizerFast, T5Config, T5EncoderModel

    config = T5Config(
        vocab_size=40, d_model=32, d_kv=8, d_ff=32, num_layers=1, num_heads=2, pad_token_id=0
    )
    T5EncoderModel(config).save_pretrained(folder / "text_encoder_2")
    vocabulary = {word: i for i, word in enumerate(["[PAD]", "[UNK]", *WORDS])}
    tokenizer = Tokenizer(models.WordLevel(vocabulary, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, unk_token="[UNK]", pad_token="[PAD]", model_max_length=512
    ).save_pretrained(folder / "tokenizer_2")

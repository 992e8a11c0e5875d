"""Settings of the paper's two models: their architecture, their sampling, their training.

Defaults are the paper's (supplement, "Models"). They are read from a YAML file of their own by
`python -m luxcore.models.flux_kontext.train` and `…multiview_unet.train`: `params.yaml` does not
hold them, since nobody's default run trains these models.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from luxcore.settings.base import Settings

Precision = Literal["no", "bf16", "fp16"]
EditorVariant = Literal["mask-add", "token", "sd"]
MultiViewVariant = Literal["mv", "mv-edit"]
Prediction = Literal["epsilon", "v_prediction"]


class LoopSettings(Settings):
    """How the training loop runs; nothing here names a model."""

    seed: int = Field(0, ge=0, lt=2**31)
    """Fixes the order of the examples and every noise; 0 is legal."""

    micro_batch: int = Field(1, ge=1, le=1024)
    """Examples per forward pass on one device; the batch is split into as many as it takes."""

    workers: int = Field(4, ge=0, le=64)
    """Processes per device that prepare examples; 0 prepares them in the loop."""

    mixed_precision: Precision = "bf16"
    """Precision of the forward pass; what is trained stays float32."""

    gradient_checkpointing: bool = True
    """Recompute activations backward: about a third more time for a fraction of the memory."""

    max_grad_norm: float = Field(1.0, gt=0)
    """Gradients are scaled down to this norm."""

    ema_decay: float = Field(0.9999, ge=0, lt=1)
    """Decay of the running average that is exported, per step; 0 keeps none."""

    checkpoint_every: int = Field(500, ge=1)
    """Steps between checkpoints."""

    keep_checkpoints: int = Field(2, ge=1)
    """Newest checkpoints kept."""

    validate_every: int = Field(500, ge=0)
    """Steps between validation pictures; 0 draws none."""

    log_every: int = Field(10, ge=1)
    """Steps between reported metrics."""


class TrainingPhase(Settings):
    """A stretch of training with a fixed number of views and a fixed batch."""

    steps: int = Field(ge=1)
    batch_size: int = Field(ge=1)
    """Examples per step over all devices."""

    views: int = Field(1, ge=1, le=15)
    """Views per example; always 1 for the single-view model."""


class NoiseSettings(Settings):
    """The noise schedule of the U-Net models (Stable Diffusion's, then adapted)."""

    prediction: Prediction = "v_prediction"
    """What the U-Net returns; SD-2.1 at 768 px was trained on v, its base on epsilon."""

    zero_terminal_snr: bool = True
    """End in pure noise, so that dark rooms are reachable; needs v prediction."""

    view_shift: bool = True
    """Shift the log-SNR by the logarithm of the number of views (CAT3D)."""

    @model_validator(mode="after")
    def _zero_snr_needs_v(self) -> NoiseSettings:
        if self.zero_terminal_snr and self.prediction == "epsilon":
            raise ValueError("zero_terminal_snr needs prediction v_prediction")
        return self


class DataSettings(Settings):
    """Where training examples come from and how they are framed."""

    root: str = ""
    """Folder of rendered rooms, in the compact form or in the public layout (scenes or shards)."""

    side: int = Field(512, ge=64, le=2048, multiple_of=64)
    """Width and height of a sampled perspective view, pixels."""

    one_light_off_ratio: float = Field(0.3, ge=0, le=1)
    """Fraction of examples of the second task (switch the chosen lamp off)."""


class KontextSettings(Settings):
    """The single-view model: FLUX.1 Kontext with LoRA and a mask, or one of its variants."""

    base: str = ""
    """Folder or hub id of the base: FLUX.1 Kontext, or Stable Diffusion for `sd`."""

    variant: EditorVariant = "mask-add"
    """`mask-add` adds mask tokens to the photo's (the paper's); `token` appends the mask as
    tokens beside the photo's; `sd` is a latent diffusion U-Net that sees the mask as a channel."""

    lora_rank: int = Field(32, ge=1, le=512)
    lora_single_out: bool = False
    """Also adapt the output layer of the single blocks, which attention shares with the MLP."""

    prompt_tokens: int = Field(512, ge=16, le=512)
    """Length of the T5 embedding of a prompt; the base was trained on 512."""

    training_guidance: float = Field(3.5, ge=0)
    """Guidance value that the distilled base is told during training."""

    noise: NoiseSettings = NoiseSettings(view_shift=False)
    """Only for `sd`."""


class MultiViewSettings(Settings):
    """The multi-view model: a latent diffusion U-Net whose self-attention spans the views."""

    base: str = ""
    """Folder or hub id of a model in the layout of Stable Diffusion 2.1."""

    variant: MultiViewVariant = "mv"
    """`mv` propagates reference views; `mv-edit` edits by light masks without references."""

    joint_channels_min: int = Field(640, ge=0)
    """Self-attention spans the views where it has at least this many channels; below, at the
    finest resolution, each view attends to itself."""

    reference_dropout: float = Field(0.1, ge=0, le=1)
    """Fraction of examples trained without their condition, for guidance."""

    max_references: int = Field(3, ge=1, le=14)
    """Most reference views of a training example."""

    noise: NoiseSettings = NoiseSettings()


class KontextTraining(Settings):
    """All of a single-view training: 3,000 steps of 192 examples with Prodigy at rate 1."""

    model: KontextSettings = KontextSettings()
    data: DataSettings = DataSettings()
    loop: LoopSettings = LoopSettings()
    phases: tuple[TrainingPhase, ...] = (TrainingPhase(steps=3000, batch_size=192),)
    learning_rate: float = Field(1.0, gt=0)
    """Prodigy's factor, 1 unless unstable; for `sd`, AdamW's rate: take 5e-5."""

    @model_validator(mode="after")
    def _one_view(self) -> KontextTraining:
        if any(phase.views != 1 for phase in self.phases):
            raise ValueError("phases of the single-view model have 1 view")
        return self


class MultiViewTraining(Settings):
    """All of a multi-view training: 30,000 steps in three phases of 4, 8 and 15 views."""

    model: MultiViewSettings = MultiViewSettings()
    data: DataSettings = DataSettings()
    loop: LoopSettings = LoopSettings()
    phases: tuple[TrainingPhase, ...] = (
        TrainingPhase(steps=15_000, batch_size=192, views=4),
        TrainingPhase(steps=10_000, batch_size=144, views=8),
        TrainingPhase(steps=5_000, batch_size=96, views=15),
    )
    learning_rate: float = Field(5e-5, gt=0)
    """AdamW's."""


class KontextSampling(Settings):
    """How a photo is edited with trained weights: options of the `flux-kontext` backend."""

    base: str = ""
    """Takes the place of the base that the weights were trained on, for a moved folder."""

    steps: int = Field(28, ge=1, le=1000)
    """Sampler steps per picture: time grows with them."""

    guidance: float = Field(3.5, ge=0)
    """Guidance value that the distilled base is told; not used by `sd`."""

    max_area: int = Field(1024 * 1024, ge=64 * 64)
    """Most pixels the model sees; larger photos are reduced, and the light enlarged again."""

    light_kind: Literal["light", "ceiling light", "wall light", "floor lamp", "table lamp"] = (
        "light"
    )
    """What the instruction calls the lamps."""

    device: str = "auto"
    """`auto` takes a GPU where there is one; otherwise torch's name of the device."""


class MultiViewSampling(Settings):
    """How views are harmonized with trained weights: options of `multiview-unet`."""

    base: str = ""
    """Takes the place of the base that the weights were trained on, for a moved folder."""

    steps: int = Field(25, ge=1, le=1000)
    """Sampler steps per pass and exposure: time grows with them."""

    guidance: float = Field(2.0, ge=1, le=20)
    """Strength of the references over an empty condition; 1 turns guidance off and halves time."""

    max_area: int = Field(512 * 512, ge=64 * 64)
    """Most pixels of a view that the model sees."""

    device: str = "auto"
    """`auto` takes a GPU where there is one; otherwise torch's name of the device."""

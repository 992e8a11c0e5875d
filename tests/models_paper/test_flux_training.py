"""Training of the single-view model and its variants on random bases of some kilobytes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.data.training import SingleViewSamples
from luxcore.models.diffusion.loop import train
from luxcore.models.diffusion.options import training_digest
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.weights import read_weights, trainable
from luxcore.models.flux_kontext.editor import KontextEditor, encode_prompts, load_editor
from luxcore.models.flux_kontext.embeddings import PromptEmbeddings
from luxcore.models.flux_kontext.examples import EditExamples, prompts_of
from luxcore.models.flux_kontext.prompts import Brightness, LightKind, LightOffPrompt
from luxcore.models.flux_kontext.trainee import KontextTrainee
from luxcore.models.flux_kontext.weights_folder import open_editor
from luxcore.settings.paper_models import (
    DataSettings,
    KontextTraining,
    LoopSettings,
    TrainingPhase,
)
from tests.models_paper.edits import SIDE, settings_of, tensors
from tests.models_paper.room import panorama

LOOP = LoopSettings(workers=0, mixed_precision="no", ema_decay=0.0, micro_batch=2, log_every=1)


@pytest.fixture(scope="module")
def photos() -> SingleViewSamples:
    return SingleViewSamples([panorama()], (SIDE, SIDE), seed=0)


def test_examples_follow_from_their_key(photos: SingleViewSamples) -> None:
    examples = EditExamples(photos, DataSettings(side=SIDE), seed=0)
    first, again, other = (examples[ExampleKey(i, 1)] for i in (5, 5, 6))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first["photo"], other["photo"])
    assert first["photo"].shape == first["target"].shape == (3, SIDE, SIDE)
    assert first["mask"].any()


def test_both_tasks_are_drawn_and_answered(photos: SingleViewSamples) -> None:
    """An OLAT is the darker the lower its bracket; a light that goes off brightens no pixel."""
    examples = EditExamples(photos, DataSettings(side=SIDE, one_light_off_ratio=0.5), seed=0)
    brightness: dict[Brightness, list[float]] = {b: [] for b in Brightness}
    off = 0
    for position in range(60):
        example = examples[ExampleKey(position, 1)]
        [prompt] = prompts_of([example])
        assert prompt.kind in (LightKind.CEILING, LightKind.FLOOR)
        if isinstance(prompt, LightOffPrompt):
            off += 1
            assert (example["target"].mean(0) <= example["photo"].mean(0) + 1e-3).all()
        else:
            brightness[prompt.brightness].append(float(example["target"].mean()))
    assert 5 < off < 40
    high, medium, low = (np.mean(brightness[b]) for b in Brightness)
    assert high > medium > low


def trained(
    base: Path,
    out: Path,
    photos: SingleViewSamples,
    embeddings: PromptEmbeddings,
    variant: str = "mask-add",
    steps: int = 3,
    **changes: object,
) -> tuple[Path, list[float]]:
    settings = KontextTraining(
        model=settings_of(base, variant),
        data=DataSettings(side=SIDE),
        loop=LOOP.model_copy(update={"checkpoint_every": 2, **changes}),
        phases=(TrainingPhase(steps=steps, batch_size=2),),
        learning_rate=1e-3 if variant == "sd" else 1.0,
    )
    editor = load_editor(settings.model, torch.float32, seed=0)
    editor.module.enable_gradient_checkpointing()
    examples = EditExamples(photos, settings.data, seed=0)
    trainee = KontextTrainee(editor, embeddings, examples, settings)
    losses: list[float] = []

    class Losses:
        def metrics(self, step: int, values: dict[str, float]) -> None:
            losses.append(values["loss"])

        def picture(self, step: int, name: str, image: np.ndarray) -> None:
            assert image.shape == (SIDE, 3 * SIDE, 3)

    digest = training_digest(settings)
    folder = train(trainee, settings.phases, settings.loop, out, digest, Losses())
    return folder, losses


@pytest.mark.usefixtures("fresh_accelerator")
def test_training_resumes_to_the_same_bits_and_can_be_opened(
    tmp_path: Path, flux_base: Path, photos: SingleViewSamples, embeddings: PromptEmbeddings
) -> None:
    """Prodigy, LoRA and mask layer; the second run is cut after its checkpoint."""
    whole, losses = trained(flux_base, tmp_path / "whole", photos, embeddings, validate_every=2)
    assert len(losses) == 3
    parts = tmp_path / "parts"
    shutil.copytree(tmp_path / "whole" / "checkpoint", parts / "checkpoint")
    shutil.rmtree(parts / "checkpoint" / "00000003")
    again, later = trained(flux_base, parts, photos, embeddings)
    assert later == losses[2:]
    for name in ("lora.safetensors", "mask.safetensors"):
        one, two = read_weights(whole / name), read_weights(again / name)
        assert all(torch.equal(one[key], two[key]) for key in one)
        assert any(tensor.any() for tensor in one.values())
    open_editor(whole, base="", dtype=torch.float32)
    assert json.loads((whole / "model.json").read_text())["settings"]["lora_rank"] == 4


@pytest.mark.usefixtures("fresh_accelerator")
@pytest.mark.parametrize("variant", ["token", "sd"])
def test_variants_train(
    tmp_path: Path,
    flux_base: Path,
    sd_base: Path,
    photos: SingleViewSamples,
    embeddings: PromptEmbeddings,
    variant: str,
) -> None:
    base = sd_base if variant == "sd" else flux_base
    known = encode_prompts(settings_of(base, variant)) if variant == "sd" else embeddings
    folder, losses = trained(base, tmp_path, photos, known, variant, steps=2)
    assert np.isfinite(losses).all()
    open_editor(folder, base="", dtype=torch.float32)


def test_one_batch_is_learned(editor: KontextEditor, embeddings: PromptEmbeddings) -> None:
    """Sixty steps on one batch and one noise: the loss falls well below where it started."""
    given = tensors(editor, embeddings)
    parameters = list(trainable(editor.module).values())
    optimizer = torch.optim.AdamW(parameters, lr=0.02)
    losses = []
    for _ in range(60):
        loss = editor.module(**given).mean()
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
        losses.append(loss.item())
    assert losses[-1] < 0.8 * losses[0]

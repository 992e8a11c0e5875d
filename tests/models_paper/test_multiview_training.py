"""Training of the multi-view model on a random base of some kilobytes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.data.crops import LitCrop
from luxcore.data.multiview import MultiViewSets
from luxcore.models.diffusion.loop import train
from luxcore.models.diffusion.options import training_digest
from luxcore.models.diffusion.rooms import LitSets
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.weights import read_weights
from luxcore.models.multiview_unet.examples import ViewExamples
from luxcore.models.multiview_unet.trainee import MultiViewTrainee
from luxcore.models.multiview_unet.weights_folder import MultiViewModel, load_base, open_multiview
from luxcore.settings.paper_models import (
    DataSettings,
    LoopSettings,
    MultiViewSettings,
    MultiViewTraining,
    TrainingPhase,
)
from tests.models_paper.room import panorama
from tests.models_paper.scenes import condition

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

"""The shared training loop on a two-layer network: resume, averaging, listening, divergence."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from luxcore.errors import DivergedError, FormatError, InputError
from luxcore.models.diffusion.average import RunningAverage
from luxcore.models.diffusion.checkpoint import newest_checkpoint
from luxcore.models.diffusion.events import FolderListener
from luxcore.models.diffusion.loop import train
from luxcore.models.diffusion.randomness import torch_generator
from luxcore.models.diffusion.schedule import ExampleKey
from luxcore.models.diffusion.weights import read_weights, write_weights
from luxcore.settings.paper_models import LoopSettings, TrainingPhase

pytestmark = pytest.mark.usefixtures("fresh_accelerator")

PHASES = (TrainingPhase(steps=4, batch_size=4), TrainingPhase(steps=2, batch_size=2, views=3))
LOOP = LoopSettings(
    micro_batch=3, workers=0, mixed_precision="no", checkpoint_every=2, log_every=2, ema_decay=0.9
)


class Numbers:
    """y = 3x + 1 at points that follow from the key."""

    def __getitem__(self, key: ExampleKey) -> Mapping[str, Tensor]:
        return {"x": torch.randn(2, generator=torch_generator(key.position, key.views))}


class Line(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        with torch.random.fork_rng():
            torch.manual_seed(0)
            self.layers = nn.Sequential(nn.Linear(2, 4), nn.Tanh(), nn.Linear(4, 2))
        self.frozen = nn.Parameter(torch.ones(1), requires_grad=False)

    def forward(self, x: Tensor) -> Tensor:
        return (self.layers(x) - 3 * x - 1).square().mean(dim=1)


@dataclass
class LineTrainee:
    kind: str = "prodigy"
    stop_at: int | None = None
    module: nn.Module = field(default_factory=Line)
    examples: Numbers = field(default_factory=Numbers)
    seen: list[ExampleKey] = field(default_factory=list)

    def optimizer(self, parameters: Sequence[nn.Parameter]) -> torch.optim.Optimizer:
        if self.kind == "adamw":
            return torch.optim.AdamW(parameters, lr=0.05)
        from prodigyopt import Prodigy

        return Prodigy(parameters, lr=1.0, safeguard_warmup=True, use_bias_correction=True, d0=1e-3)

    def batch(
        self,
        keys: Sequence[ExampleKey],
        examples: Sequence[Mapping[str, Tensor]],
        device: torch.device,
    ) -> dict[str, Tensor]:
        if self.stop_at is not None and keys[0].position >= self.stop_at:
            raise KeyboardInterrupt
        self.seen += keys
        return {"x": torch.stack([example["x"] for example in examples]).to(device)}

    def pictures(self) -> Mapping[str, np.ndarray]:
        return {"grey": np.full((4, 4, 3), 0.5, np.float32)}

    def export(self, folder: Path) -> None:
        write_weights(folder / "w.safetensors", dict(self.module.named_parameters()))


def run(trainee: LineTrainee, out: Path, loop: LoopSettings = LOOP, digest: str = "d") -> Path:
    return train(trainee, PHASES, loop, out, digest, FolderListener(out))


@pytest.mark.parametrize("kind", ["prodigy", "adamw"])
def test_a_run_that_was_killed_ends_with_the_bits_of_one_that_was_not(
    tmp_path: Path, kind: str
) -> None:
    whole = read_weights(run(LineTrainee(kind), tmp_path / "whole") / "w.safetensors")
    with pytest.raises(KeyboardInterrupt):
        run(LineTrainee(kind, stop_at=12), tmp_path / "parts")  # in the fourth step
    assert newest_checkpoint(tmp_path / "parts").name == "00000002"
    later = LineTrainee(kind)
    parts = read_weights(run(later, tmp_path / "parts") / "w.safetensors")
    assert later.seen[0].position == 8
    assert all(torch.equal(whole[name], parts[name]) for name in whole)


def test_training_lowers_the_loss_and_leaves_frozen_parameters(tmp_path: Path) -> None:
    trainee = LineTrainee("adamw")
    phases = (TrainingPhase(steps=60, batch_size=8),)
    loop = LOOP.model_copy(update={"log_every": 10, "checkpoint_every": 60})
    train(trainee, phases, loop, tmp_path, "d", FolderListener(tmp_path))
    lines = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [10, 20, 30, 40, 50, 60]
    assert lines[-1]["loss"] < 0.5 * lines[0]["loss"]
    assert float(trainee.module.frozen) == 1


def test_every_example_of_the_plan_is_seen_in_order(tmp_path: Path) -> None:
    trainee = LineTrainee()
    run(trainee, tmp_path)
    assert [key.position for key in trainee.seen] == list(range(20))
    assert {key.views for key in trainee.seen[16:]} == {3}


def test_micro_batches_add_up_to_the_batch(tmp_path: Path) -> None:
    """Splitting only changes the order of summation: float32 rounding, amplified by six steps."""
    small, large = (LOOP.model_copy(update={"micro_batch": size}) for size in (1, 4))
    one = read_weights(run(LineTrainee("adamw"), tmp_path / "1", small) / "w.safetensors")
    four = read_weights(run(LineTrainee("adamw"), tmp_path / "4", large) / "w.safetensors")
    for name in one:
        torch.testing.assert_close(one[name], four[name], rtol=1e-4, atol=1e-5)


def test_worker_processes_change_no_bit(tmp_path: Path) -> None:
    here = read_weights(run(LineTrainee(), tmp_path / "0") / "w.safetensors")
    loop = LOOP.model_copy(update={"workers": 2})
    there = read_weights(run(LineTrainee(), tmp_path / "2", loop) / "w.safetensors")
    assert all(torch.equal(here[name], there[name]) for name in here)


def test_the_average_is_exported_and_the_parameters_go_on(tmp_path: Path) -> None:
    trainee = LineTrainee("adamw")
    exported = read_weights(run(trainee, tmp_path) / "w.safetensors")
    last = dict(trainee.module.named_parameters())
    assert not torch.equal(exported["layers.0.weight"], last["layers.0.weight"])
    plain = LineTrainee("adamw")
    loop = LOOP.model_copy(update={"ema_decay": 0.0})
    without = read_weights(run(plain, tmp_path / "plain", loop) / "w.safetensors")
    assert torch.equal(without["layers.0.weight"], last["layers.0.weight"])


def test_checkpoints_of_other_settings_are_refused(tmp_path: Path) -> None:
    run(LineTrainee(), tmp_path, digest="one")
    with pytest.raises(InputError, match="other settings"):
        run(LineTrainee(), tmp_path, digest="two")


def test_a_damaged_checkpoint_is_named(tmp_path: Path) -> None:
    run(LineTrainee(), tmp_path)
    folder = newest_checkpoint(tmp_path)
    (folder / "optimizer.safetensors").write_bytes(b"cut")
    with pytest.raises(FormatError, match=r"optimizer\.safetensors"):
        run(LineTrainee(), tmp_path)
    (folder / "state.json").write_text("{}")
    with pytest.raises(FormatError, match=r"state\.json"):
        run(LineTrainee(), tmp_path)


def test_only_the_newest_checkpoints_are_kept_and_none_is_pickled(tmp_path: Path) -> None:
    run(LineTrainee(), tmp_path)
    assert sorted(p.name for p in (tmp_path / "checkpoint").iterdir()) == ["00000004", "00000006"]
    suffixes = {p.suffix for p in (tmp_path / "checkpoint").rglob("*") if p.is_file()}
    assert suffixes == {".json", ".safetensors"}


def test_a_loss_that_is_not_finite_stops_the_run(tmp_path: Path) -> None:
    trainee = LineTrainee()
    with torch.no_grad():
        trainee.module.layers[0].weight.fill_(float("nan"))
    with pytest.raises(DivergedError, match="step 1: the loss is nan"):
        run(trainee, tmp_path)
    assert newest_checkpoint(tmp_path) is None


def test_validation_pictures_reach_the_listener(tmp_path: Path) -> None:
    run(LineTrainee(), tmp_path, LOOP.model_copy(update={"validate_every": 3}))
    names = sorted(p.name for p in (tmp_path / "pictures").iterdir())
    assert names == ["00000003_grey.png", "00000006_grey.png"]


def test_running_average_warms_up_and_gives_parameters_back() -> None:
    parameters = {"p": torch.zeros(1)}
    average = RunningAverage(parameters, decay=0.9999)
    parameters["p"].fill_(1.0)
    average.update(parameters, step=1)
    assert float(average.values["p"]) == pytest.approx(9 / 11)  # 1 - (1 + 1) / (10 + 1)
    with average.in_place_of(parameters):
        assert float(parameters["p"]) == pytest.approx(9 / 11)
    assert float(parameters["p"]) == 1.0

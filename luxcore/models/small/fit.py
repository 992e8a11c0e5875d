"""The training loop: AdamW with warm-up and a linear end, EMA weights, exact resume."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor
from torch.nn.attention import SDPBackend, sdpa_kernel
from torch.utils.data import DataLoader, Dataset

from luxcore.errors import DivergedError
from luxcore.files.atomic import atomic_file
from luxcore.models.small.examples import Example
from luxcore.models.small.losses import example_loss
from luxcore.models.small.network import UNet, channels_last
from luxcore.progress import progress

Batch = Sequence[tuple[Tensor, Any]]
"""Examples, each behind the features that the network reads of it."""


@runtime_checkable
class Batches(Protocol):
    """Batches by step; pure functions of the number."""

    def batch(self, step: int) -> Batch: ...


Loss = Callable[[Tensor, Any], Tensor]
"""Outputs [b, o, h, w] of an example's features, and the example, to a scalar."""

Validate = Callable[[UNet], dict[str, float]]
"""Scores of a network, by name, on examples that training never sees."""


def lamp_loss(outputs: Tensor, example: Example) -> Tensor:
    """The loss of the lamp networks."""
    return example_loss(example.fields(outputs), example)


@dataclass(frozen=True)
class FitSettings:
    """`steps` in all; the rate falls linearly to zero over the last `cooldown` share of them."""

    steps: int
    rate: float
    warmup: int = 50
    cooldown: float = 0.4
    ema: float = 0.995
    bf16: bool = True
    check_every: int = 200
    best_by: str = "psnr_validation"
    """The score, higher being better, whose best check gives the weights. Small networks on few
    rooms are past their best before the rate has fallen to zero."""


@dataclass
class FitResult:
    """The averaged weights of the best check (of the last where none was scored), and the curve:
    one row per check."""

    weights: dict[str, Tensor]
    curve: list[dict[str, float]]


def fit(
    net: UNet,
    batches: Batches,
    settings: FitSettings,
    validate: Validate,
    checkpoint: Path | None = None,
    loss: Loss = lamp_loss,
    workers: int = 0,
) -> FitResult:
    """Train `net` in place. With `checkpoint`, an interrupted call continues to the same bits.

    `workers` processes make batches ahead of their use; 0 makes each when it is needed.
    """
    state = _Fit(net, settings, validate, loss)
    if checkpoint is not None and checkpoint.is_file():
        state.load(torch.load(checkpoint, weights_only=True))
    with progress("training", settings.steps, "steps") as bar:
        bar.advance(state.step)
        for batch in prepared(batches, range(state.step, settings.steps), workers):
            smooth = state.advance(batch)
            bar.advance(loss=f"{smooth:.4f}")
            if state.step % settings.check_every == 0 or state.step == settings.steps:
                state.check()
                if checkpoint is not None:
                    state.save(checkpoint)
    return FitResult(state.best or state.ema, state.curve)


def prepared(batches: Batches, steps: range, workers: int) -> Iterable[Batch]:
    """The batches of `steps`, in order. Each is a function of its number alone, so `workers`
    change how long it takes and no bit."""
    made = _ByStep(batches)
    if not workers or not len(steps):
        return (made[step] for step in steps)
    return DataLoader(
        made, batch_size=None, sampler=steps, num_workers=workers, collate_fn=_as_made
    )


def _as_made(batch: Batch) -> Batch:
    return batch


@dataclass(frozen=True)
class _ByStep(Dataset[Batch]):
    batches: Batches

    def __getitem__(self, step: int) -> Batch:
        # The last bits of guessed geometry depend on the threads that share a convolution, and a
        # loader's workers have one.
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            return self.batches.batch(step)
        finally:
            torch.set_num_threads(threads)


class _Fit:
    def __init__(
        self,
        net: UNet,
        settings: FitSettings,
        validate: Validate,
        loss: Loss,
    ) -> None:
        self.loss_of = loss
        self.net = channels_last(net).train()
        self.settings, self.validate = settings, validate
        parameters = net.parameters()
        self.optimizer = torch.optim.AdamW(parameters, settings.rate, weight_decay=0.02, fused=True)
        self.ema = {k: v.detach().clone() for k, v in net.state_dict().items()}
        self.step, self.lamps, self.loss = 0, 0, math.nan
        self.curve: list[dict[str, float]] = []
        self.best: dict[str, Tensor] = {}

    def advance(self, batch: Batch) -> float:
        """One step on all lamps of a batch of photos."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.settings.rate * schedule(self.step, self.settings)
        features = torch.cat([f for f, _ in batch]).contiguous(memory_format=torch.channels_last)
        counts = [len(f) for f, _ in batch]
        photo = torch.repeat_interleave(torch.arange(len(counts)), torch.tensor(counts))
        # Backwards, torch's fused attention takes two to three times as long on grids this coarse.
        with (
            torch.autocast("cpu", torch.bfloat16, enabled=self.settings.bf16),
            sdpa_kernel(SDPBackend.MATH),
        ):
            outputs = self.net(features, photo)
        parts = outputs.float().split(counts)
        losses = [self.loss_of(p, example) for p, (_, example) in zip(parts, batch, strict=True)]
        loss = torch.stack(losses).mean()
        if not bool(torch.isfinite(loss)):
            raise DivergedError(f"training diverged: the loss of step {self.step} is not finite.")
        self.optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        self.optimizer.step()
        self._average()
        self.step, self.lamps = self.step + 1, self.lamps + len(features)
        now = float(loss.detach())
        self.loss = now if math.isnan(self.loss) else 0.98 * self.loss + 0.02 * now
        return self.loss

    def check(self) -> None:
        """Score the averaged weights on photos that training never sees."""
        own = self.net.training
        averaged = channels_last(type(self.net)(self.net.shape))
        averaged.load_state_dict(self.ema)
        row = {
            "step": float(self.step),
            "lamps_seen": float(self.lamps),
            "loss": self.loss,
            **self.validate(averaged.eval()),
        }
        before = [r[self.settings.best_by] for r in self.curve if self.settings.best_by in r]
        score = row.get(self.settings.best_by)
        if score is not None and score > max(before, default=-math.inf):
            self.best = {name: value.clone() for name, value in self.ema.items()}
        self.curve.append(row)
        self.net.train(own)

    def save(self, path: Path) -> None:
        """All that the next step depends on."""
        state = {
            "net": self.net.state_dict(),
            "ema": self.ema,
            "best": self.best,
            "optimizer": self.optimizer.state_dict(),
            "numbers": [self.step, self.lamps, self.loss],
            "curve": self.curve,
        }
        with atomic_file(path) as temporary:
            torch.save(state, temporary)

    def load(self, state: dict[str, Any]) -> None:
        """The inverse of `save`."""
        self.net.load_state_dict(state["net"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.ema, self.best, self.curve = state["ema"], state["best"], state["curve"]
        step, lamps, self.loss = state["numbers"]
        self.step, self.lamps = int(step), int(lamps)

    def _average(self) -> None:
        # Early averages would remember the initial weights; the ramp forgets them.
        decay = min(self.settings.ema, (1 + self.step) / (10 + self.step))
        for name, value in self.net.state_dict().items():
            self.ema[name].lerp_(value, 1 - decay)


def schedule(step: int, settings: FitSettings) -> float:
    """Share of the full rate: warm-up, plateau, linear end."""
    cooling = max(1.0, settings.cooldown * settings.steps)
    return min(1.0, (step + 1) / settings.warmup, (settings.steps - step) / cooling)

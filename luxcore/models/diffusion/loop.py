"""The training loop of both models, on one device or many, through accelerate.

A run that was stopped goes on from its newest checkpoint and ends with the same bits as one that
never stopped: every example and every noise follows from the seed and the example's position.
Devices share a step's examples among them (data parallel); only the order in which their
gradients are summed depends on how many they are.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader

from luxcore.errors import DivergedError
from luxcore.models.diffusion.average import RunningAverage
from luxcore.models.diffusion.checkpoint import (
    TrainingState,
    load_checkpoint,
    newest_checkpoint,
    save_checkpoint,
)
from luxcore.models.diffusion.events import Listener
from luxcore.models.diffusion.schedule import ExampleKey, Plan
from luxcore.models.diffusion.trainee import Example, Trainee
from luxcore.models.diffusion.weights import trainable
from luxcore.progress import progress
from luxcore.settings.paper_models import LoopSettings, TrainingPhase

if TYPE_CHECKING:
    from accelerate import Accelerator


@dataclass
class _Run:
    """The moving parts of one training."""

    accelerator: Accelerator
    trainee: Trainee
    loop: LoopSettings
    plan: Plan
    module: nn.Module
    optimizer: Any
    state: TrainingState
    skipped: int = 0
    losses: list[float] = field(default_factory=list)


def train(
    trainee: Trainee,
    phases: tuple[TrainingPhase, ...],
    loop: LoopSettings,
    out: Path,
    digest: str,
    listener: Listener,
) -> Path:
    """Train to the end of `phases` and return the folder of the exported weights.

    `out/checkpoint` holds checkpoints; where there are any, the run goes on from the newest.
    `digest` names the settings: a checkpoint of other settings is refused with InputError.
    Raises DivergedError at the first loss that is not finite.
    """
    run = _start(trainee, phases, loop)
    step = _resume(run, out, digest)
    batches = _batches(run, step)
    main = run.accelerator.is_main_process
    with progress("train", run.plan.steps, "step", quiet=not main) as bar:
        bar.advance(step)
        while step < run.plan.steps:
            started = time.monotonic()
            norm = _step(run, step, batches)
            step += 1
            bar.advance(1, loss=f"{run.losses[-1]:.4f}")
            if main:
                _report(run, step, norm, time.monotonic() - started, listener)
            if step % loop.checkpoint_every == 0 or step == run.plan.steps:
                if main:
                    _keep(run, out, step, digest)
                run.accelerator.wait_for_everyone()
    return _finish(run, out)


def _start(trainee: Trainee, phases: tuple[TrainingPhase, ...], loop: LoopSettings) -> _Run:
    from accelerate import Accelerator

    accelerator = Accelerator(mixed_precision=loop.mixed_precision)
    world, rank = accelerator.num_processes, accelerator.process_index
    plan = Plan(phases, loop.micro_batch, world, rank)
    trainee.module.train()
    parameters = trainable(trainee.module)
    optimizer = trainee.optimizer(list(parameters.values()))
    module, prepared = accelerator.prepare(trainee.module, optimizer)
    average = RunningAverage(parameters, loop.ema_decay) if loop.ema_decay else None
    state = TrainingState(parameters, average, optimizer, {})
    return _Run(accelerator, trainee, loop, plan, module, prepared, state)


def _resume(run: _Run, out: Path, digest: str) -> int:
    """The step to go on from; 0 for a fresh start."""
    checkpoint = newest_checkpoint(out)
    if checkpoint is None:
        return 0
    step = load_checkpoint(checkpoint, run.state, digest)
    if run.accelerator.scaler is not None and run.state.scaler:
        run.accelerator.scaler.load_state_dict(run.state.scaler)
    return step


def _batches(run: _Run, step: int) -> Iterator[list[Example]]:
    loader: DataLoader = DataLoader(
        run.trainee.examples,  # type: ignore[arg-type]
        batch_sampler=_Sampler(run.plan, step),  # type: ignore[arg-type]
        collate_fn=list,
        num_workers=run.loop.workers,
    )
    return iter(loader)


@dataclass(frozen=True)
class _Sampler:
    plan: Plan
    step: int

    def __iter__(self) -> Iterator[list[ExampleKey]]:
        return self.plan.micro_batches_from(self.step)


def _step(run: _Run, step: int, batches: Iterator[list[Example]]) -> float:
    """One update of the parameters. Returns the norm of the gradient."""
    groups = run.plan.micro_batches(step)
    count = sum(len(group) for group in groups)
    total = torch.zeros((), device=run.accelerator.device)
    for index, keys in enumerate(groups):
        tensors = run.trainee.batch(keys, next(batches), run.accelerator.device)
        last = index == len(groups) - 1
        with nullcontext() if last else run.accelerator.no_sync(run.module):
            loss = run.module(**tensors).sum() / count
            run.accelerator.backward(loss)
        total += loss.detach()
    mean = float(run.accelerator.reduce(total, "mean"))
    if not math.isfinite(mean):
        raise DivergedError(f"step {step + 1}: the loss is {mean}; lower the learning rate.")
    run.losses.append(mean)
    parameters = list(run.state.parameters.values())
    norm = run.accelerator.clip_grad_norm_(parameters, run.loop.max_grad_norm)
    run.optimizer.step()
    run.optimizer.zero_grad()
    run.skipped += bool(run.optimizer.step_was_skipped)
    if run.state.average is not None:
        run.state.average.update(run.state.parameters, step + 1)
    return float(norm)


def _report(run: _Run, step: int, norm: float, seconds: float, listener: Listener) -> None:
    if step % run.loop.log_every == 0 or step == run.plan.steps:
        group = run.state.optimizer.param_groups[0]
        examples = len(run.plan.keys(step - 1)) * run.plan.world
        values = {
            "loss": float(np.mean(run.losses)),
            # Prodigy's own estimate d is the rate that counts; AdamW has none.
            "learning_rate": float(group["lr"]) * float(group.get("d", 1.0)),
            "gradient_norm": norm,
            "examples_per_s": examples / seconds,
            "skipped_steps": float(run.skipped),
        }
        listener.metrics(step, {k: v for k, v in values.items() if math.isfinite(v)})
        run.losses.clear()
    if run.loop.validate_every and step % run.loop.validate_every == 0:
        with _averaged(run):
            for name, image in run.trainee.pictures().items():
                listener.picture(step, name, image)
        run.trainee.module.train()


def _keep(run: _Run, out: Path, step: int, digest: str) -> None:
    scaler = run.accelerator.scaler
    run.state.scaler = dict(scaler.state_dict()) if scaler is not None else {}
    save_checkpoint(out, step, run.state, digest, run.loop.keep_checkpoints)


def _finish(run: _Run, out: Path) -> Path:
    from luxcore.files.atomic import atomic_folder

    target = out / "model"
    if run.accelerator.is_main_process:
        with _averaged(run), atomic_folder(target) as folder:
            run.trainee.export(folder)
    run.accelerator.wait_for_everyone()
    return target


def _averaged(run: _Run) -> Any:
    average = run.state.average
    return average.in_place_of(run.state.parameters) if average is not None else nullcontext()

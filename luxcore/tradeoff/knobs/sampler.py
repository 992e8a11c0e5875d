"""Steps of the sampler of the paper's single-view model, where the exact answer is known.

Trained weights do not come with this project, so a step is asked of the exact velocity field
instead of a network: of a distribution of small squares cut from the capture's photos, each widened
by a Gaussian. For x_σ = (1 − σ) x_0 + σ ε the velocity is (x_σ − E[x_0 | x_σ]) / σ, a closed form
(Lipman et al. 2023, "Flow Matching for Generative Modeling", equation 8). What remains is the error
of the steps alone; a network's own error comes on top and does not shrink with steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from luxcore.capture import load_capture
from luxcore.files.photos import read_photo
from luxcore.settings.paper_models import KontextSampling
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, around, stopwatch

SQUARE_PX = 8
SQUARES = 1500
SAMPLES = 128
WIDTH = 0.05
"""Standard deviation around each square, in the model's range −1..1."""
EXACT_STEPS = 500
TOKENS = 4096
"""Of a 1024² picture: FLUX's schedule depends on it."""


@dataclass(frozen=True)
class _Prepared:
    squares: Tensor  # [n, d], -1..1
    noise: Tensor  # [b, d]
    exact: Tensor  # [b, d]


def _prepare(bench: Bench) -> _Prepared:
    rng = np.random.Generator(np.random.PCG64(0))
    frames = load_capture(bench.input("capture")).frames
    photos = [read_photo(frame.image_path) for frame in frames[:8]]
    rows = []
    for number in range(SQUARES):
        photo = photos[number % len(photos)]
        y, x = (int(rng.integers(0, side - SQUARE_PX)) for side in photo.shape[:2])
        rows.append(2 * photo[y : y + SQUARE_PX, x : x + SQUARE_PX].ravel() - 1)
    squares = torch.from_numpy(np.stack(rows).astype(np.float32))
    noise = rng.standard_normal((SAMPLES, squares.shape[1])).astype(np.float32)
    start = torch.from_numpy(noise)
    return _Prepared(squares, start, _sample(squares, start, EXACT_STEPS))


def _sample(squares: Tensor, noise: Tensor, steps: int) -> Tensor:
    """Noise to squares with the scheduler of `FluxKontextPipeline`, as it is called there."""
    from diffusers import FlowMatchEulerDiscreteScheduler
    from diffusers.pipelines.flux.pipeline_flux_kontext import calculate_shift

    scheduler = FlowMatchEulerDiscreteScheduler(use_dynamic_shifting=True, shift=3.0)
    sigmas = np.linspace(1.0, 1 / steps, steps)
    scheduler.set_timesteps(sigmas=sigmas, mu=calculate_shift(TOKENS))
    x = noise
    for timestep in scheduler.timesteps:
        sigma = float(timestep) / scheduler.config.num_train_timesteps
        x = scheduler.step(_velocity(squares, x, sigma), timestep, x, return_dict=False)[0]
    return x


def _velocity(squares: Tensor, x: Tensor, sigma: float) -> Tensor:
    """The exact velocity at noise level `sigma`."""
    alpha = 1.0 - sigma
    variance = (alpha * WIDTH) ** 2 + sigma**2
    distance = torch.cdist(x, alpha * squares).square()
    share = torch.softmax(-distance / (2 * variance), dim=1)
    # Each square is itself a Gaussian: its posterior mean moves towards x.
    gain = alpha * WIDTH**2 / variance
    clean = share @ squares * (1 - alpha * gain) + gain * x
    return (x - clean) / sigma


def _run(prepared: _Prepared, choice: Choice, repeat: int) -> Work:
    with stopwatch() as watch:
        found = _sample(prepared.squares, prepared.noise, int(choice.label))
    # From the model's range to display 0..1.
    return watch.work(float((found - prepared.exact).square().mean().sqrt()) / 2)


DEFAULT = KontextSampling().steps

STEPS = Knob(
    name="sampler steps of the paper's single-view model",
    work="squares sampled",
    choices=tuple(Choice(str(n), {}) for n in around(DEFAULT, 1 / 7, 0.25, 0.5, 1, 2, 4)),
    error="RMS difference to 500 steps, display 0..1",
    why="Each doubling of the steps takes a third of the error and the curve has no bend; the "
    "default is FLUX Kontext's own.",
    prepare=_prepare,
    run=_run,
    fixed_default=str(DEFAULT),
)

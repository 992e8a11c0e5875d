"""Does view dependence earn its spherical harmonics? Asked of the residuals, cross-validated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from luxcore.splats.backprojection import Backprojection

_EARNED = 0.05
"""Share of held-out residual variance that degree 1 must explain to be worth four times the
colour parameters."""
_RIDGE = 0.1
_MIN_WEIGHT = 0.05
"""A view says something about a Gaussian when it covers this many pixels of it."""


@dataclass(frozen=True)
class HarmonicsChoice:
    """The degree and why."""

    degree: int
    gain: float

    @property
    def reason(self) -> str:
        """One line for the log."""
        verb = "earns" if self.degree else "does not earn"
        return (
            f"spherical harmonics: degree 1 {verb} its cost, it explains {100 * self.gain:.1f} % "
            f"of the residual in views it was not fitted to (needed: {100 * _EARNED:.0f} %)"
        )


def choose_degree(
    residuals: Sequence[Backprojection], directions: Sequence[Float32[np.ndarray, "n 3"]]
) -> HarmonicsChoice:
    """Fit each Gaussian's residual colour in even views, measure in odd ones.

    `residuals` hold target minus image of each view. The gain is the share of squared error that
    a function linear in the direction removes beyond the mean; below zero it only fits noise.
    """
    even, odd = _stack(residuals[::2], directions[::2]), _stack(residuals[1::2], directions[1::2])
    if even is None or odd is None:
        return HarmonicsChoice(0, 0.0)
    constant = _held_out_error(even, odd, columns=1)
    linear = _held_out_error(even, odd, columns=4)
    gain = 1 - linear / max(constant, 1e-30)
    return HarmonicsChoice(int(gain >= _EARNED), float(gain))


@dataclass(frozen=True)
class _Observations:
    weights: np.ndarray  # [v, n]
    colors: np.ndarray  # [v, n, 3]
    basis: np.ndarray  # [v, n, 4]: 1, x, y, z


def _stack(
    residuals: Sequence[Backprojection], directions: Sequence[np.ndarray]
) -> _Observations | None:
    if not residuals:
        return None
    weights = np.stack([r.weights for r in residuals])
    weights = np.where(weights >= _MIN_WEIGHT, weights, 0)
    sums = np.stack([r.sums for r in residuals])
    colors = sums / np.maximum(weights, _MIN_WEIGHT)[..., None]
    ones = np.ones((*weights.shape, 1), np.float32)
    return _Observations(weights, colors, np.concatenate([ones, np.stack(directions)], axis=2))


def _held_out_error(fit: _Observations, test: _Observations, columns: int) -> float:
    basis = fit.basis[..., :columns]
    weighted = basis * fit.weights[..., None]
    gram = np.einsum("vna,vnb->nab", weighted, basis)
    # The mean is not shrunk, its slopes are: ridge in proportion to the evidence.
    ridge = np.diag([1e-6, *[_RIDGE] * (columns - 1)])
    gram += ridge * np.maximum(fit.weights.sum(axis=0), 1e-6)[:, None, None]
    moments = np.einsum("vna,vnc->nac", weighted, fit.colors)
    coefficients = np.linalg.solve(gram, moments)
    predicted = np.einsum("vna,nac->vnc", test.basis[..., :columns], coefficients)
    squared = np.square(test.colors - predicted).sum(axis=2)
    return float((squared * test.weights).sum(dtype=np.float64))

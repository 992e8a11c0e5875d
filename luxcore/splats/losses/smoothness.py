"""Nearby Gaussians should answer a lamp alike: the KNN smoothness loss."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from luxcore.splats.device import Device

ABSENT = -1
"""In a neighbour table, where a Gaussian has fewer than K others."""


def nearest_neighbors(means: Float[np.ndarray, "n 3"], k: int) -> Int[np.ndarray, "n k"]:
    """Ids of the `k` nearest others of each point, never itself; `ABSENT` where there are fewer.

    Duplicates are neighbours like any others: the tree may then not list the point itself among
    its nearest, so it is removed by id and not by position.
    """
    n = len(means)
    table = np.full((n, k), ABSENT, np.int32)
    found = min(k + 1, n)
    if found < 2:
        return table
    _, ids = cKDTree(means).query(means, k=found)
    others = ids != np.arange(n)[:, None]
    # A point that is not among its own nearest leaves one candidate too many: drop the last.
    others[others.all(axis=1), -1] = False
    table[:, : found - 1] = ids[others].reshape(n, found - 1)
    return table


def mean_neighbor_distance(
    means: Float[np.ndarray, "n 3"], k: int, floor: float
) -> Float[np.ndarray, " n"]:
    """Root mean square distance to the `k` nearest others, at least `floor` (duplicates: 0)."""
    found = min(k + 1, len(means))
    if found < 2:
        return np.full(len(means), floor, np.float32)
    distances, _ = cKDTree(means).query(means, k=found)
    return np.maximum(np.sqrt((distances[:, 1:] ** 2).mean(axis=1)), floor).astype(np.float32)


class SmoothnessLoss:
    """weight / (NK) Σ_i Σ_{j in N(i)} |L_i - L_j|² and its gradient."""

    def __init__(
        self, device: Device, neighbors: Int[np.ndarray, "n k"], channels: int, weight: float
    ) -> None:
        self.device, self.weight = device, weight
        self.count = len(neighbors)
        start, other, pairs = _both_sides(neighbors)
        self._start, self._other = device.array(start), device.array(other)
        self._scale = weight / max(pairs, 1)
        self._kernel = device.program("loss_smoothness", {"CHANNELS": channels}).smoothness
        self._sums = device.zeros((max(self.count, 1),))

    def add_gradient(self, lights: cla.Array, d_lights: cla.Array) -> None:
        """Add the gradient by `lights` [n, channels] to `d_lights`."""
        self.device.launch(
            self._kernel, self.count, lights, self._start, self._other, self.count, self._scale,
            d_lights, self._sums,
        )  # fmt: skip

    def value(self) -> float:
        """The loss at the last `add_gradient`; every pair was summed from both of its ends."""
        return float(self._sums.get().sum(dtype=np.float64)) * self._scale / 2


def _both_sides(neighbors: Int[np.ndarray, "n k"]) -> tuple[np.ndarray, np.ndarray, int]:
    """(start [n + 1], other [2·pairs], pairs): the pairs of each Gaussian, from either side."""
    n, k = neighbors.shape
    own = np.repeat(np.arange(n, dtype=np.int32), k)
    present = neighbors.ravel() != ABSENT
    own, other = own[present], neighbors.ravel()[present]
    ends = np.concatenate([own, other])
    order = np.argsort(ends, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=n))]).astype(np.int32)
    far = np.concatenate([other, own])[order].astype(np.int32)
    return start, far if len(far) else np.zeros(1, np.int32), len(own)

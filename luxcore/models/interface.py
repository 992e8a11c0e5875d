"""What a model must do: decompose one photo, or carry decompositions to other views.

Light in a decomposition is linear and adds up (paper, eq. 1):
`image_linear = ambient + Σ_i scale_i · olat_i`. A lamp that is off in the photo has scale 0, and
its `olat` is what the lamp would add when switched on. A lamp that the photo does not show (an
empty mask) and that nothing else tells of belongs to `ambient`: its `olat` is zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from luxcore.cameras import Camera

MAX_VIEWS_PER_PASS = 15
"""Views, references included, in one pass of the multi-view model (paper, supplement, Models)."""


@dataclass(frozen=True)
class Geometry:
    """The surfaces that one photo sees.

    `depth_m` is along the camera's z, 0 where unknown. `normal` is in world axes, unit length,
    facing the camera, zero where unknown. Both have the photo's size.
    """

    camera: Camera
    depth_m: Float[np.ndarray, "h w"]
    normal: Float[np.ndarray, "h w 3"]


@dataclass(frozen=True)
class Decomposition:
    """The light of one photo, taken apart; float32, linear, never negative.

    `ambient` is everything that no mask names; `olat[k]` is lamp k alone at scale 1; `scale[k]` is
    the RGB factor c_k at which the photo has it (0 for a lamp that is off).
    """

    ambient: Float[np.ndarray, "h w 3"]
    olat: Float[np.ndarray, "k h w 3"]
    scale: Float[np.ndarray, "k 3"]

    def recomposed(self) -> Float[np.ndarray, "h w 3"]:
        """ambient + Σ c_k · olat_k, linear (paper, eq. 1 before the tone curve)."""
        return self.ambient + np.einsum("kc,khwc->hwc", self.scale, self.olat)

    def contributions(self) -> Float[np.ndarray, "k h w 3"]:
        """Each lamp's light as the photo has it; of a lamp that is off, its light at scale 1."""
        off = (self.scale == 0).all(axis=1, keepdims=True)
        return self.olat * np.where(off, 1, self.scale)[:, None, None].astype(np.float32)

    def one_light_off(self, lamp: int) -> Float[np.ndarray, "h w 3"]:
        """The photo with one lamp switched off, linear: the paper's second task (LTOFF)."""
        others = self.scale.copy()
        others[lamp] = 0
        return self.ambient + np.einsum("kc,khwc->hwc", others, self.olat)


@dataclass(frozen=True)
class View:
    """One photo of a capture with the masks of all the capture's lamps (empty where not seen).

    `on[k]` says whether lamp k burns while the photos are taken: the same in every view.
    """

    image_linear: Float[np.ndarray, "h w 3"]
    masks: Bool[np.ndarray, "k h w"]
    on: Bool[np.ndarray, " k"]
    geometry: Geometry | None


@dataclass(frozen=True)
class Reference:
    """A view whose light is known for the lamps in `known`: from the single-view model, or from
    an earlier pass."""

    view: View
    light: Decomposition
    known: Bool[np.ndarray, " k"]


@runtime_checkable
class Decomposer(Protocol):
    """A single-view model (the paper's LuxRemix-SV)."""

    @property
    def name(self) -> str:
        """The backend's name, as in `luxcore.models.backends`."""
        ...

    def decompose(
        self,
        image_linear: Float[np.ndarray, "h w 3"],
        masks: Bool[np.ndarray, "k h w"],
        on: Bool[np.ndarray, " k"],
        geometry: Geometry | None,
        seed: int,
    ) -> Decomposition:
        """Take one photo apart. `image_linear` is in units where the tone curve's exposure is 1.

        Same arguments, same bits. K may be 0. A sampler takes its noise from `seed`; a regressor
        ignores it.
        """
        ...


@runtime_checkable
class Harmonizer(Protocol):
    """A multi-view model (the paper's LuxRemix-MV)."""

    @property
    def name(self) -> str:
        """The backend's name, as in `luxcore.models.backends`."""
        ...

    def run_pass(
        self, views: Sequence[View], references: Sequence[Reference], seed: int
    ) -> list[Decomposition]:
        """Decompose `views` consistently with `references`; one result per view, in their order.

        At most MAX_VIEWS_PER_PASS views and references together, all with the same K. Every lamp
        gets an olat in every view: also where its own mask is empty, since its light still falls
        there.
        """
        ...


@dataclass(frozen=True)
class BackendSettings:
    """Where a backend finds its weights, and its own options.

    `sv_weights` and `mv_weights` name a safetensors file, a folder or a hub id, as the backend
    documents; None takes what it ships with. Options that a backend does not know are refused.
    """

    sv_weights: str | None = None
    mv_weights: str | None = None
    options: Mapping[str, str | int | float | bool] = field(default_factory=dict)

"""The small multi-view model behind the project's `Harmonizer` interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.cameras import Camera
from luxcore.errors import InputError
from luxcore.models.interface import MAX_VIEWS_PER_PASS, Decomposition, Reference, View
from luxcore.models.small.grid import (
    geometry_to_grid,
    grid_size,
    masks_to_grid,
    photo_to_grid,
    to_grid,
)
from luxcore.models.small.heads import OnGrid, WarpedLight
from luxcore.models.small.hints import KnownLight, References, references_of
from luxcore.models.small.multiview import TargetView, multiview_features
from luxcore.models.small.network import UNet
from luxcore.models.small.samples import chw
from luxcore.models.small.single_view import finish, run_network, with_unseen
from luxcore.models.small.surfaces import Surfaces


@dataclass(frozen=True)
class SmallHarmonizer:
    """Each view decomposed with its references' light warped into it by depth. Deterministic.

    `warp=False` withholds the warped light (an ablation): references then tell only where lamps
    are.
    """

    net: UNet
    long_side_px: int
    warp: bool = True
    name: str = "small"

    def run_pass(
        self, views: Sequence[View], references: Sequence[Reference], seed: int
    ) -> list[Decomposition]:
        """See `luxcore.models.interface.Harmonizer`; `seed` changes nothing here."""
        if len(views) + len(references) > MAX_VIEWS_PER_PASS:
            raise InputError(
                f"a pass holds at most {MAX_VIEWS_PER_PASS} views, got "
                f"{len(views)} and {len(references)} references."
            )
        known = [self._known_light(reference) for reference in references]
        lamps = len(views[0].on) if views else 0
        told = references_of([k for k in known if k is not None], lamps, light=self.warp)
        return [self._decompose(view, told) for view in views]

    def _decompose(self, view: View, references: References) -> Decomposition:
        target, camera = self._target(view)
        features, warped = multiview_features(target, camera, references)
        heard_of = view.masks.any((1, 2))
        for reference in references.views:
            heard_of |= reference.known.numpy()
        index = torch.from_numpy(heard_of)
        on = target.on[index]
        warped = WarpedLight(warped.ratio[index], warped.known[index])
        small = OnGrid(target.photo, target.masks[index])
        fields = run_network(self.net, features[index], on, small, warped)
        part = finish(fields, small, view.image_linear, view.masks[heard_of], on)
        return part if heard_of.all() else with_unseen(part, heard_of)

    def _known_light(self, reference: Reference) -> KnownLight | None:
        """A reference on the grid; None without geometry, since nothing can be warped then."""
        if reference.view.geometry is None:
            return None
        target, camera = self._target(reference.view)
        assert target.surfaces is not None
        scale = np.where(reference.view.on[:, None], reference.light.scale, 1.0)
        height, width = target.photo.shape[1:]
        lights = [
            to_grid(chw(olat * factor), (height, width))
            for olat, factor in zip(reference.light.olat, scale, strict=True)
        ]
        known = torch.from_numpy(reference.known)
        return KnownLight(
            camera,
            target.photo,
            target.masks,
            target.on,
            target.surfaces,
            _stack(lights, target),
            known,
        )

    def _target(self, view: View) -> tuple[TargetView, Camera]:
        height, width = view.image_linear.shape[:2]
        size = grid_size(height, width, self.long_side_px, self.net.shape.stride)
        geometry = view.geometry
        surfaces: Surfaces | None = geometry_to_grid(geometry, size)
        camera = (geometry.camera if geometry else _any_camera(height, width)).resized(
            size[1], size[0]
        )
        photo, masks = photo_to_grid(view.image_linear, size), masks_to_grid(view.masks, size)
        on: Bool[Tensor, " k"] = torch.from_numpy(view.on)
        return TargetView(photo, masks, on, surfaces), camera


def _stack(lights: list[Tensor], target: TargetView) -> Float[Tensor, "k 3 h w"]:
    return torch.stack(lights) if lights else torch.zeros(0, *target.photo.shape)


def _any_camera(height: int, width: int) -> Camera:
    """Where no camera is known the rays are those of a common lens: 60 degrees wide."""
    focal = width / 1.155
    return Camera(focal, focal, width / 2, height / 2, width, height, np.eye(4))

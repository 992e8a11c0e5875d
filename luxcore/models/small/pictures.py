"""Validation pictures: photo, mask, predicted and true light of a few lamps side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from luxcore.light.agx import agx
from luxcore.models.small.examples import Example
from luxcore.models.small.heads import lamp_light
from luxcore.models.small.network import UNet

ROWS = 6


def validation_sheet(
    net: UNet, cases: Sequence[tuple[Tensor, Example]]
) -> Float[np.ndarray, "h w 3"]:
    """One row per photo: photo, mask, predicted light, true light of its first lamp; 0..1."""
    rows = []
    with torch.no_grad():
        for features, example in cases[:ROWS]:
            light = lamp_light(example.fields(net(features)), example.photo, example.on)[0]
            mask = example.masks[:1].expand(3, -1, -1)
            shown = [_shown(example.photo), mask, _shown(light), _shown(example.lights[0])]
            rows.append(torch.cat(shown, dim=2))
    return torch.cat(rows, dim=1).movedim(0, -1).clamp(0, 1).numpy()


def _shown(linear: Tensor) -> Tensor:
    return agx(linear.movedim(0, -1)).movedim(-1, 0)

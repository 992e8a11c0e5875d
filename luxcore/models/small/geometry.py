"""Depth, normals and focal length guessed from one photo, for photos that come without them.

The lamp's distance and angle to every surface decide how its light falls; a guess that is right
within some ten per cent is worth more to the lamp network than none (docs/models.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from luxcore.models.small.features import photo_features
from luxcore.models.small.network import UNet
from luxcore.models.small.surfaces import Surfaces, pinhole_rays
from luxcore.models.small.transport import FARTHEST_M

PHOTO_CHANNELS = 6
GEOMETRY_OUTPUTS = 5
"""Log depth, three of the normal, log focal length (its mean over the photo)."""

TYPICAL_DEPTH_M = 3.0
TYPICAL_FOCAL = 0.87
"""In long sides of the photo: 60 degrees."""

ESTIMATED_TRUST = 0.5


@dataclass(frozen=True)
class GeometryGuess:
    """What the network says about a photo: natural log of metres, unit normals in camera axes,
    natural log of the focal length in long sides."""

    log_depth: Float[Tensor, "h w"]
    normals: Float[Tensor, "3 h w"]
    log_focal: Float[Tensor, ""]

    def surfaces(self) -> Surfaces:
        """Points by a pinhole whose axis meets the photo's centre."""
        height, width = self.log_depth.shape
        focal = float(torch.exp(self.log_focal)) * max(height, width)
        pinhole = (focal, focal, width / 2, height / 2)
        points = pinhole_rays(pinhole, height, width) * torch.exp(self.log_depth)
        return Surfaces(points, self.normals, pinhole, ESTIMATED_TRUST)


def read_outputs(outputs: Float[Tensor, "o h w"]) -> GeometryGuess:
    """The network's answer for one photo; zeros mean a wall 3 m away seen by a 60-degree lens."""
    log_depth = outputs[0].clamp(-3, 3) + torch.log(torch.tensor(TYPICAL_DEPTH_M))
    # A surface that is seen faces the camera, whose view is along +z.
    normals = outputs[1:4] - torch.tensor([0.0, 0.0, 0.5]).view(3, 1, 1)
    normals = normals / normals.norm(dim=0, keepdim=True).clamp_min(1e-4)
    log_focal = outputs[4].mean().clamp(-2, 2) + torch.log(torch.tensor(TYPICAL_FOCAL))
    return GeometryGuess(log_depth, normals, log_focal)


def estimate_surfaces(net: UNet, photo: Float[Tensor, "3 h w"]) -> Surfaces:
    """Surfaces of a linear photo on the network's grid: the mean of what the photo and its mirror
    image say, whose errors differ. So a mirrored photo has mirrored surfaces."""
    features = torch.stack([photo_features(view) for view in (photo, photo.flip(-1))])
    with torch.inference_mode():
        outputs = net(features.contiguous(memory_format=torch.channels_last)).float()
    return read_outputs((outputs[0] + mirrored(outputs[1])) / 2).surfaces()


def mirrored(outputs: Float[Tensor, "o h w"]) -> Float[Tensor, "o h w"]:
    """The network's answer for the mirror image: a normal's x turns round."""
    turned = outputs.flip(-1).clone()
    turned[1] *= -1
    return turned


def geometry_loss(
    outputs: Float[Tensor, "1 o h w"], truth: Surfaces, focal: Float[Tensor, ""]
) -> Tensor:
    """Depth up to scale and, weaker, its scale; slopes of depth; angle of normals; focal length.

    `focal` in long sides of the photo.
    """
    guess, valid = read_outputs(outputs[0].float()), indoors(truth)
    error = guess.log_depth - torch.log(truth.points[2].clamp_min(1e-3))
    error = torch.where(valid, error, torch.zeros_like(error))
    count = valid.sum().clamp_min(1)
    offset = error.sum() / count
    relative = (error - offset) * valid
    angle = (1 - (guess.normals * truth.normals).sum(0)) * valid
    return (
        relative.abs().sum() / count
        + 0.3 * offset.abs()
        + 0.5 * (_slope(relative, valid, 0) + _slope(relative, valid, 1))
        + 0.5 * angle.sum() / count
        + 0.2 * (guess.log_focal - torch.log(focal)).abs()
    )


def indoors(truth: Surfaces) -> Bool[Tensor, "h w"]:
    """Where a surface of the room is known; what is outdoors is not learned."""
    return truth.valid & (truth.points[2] < FARTHEST_M)


def _slope(error: Tensor, valid: Tensor, axis: int) -> Tensor:
    """Mean change of the error between neighbours: edges of furniture in the right place."""
    both = valid.narrow(axis, 1, valid.shape[axis] - 1) & valid.narrow(
        axis, 0, valid.shape[axis] - 1
    )
    return (error.diff(dim=axis).abs() * both).sum() / both.sum().clamp_min(1)

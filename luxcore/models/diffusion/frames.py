"""Photos of any size to the sizes that a model accepts, and back."""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional


def model_size(height: int, width: int, max_area: int, multiple: int) -> tuple[int, int]:
    """(height, width) near the photo's shape, at most `max_area`, each a multiple of `multiple`.

    A photo that fits keeps its size up to rounding; nothing is smaller than one multiple.
    """
    shrink = min(1.0, math.sqrt(max_area / (height * width)))

    def fit(side: int) -> int:
        return max(multiple, math.floor(side * shrink / multiple + 1e-9) * multiple)

    return fit(height), fit(width)


def to_tensor(
    picture: Float[np.ndarray, "h w 3"], size: tuple[int, int]
) -> Float[Tensor, "1 3 sh sw"]:
    """A picture as a batch of one at `size`, antialiased."""
    tensor = torch.from_numpy(np.ascontiguousarray(picture, np.float32)).permute(2, 0, 1)[None]
    return resized(tensor, size)


def mask_to_tensor(
    mask: Bool[np.ndarray, "h w"], size: tuple[int, int]
) -> Float[Tensor, "1 1 sh sw"]:
    """A mask at `size`; a pixel on the edge holds the fraction that is covered."""
    return resized(torch.from_numpy(mask.astype(np.float32))[None, None], size)


def to_picture(
    tensor: Float[Tensor, "1 3 sh sw"], size: tuple[int, int]
) -> Float[np.ndarray, "h w 3"]:
    """The inverse of `to_tensor`, at the photo's `size`, never negative."""
    picture = resized(tensor.float().cpu(), size).clamp_min(0)
    return picture[0].permute(1, 2, 0).contiguous().numpy()


def resized(tensor: Float[Tensor, "b c h w"], size: tuple[int, int]) -> Float[Tensor, "b c sh sw"]:
    """Bilinear, antialiased when smaller; the same tensor when the size is right."""
    if tuple(tensor.shape[-2:]) == tuple(size):
        return tensor
    return functional.interpolate(tensor, size=size, mode="bilinear", antialias=True)

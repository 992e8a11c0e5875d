"""FLUX's tokens: 2x2 latents packed into one token, and the three ids of its position."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def pack(latents: Float[Tensor, "b c h w"]) -> Float[Tensor, "b n d"]:
    """Tokens in row order, n = h/2 · w/2; within one: channel, row, column (d = 4c)."""
    b, c, h, w = latents.shape
    blocks = latents.reshape(b, c, h // 2, 2, w // 2, 2)  # [b, c, rows, 2, columns, 2]
    return blocks.permute(0, 2, 4, 1, 3, 5).reshape(b, (h // 2) * (w // 2), c * 4)


def position_ids(
    rows: int, columns: int, image: int, first_column: int = 0
) -> Float[Tensor, "n 3"]:
    """(image, row, column) of each token: image 0 is what is made, 1 the photo it is made from."""
    ids = torch.zeros(rows, columns, 3)
    ids[..., 0] = image
    ids[..., 1] = torch.arange(rows)[:, None]
    ids[..., 2] = torch.arange(columns) + first_column
    return ids.reshape(rows * columns, 3)

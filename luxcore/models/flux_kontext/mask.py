"""How a lamp's mask reaches the FLUX transformer.

`mask-add` (the paper's): each 16x16 patch of the mask, the area of one token, goes through one
linear layer and is added to the photo's token. `token` (the ablation): the mask, encoded as a
picture, stands beside the photo as further tokens. Both change only the inputs of the transformer,
so one function serves training and, as a hook, diffusers' pipeline.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

PATCH = 16
"""Pixels along a token's side: 8 per latent, 2 latents."""


class MaskTokens(nn.Module):
    """The paper's single-layer MLP: 256 mask pixels to the width of a packed latent.

    It starts at zero, so that training starts from what the base does.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(PATCH * PATCH, channels)
        nn.init.zeros_(self.linear.weight)
        nn.init.zeros_(self.linear.bias)

    def forward(self, mask: Float[Tensor, "b 1 h w"]) -> Float[Tensor, "b n d"]:
        """Tokens in row order of a mask in 0..1 whose sides are multiples of 16."""
        patches = functional.unfold(mask, PATCH, stride=PATCH)  # [b, 256, n]
        return self.linear(patches.transpose(1, 2))


def add_mask_tokens(
    hidden: Float[Tensor, "b m d"], mask: Float[Tensor, "b n d"]
) -> Float[Tensor, "b m d"]:
    """Add `mask` to the last n tokens, which are the photo's."""
    made, photo = hidden.split([hidden.shape[1] - mask.shape[1], mask.shape[1]], dim=1)
    return torch.cat([made, photo + mask.to(hidden.dtype)], dim=1)


@contextmanager
def mask_added(
    transformer: nn.Module, mask: Float[Tensor, "b n d"], appended_ids: Tensor | None
) -> Iterator[None]:
    """Within the block every call of `transformer` has the mask in its inputs.

    With `appended_ids` [n, 3] the mask's tokens are appended there, otherwise they are added.
    """

    def hook(_: nn.Module, args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[Any, Any]:
        hidden = kwargs["hidden_states"]
        if appended_ids is None:
            return args, {**kwargs, "hidden_states": add_mask_tokens(hidden, mask)}
        ids = kwargs["img_ids"]
        joined = torch.cat([hidden, mask.to(hidden.dtype)], dim=1)
        joined_ids = torch.cat([ids, appended_ids.to(ids.device, ids.dtype)])
        return args, {**kwargs, "hidden_states": joined, "img_ids": joined_ids}

    handle = transformer.register_forward_pre_hook(hook, with_kwargs=True)
    try:
        yield
    finally:
        handle.remove()

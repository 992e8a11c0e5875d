"""More input channels for a pretrained U-Net, without a change of what it computes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import nn

from luxcore.errors import InputError

if TYPE_CHECKING:
    from diffusers import UNet2DConditionModel


def widen_input(unet: UNet2DConditionModel, channels: int) -> None:
    """Give `conv_in` room for `channels` channels; the pretrained ones come first, new ones are 0.

    Right after widening the U-Net returns what it returned before, whatever the new channels
    hold. Widening to the present width changes nothing. Raises InputError when it would narrow.
    """
    old = unet.conv_in
    if channels == old.in_channels:
        return
    if channels < old.in_channels:
        raise InputError(
            f"the U-Net reads {old.in_channels} channels, this model needs {channels}."
        )
    new = nn.Conv2d(
        channels, old.out_channels, old.kernel_size, old.stride, old.padding, dtype=old.weight.dtype
    )
    with torch.no_grad():
        nn.init.zeros_(new.weight)
        new.weight[:, : old.in_channels] = old.weight
    new.bias = old.bias
    unet.conv_in = new.to(old.weight.device)
    unet.register_to_config(in_channels=channels)

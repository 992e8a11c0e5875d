"""A pixel-unshuffle U-Net; `LampNet` looks at one lamp of one photo and says how its light falls.

The weights are shared by all lamps: K lamps are a batch of K. What the four heads mean, and how K
answers become one decomposition that adds up, is in `heads.py`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TypeVar

import torch
import torch.nn.functional as fn
from jaxtyping import Float
from torch import Tensor, nn

from luxcore.models.small.features import AMBIENT_SHARE, IRRADIANCE, LAMP_SHARE

SV_OUTPUTS = 12
"""Four heads of RGB: lamp logit, ambient logit, log ratio of a lamp that is off, emitter boost."""

MV_OUTPUTS = SV_OUTPUTS + 1
"""And how far to trust the light that was warped in from the references."""


@dataclass(frozen=True)
class NetworkShape:
    """What must be equal for weights to fit."""

    inputs: int
    outputs: int = SV_OUTPUTS
    widths: tuple[int, ...] = (48, 96, 192, 256)
    unshuffle: int = 2
    heads: int = 4

    @property
    def stride(self) -> int:
        """Height and width of an input must be multiples of this."""
        return self.unshuffle * 2 ** (len(self.widths) - 1)

    def as_metadata(self) -> dict[str, object]:
        """Plain values, for the header of a weights file."""
        return {**asdict(self), "widths": list(self.widths)}


class UNet(nn.Module):
    """[b, inputs, h, w] → [b, outputs, h, w]; h and w multiples of `shape.stride`."""

    def __init__(self, shape: NetworkShape) -> None:
        super().__init__()
        self.shape = shape
        widths, block = shape.widths, shape.unshuffle**2
        self.stem = nn.Conv2d(shape.inputs * block, widths[0], 3, padding=1)
        before = (widths[0], *widths[:-1])
        self.down = nn.ModuleList(Residual(i, o) for i, o in zip(before, widths, strict=True))
        self.middle = nn.Sequential(Attention(widths[-1], shape.heads), Residual(*widths[-1:] * 2))
        pairs = list(pairwise(widths))[::-1]
        self.up = nn.ModuleList(Residual(fine + coarse, fine) for fine, coarse in pairs)
        self.head = nn.Conv2d(widths[0], shape.outputs * block, 3, padding=1)
        # Zero corrections are the first guess itself: a sane start for every lamp.
        for parameter in self.head.parameters():
            nn.init.zeros_(parameter)

    def forward(self, features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b o h w"]:
        x = self.stem(fn.pixel_unshuffle(features, self.shape.unshuffle))
        skips: list[Tensor] = []
        for level, block in enumerate(self.down):
            x = block(fn.avg_pool2d(x, 2) if level else x)
            skips.append(x)
        x = self.middle(x)
        for block, skip in zip(self.up, skips[-2::-1], strict=True):
            x = block(torch.cat([fn.interpolate(x, scale_factor=2.0), skip], dim=1))
        return fn.pixel_shuffle(self.head(x), self.shape.unshuffle)


class LampNet(UNet):
    """Features of one lamp to its four heads: corrections of what the Lambert fit guesses."""

    def forward(self, features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b o h w"]:
        outputs = super().forward(features)
        guess = torch.cat([prior_logits(features), prior_log_ratio(features)], dim=1)
        return torch.cat([outputs[:, :9] + guess, outputs[:, 9:]], dim=1)


def prior_logits(features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 6 h w"]:
    """Logits of lamp and ambient by the Lambert fit, at half their weight: it knows no shadows.

    The network's own logits are corrections of these. Halving them was best on rooms that neither
    had seen (docs/models.md).
    """
    shares = torch.cat([features[:, LAMP_SHARE], features[:, AMBIENT_SHARE]], dim=1)
    return 0.5 * torch.log((shares + 1) / 2 + 0.02)


def prior_log_ratio(features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 3 h w"]:
    """What a lamp that is off would add to an evenly lit photo: its irradiance over the mean."""
    irradiance = torch.exp2(4 * features[:, IRRADIANCE]).clamp_min(1e-3)
    mean = irradiance.clamp_max(4).mean((2, 3), keepdim=True)
    return torch.log(irradiance / mean + 0.05).expand(-1, 3, -1, -1)


class Residual(nn.Module):
    """Two normalised 3×3 convolutions beside a skip."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.norm1, self.norm2 = nn.GroupNorm(8, inputs), nn.GroupNorm(8, outputs)
        self.conv1 = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1)
        self.skip = nn.Identity() if inputs == outputs else nn.Conv2d(inputs, outputs, 1)
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Float[Tensor, "b i h w"]) -> Float[Tensor, "b o h w"]:
        hidden = self.conv1(fn.silu(self.norm1(x)))
        return self.skip(x) + self.conv2(fn.silu(self.norm2(hidden)))


class Attention(nn.Module):
    """Every place of the coarsest grid sees every other: light crosses the whole room."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.GroupNorm(8, width)
        self.qkv = nn.Conv2d(width, 3 * width, 1)
        self.out = nn.Conv2d(width, width, 1)
        nn.init.zeros_(self.out.weight)

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        b, c, h, w = x.shape
        tokens = self.qkv(self.norm(x)).reshape(b, 3, self.heads, c // self.heads, h * w)
        q, k, v = tokens.transpose(-1, -2).unbind(1)
        mixed = fn.scaled_dot_product_attention(q, k, v)
        return x + self.out(mixed.transpose(-1, -2).reshape(b, c, h, w))


Net = TypeVar("Net", bound=nn.Module)


def channels_last(net: Net) -> Net:
    """The same weights laid out as the CPU's convolutions like them: twice as fast."""
    return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

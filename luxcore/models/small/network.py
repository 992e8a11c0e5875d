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
from jaxtyping import Float, Int
from torch import Tensor, nn

from luxcore.models.small.features import AMBIENT_SHARE, LAMP_SHARE, LOG_RATIO, LOG_RATIO_SCALE

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
    middle: int = 1
    """Pairs of attention and residual block on the coarsest grid."""
    attending: int = 0
    """Finer grids, from the coarsest up, whose places see each other as well."""
    overall: bool = False
    """Whether each output gets one number for the whole photo besides: how strong a lamp is."""
    together: int = 0
    """Grids, from the coarsest up, on which the lamps of a photo see each other."""

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
        coarsest = widths[-1]
        self.middle = nn.Sequential(
            *(
                part
                for _ in range(shape.middle)
                for part in (Attention(coarsest, shape.heads), Residual(coarsest, coarsest))
            )
        )
        pairs = list(pairwise(widths))[::-1]
        self.up = nn.ModuleList(Residual(fine + coarse, fine) for fine, coarse in pairs)
        self.across = nn.ModuleList(
            Attention(fine, shape.heads) for fine, _ in pairs[: shape.attending]
        )
        self.together = nn.ModuleList(
            AmongLamps(width, shape.heads) for width in widths[::-1][: shape.together]
        )
        self.head = nn.Conv2d(widths[0], shape.outputs * block, 3, padding=1)
        self.overall = Overall(coarsest, shape.outputs) if shape.overall else None
        # Zero corrections are the first guess itself: a sane start for every lamp.
        for parameter in self.head.parameters():
            nn.init.zeros_(parameter)

    def forward(
        self, features: Float[Tensor, "b c h w"], photo: Int[Tensor, " b"] | None = None
    ) -> Float[Tensor, "b o h w"]:
        """`photo` numbers the photo that each input is of; None: all are lamps of one."""
        x = self.stem(fn.pixel_unshuffle(features, self.shape.unshuffle))
        skips: list[Tensor] = []
        for level, block in enumerate(self.down):
            x = block(fn.avg_pool2d(x, 2) if level else x)
            skips.append(x)
        x = self._among_lamps(self.middle(x), 0, photo)
        overall = None if self.overall is None else self.overall(x)
        for level, (block, skip) in enumerate(zip(self.up, skips[-2::-1], strict=True)):
            x = block(torch.cat([fn.interpolate(x, scale_factor=2.0), skip], dim=1))
            if level < len(self.across):
                x = self.across[level](x)
            x = self._among_lamps(x, level + 1, photo)
        outputs = fn.pixel_shuffle(self.head(x), self.shape.unshuffle)
        return outputs if overall is None else outputs + overall

    def _among_lamps(self, x: Tensor, grid: int, photo: Tensor | None) -> Tensor:
        return self.together[grid](x, photo) if grid < len(self.together) else x


class LampNet(UNet):
    """Features of one lamp to its four heads: corrections of the first guess."""

    def forward(
        self, features: Float[Tensor, "b c h w"], photo: Int[Tensor, " b"] | None = None
    ) -> Float[Tensor, "b o h w"]:
        outputs = super().forward(features, photo)
        return torch.cat([outputs[:, :9] + guessed_outputs(features), outputs[:, 9:]], dim=1)


def guessed_outputs(features: Float[Tensor, "b c h w"]) -> Float[Tensor, "b 9 h w"]:
    """Logits of lamp and ambient and the log ratio by the first guess (`prior.py`), which the
    network's own answers correct."""
    shares = torch.cat([features[:, LAMP_SHARE], features[:, AMBIENT_SHARE]], dim=1)
    logits = torch.log((shares + 1) / 2 + 1e-3)
    return torch.cat([logits, LOG_RATIO_SCALE * features[:, LOG_RATIO]], dim=1)


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


class Overall(nn.Module):
    """One number per output from what the coarsest grid says in the mean."""

    def __init__(self, width: int, outputs: int) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(8, width)
        self.inner = nn.Conv2d(width, width, 1)
        self.out = nn.Conv2d(width, outputs, 1)
        nn.init.zeros_(self.out.weight)
        assert self.out.bias is not None
        nn.init.zeros_(self.out.bias)

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b o 1 1"]:
        mean = fn.silu(self.norm(x)).mean((2, 3), keepdim=True)
        return self.out(fn.silu(self.inner(mean)))


class Attention(nn.Module):
    """Every place of a coarse grid sees every other: light crosses the whole room."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.GroupNorm(8, width)
        self.qkv = nn.Conv2d(width, 3 * width, 1)
        self.out = nn.Conv2d(width, width, 1)
        nn.init.zeros_(self.out.weight)

    def forward(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        q, k, v = self._tokens(x)
        mixed = fn.scaled_dot_product_attention(q, k, v)
        return x + self.out(mixed.transpose(-1, -2).reshape(x.shape))

    def _tokens(self, x: Float[Tensor, "b c h w"]) -> Float[Tensor, "3 b heads places c2"]:
        b, c, h, w = x.shape
        tokens = self.qkv(self.norm(x)).reshape(b, 3, self.heads, c // self.heads, h * w)
        return tokens.permute(1, 0, 2, 4, 3)


class AmongLamps(Attention):
    """At every place the lamps of a photo see each other: one lamp's share is what the others
    leave."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__(width, heads)
        assert self.out.bias is not None
        nn.init.zeros_(self.out.bias)

    def forward(
        self, x: Float[Tensor, "b c h w"], photo: Int[Tensor, " b"] | None = None
    ) -> Float[Tensor, "b c h w"]:
        """`photo` as in `UNet.forward`."""
        q, k, v = self._tokens(x).permute(0, 3, 2, 1, 4)
        same = None if photo is None else photo[:, None] == photo[None]
        mixed = fn.scaled_dot_product_attention(q, k, v, attn_mask=same)
        return x + self.out(mixed.permute(2, 1, 3, 0).reshape(x.shape))


Net = TypeVar("Net", bound=nn.Module)


def channels_last(net: Net) -> Net:
    """The same weights laid out as the CPU's convolutions like them: twice as fast."""
    return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

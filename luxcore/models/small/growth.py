"""A larger network that starts out answering as a smaller one.

Blocks, inputs and outputs that the smaller one lacks are added with zero effect, so a training
goes on where the smaller network's ended:
`python -m luxcore.models.small.growth sv --base OLD --out NEW`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.errors import InputError, LuxError

if TYPE_CHECKING:
    from torch import Tensor

    from luxcore.models.small.network import UNet


def grow(smaller: UNet, larger: UNet) -> None:
    """Give `larger` the weights of `smaller`: the channels of stem and head that it has more are
    zero, and blocks that it has more keep their own weights, which add nothing at first.

    Raises InputError for widths that differ.
    """
    import torch

    same = ("widths", "unshuffle", "heads")
    if any(getattr(smaller.shape, name) != getattr(larger.shape, name) for name in same):
        raise InputError(
            f"a network of widths {smaller.shape.widths} cannot grow into {larger.shape.widths}."
        )
    own, weights = larger.state_dict(), {**larger.state_dict(), **smaller.state_dict()}
    for name in ("stem.weight", "head.weight", "head.bias", "fine.head.weight", "fine.head.bias"):
        if name in smaller.state_dict():
            weights[name] = _padded(weights[name], own[name])
    if smaller.shape.fine:
        # Its inputs are the features and, after them, the answers.
        name, split = "fine.stem.weight", smaller.shape.inputs
        features, answers = weights[name][:, :split], weights[name][:, split:]
        there = larger.shape.inputs
        parts = [
            _padded(features, own[name][:, :there]),
            _padded(answers, own[name][:, there:]),
        ]
        weights[name] = torch.cat(parts, dim=1)
    larger.load_state_dict(weights)


def _padded(values: Tensor, like: Tensor) -> Tensor:
    padded = like.new_zeros(like.shape)
    padded[tuple(slice(0, size) for size in values.shape)] = values
    return padded


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("kind", type=click.Choice(["geometry", "sv", "mv"]))
@click.option("--base", required=True, type=click.Path(path_type=Path), help="Smaller weights.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Weights to write.")
@click.option("--seed", default=0, show_default=True)
def main(kind: str, base: Path, out: Path, seed: int) -> None:
    """Write weights of today's shape that answer as BASE does."""
    from luxcore.models.small.training import new_network
    from luxcore.models.small.weights import load_network, save_weights

    try:
        smaller, larger = load_network(base, kind), new_network(kind, seed)
        grow(smaller, larger)
    except LuxError as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(error.exit_code)
    save_weights(out, kind, larger.shape, larger.state_dict())


if __name__ == "__main__":
    main()

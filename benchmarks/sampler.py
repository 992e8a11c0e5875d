"""Perspective crops per CPU second, on one core: `python -m benchmarks.sampler`."""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch

from luxcore.data.panorama import padded, sample_padded, view_rotation

CROPS = 300


def crops_per_second(layers: int, side: int = 128, rows: int = 256) -> float:
    """Crops of side² pixels with `layers` channels each, rays included, per CPU second."""
    torch.set_num_threads(1)
    panorama = padded(torch.rand(layers, rows, 2 * rows))
    rng = np.random.default_rng(0)
    started = time.process_time()
    for _ in range(CROPS):
        azimuth, elevation = rng.uniform(-180, 180), rng.uniform(-30, 40)
        sample_padded(panorama, view_rotation(azimuth, elevation), 70.0, side, side)
    return CROPS / (time.process_time() - started)


def main() -> None:
    """Prints one line for each number of channels."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    for layers in (3, 12, 24):
        print(f"{layers:3d} channels: {crops_per_second(layers):6.0f} crops of 128x128 per second")


if __name__ == "__main__":
    main()

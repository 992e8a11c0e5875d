"""SPZ version 3, Niantic's compressed Gaussians: a quarter of the PLY. Written by `gsply`.

What is lost: positions are multiples of 2^-b metres (b below), log-scales of 1/16, opacities and
colours of 1/255, rotations of 0.0014.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np

from luxcore.errors import InputError
from luxcore.exports.upright import y_up
from luxcore.files.atomic import atomic_file
from luxcore.splats.gaussians import Gaussians

MAX_FRACTION_BITS = 12
"""Steps of 0.24 mm, what other writers use; less where the scene is wider than ±2 km."""
_FIXED_BITS = 23
_FLAGS, _ANTIALIASED = 14, 1
"""Byte of the header, and its bit for opacities that were fitted with a low-pass filter."""


def write_spz(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians of degree 0, turned y up as the format wants, atomically.

    Raises InputError where a coordinate is too large for the format.
    """
    import gsply
    from gsply.spz import write_spz as write

    turned = y_up(gaussians)
    cloud = gsply.GSData.from_arrays(
        means=turned.means,
        scales=turned.log_scales,
        quats=turned.quats,
        opacities=turned.opacity_logits,
        sh0=turned.sh[:, 0],
    )
    bits = _fraction_bits(path, turned.means)
    with atomic_file(Path(path)) as temporary:
        write(temporary, cloud, version=3, fractional_bits=bits)
        payload = bytearray(gzip.decompress(temporary.read_bytes()))
        # The library leaves the flags at 0 and lets its number of threads show in the stream.
        payload[_FLAGS] = _ANTIALIASED * gaussians.antialiased
        temporary.write_bytes(gzip.compress(payload, mtime=0))


def _fraction_bits(path: Path, means: np.ndarray) -> int:
    """As many bits as let the farthest coordinate fit into 24-bit fixed point."""
    largest = float(np.abs(means).max(initial=0.0))
    bits = min(MAX_FRACTION_BITS, _FIXED_BITS - int(np.ceil(np.log2(largest + 1.0))))
    if bits < 1:
        raise InputError(f"{path}: SPZ cannot hold a coordinate of {largest:.3g} m.")
    return bits

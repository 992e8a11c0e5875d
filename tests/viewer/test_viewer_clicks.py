"""Solo, presets, stills and sliders, worked in Chromium."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from page_actions import press, until
from viewer_scene import room_scene

from luxcore.files.exr import read_exr
from luxcore.splats.relighting import mixing_weights
from luxcore.viewer.app import Viewer
from luxcore.viewer.lighting import Lighting, lamp_settings, light_names, original_lighting

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.browser

DESK_SOLO = 3


def test_lighting_is_saved_and_loaded_and_a_strangers_is_refused(
    own_viewer: Viewer, open_own_tab: Callable[[], Page], tmp_path: Path
) -> None:
    page, start = open_own_tab(), original_lighting(own_viewer.viewed.scene)
    with page.expect_download() as download:
        press(page, "Save lighting")
    saved = json.loads(Path(download.value.path()).read_text())
    assert list(saved["lights"]) == ["ambient", "desk", "floor", "wall"]
    saved["lights"]["desk"] = {"on": True, "stops": 1.5, "colour": [1.0, 0.2, 0.05]}
    saved["exposure_ev"] = -1.0
    load(page, tmp_path / "warm.json", saved)
    until(page, lambda: is_warm(own_viewer.panel.read()))
    load(page, tmp_path / "other.json", {**saved, "lights": {"lava": {"on": True}}})
    page.get_by_text("sets 'lava', which is not in this scene").wait_for()
    assert is_warm(own_viewer.panel.read())
    press(page, "Original lighting")
    until(page, lambda: own_viewer.panel.read() == start)


def is_warm(lighting: Lighting) -> bool:
    """Whether everything of the preset has arrived; its colour to 8 bits of sRGB."""
    desk = lighting.rows[1]
    colour = desk.colour is not None and np.allclose(desk.colour, [1.0, 0.2, 0.05], atol=0.01)
    return bool(colour and desk.on and desk.stops == 1.5 and lighting.exposure_ev == -1.0)


def load(page: Page, path: Path, preset: dict) -> None:
    path.write_text(json.dumps(preset))
    with page.expect_file_chooser() as chooser:
        press(page, "Load lighting")
    chooser.value.set_files(path)


def test_solo_shows_one_light_and_gives_the_others_back(
    own_viewer: Viewer, open_own_tab: Callable[[], Page]
) -> None:
    page = open_own_tab()
    page.get_by_role("checkbox").nth(DESK_SOLO).check()
    until(page, lambda: own_viewer.panel.read().solo == 1)
    scene = room_scene()
    alone = own_viewer._colours.mixed(
        mixing_weights_of(own_viewer, own_viewer.panel.read()), 1.0, "AgX"
    )
    # The widget holds its new value before its callback asks for new colours: wait for these.
    until(page, lambda: np.array_equal(own_viewer._node.rgbs, alone))
    assert alone.mean() < own_viewer._colours.mixed(
        mixing_weights(scene).astype(np.float32), 1.0, "AgX"
    ).mean()  # fmt: skip
    page.get_by_role("checkbox").nth(DESK_SOLO).uncheck()
    until(page, lambda: own_viewer.panel.read() == original_lighting(own_viewer.viewed.scene))


def mixing_weights_of(viewer: Viewer, lighting: Lighting) -> np.ndarray:
    scene = viewer.viewed.scene
    return mixing_weights(scene, lamp_settings(light_names(scene), lighting)).astype(np.float32)


def test_a_still_is_the_linear_light_of_this_tabs_view(
    own_viewer: Viewer, open_own_tab: Callable[[], Page], tmp_path: Path
) -> None:
    page = open_own_tab()
    press(page, "Still (EXR)")
    page.get_by_text(re.compile(r"still-.*\.exr")).wait_for()
    (still,) = (tmp_path / "out").glob("still-*.exr")
    (tab,) = own_viewer._tabs.values()
    shot = own_viewer.shot(tab.client)
    image = read_exr(still)["image"]
    assert image.shape[:2] == (shot.camera.height, shot.camera.width)
    np.testing.assert_array_equal(image[..., :3], own_viewer.renderer.linear(shot))


def test_sliders_in_motion_leave_no_stale_frames_behind(
    own_viewer: Viewer, open_own_tab: Callable[[], Page]
) -> None:
    page = open_own_tab()
    page.get_by_text("Exact picture").wait_for()
    shown: list[int] = []
    mix = own_viewer._colours.mixed

    def counted(*arguments: object) -> np.ndarray:
        shown.append(1)
        page_busy.wait(0.2)
        return mix(*arguments)  # type: ignore[arg-type]

    page_busy = threading.Event()
    own_viewer._colours.mixed = counted  # type: ignore[method-assign, assignment]
    moves = 0
    for slider in page.get_by_role("slider").all()[:4]:
        slider.focus()
        for _ in range(12):
            slider.press("ArrowRight")
            moves += 1
    until(page, lambda: np.array_equal(own_viewer._node.rgbs, asked_for(own_viewer, mix)))
    # A slow mix of 0.2 s a frame: a queue would hold one for each of the 48 moves.
    assert 1 <= len(shown) < moves


def asked_for(viewer: Viewer, mix: Callable[..., np.ndarray]) -> np.ndarray:
    """The colours of what the panel says now."""
    lighting = viewer.panel.read()
    gain = viewer.viewed.scene.tone.exposure * 2.0**lighting.exposure_ev
    return mix(mixing_weights_of(viewer, lighting), gain, "AgX")

"""Solo and stills, pressed in Chromium."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from viewer_scene import room_scene, save_room

from luxcore.files.exr import read_exr
from luxcore.ports import free_port
from luxcore.splats.relighting import mixing_weights
from luxcore.viewer.app import Viewer
from luxcore.viewer.lighting import Lighting, original_lighting
from luxcore.viewer.open import open_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, ViewportSize

pytestmark = pytest.mark.browser

WAIT_MS = 120_000
"""Generous: Chromium draws in software, and tests share a machine."""
DESK_SOLO = 3


@pytest.fixture
def viewer(tmp_path: Path) -> Iterator[Viewer]:
    viewed = open_scene(save_room(tmp_path / "room"))
    running = Viewer(viewed, "127.0.0.1", free_port(), tmp_path / "out")
    yield running
    running.close()


@pytest.fixture
def open_tab(chromium: Browser, viewer: Viewer) -> Iterator[Callable[[], Page]]:
    contexts = []

    def opened() -> Page:
        size: ViewportSize = {"width": 760, "height": 800}
        contexts.append(chromium.new_context(viewport=size))
        contexts[-1].set_default_timeout(WAIT_MS)
        contexts[-1].set_default_navigation_timeout(WAIT_MS)
        page = contexts[-1].new_page()
        page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
        page.get_by_role("button", name="Original lighting").wait_for()
        for folder in ("presets", "camera"):
            page.get_by_text(folder, exact=True).click()
        page.get_by_role("button", name="Still (EXR)").wait_for()
        return page

    yield opened
    for context in contexts:
        context.close()


def press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def until(page: Page, reached: Callable[[], bool]) -> None:
    """Wait for something that happens on the server."""
    for _ in range(WAIT_MS // 100):
        if reached():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come about in time")


def test_solo_shows_one_light_and_gives_the_others_back(
    viewer: Viewer, open_tab: Callable[[], Page]
) -> None:
    page = open_tab()
    page.get_by_role("checkbox").nth(DESK_SOLO).check()
    until(page, lambda: viewer.panel.read().solo == 1)
    scene = room_scene()
    alone = viewer._colours.mixed(mixing_weights_of(viewer, viewer.panel.read()), 1.0, "AgX")
    # The widget holds its new value before its callback asks for new colours: wait for these.
    until(page, lambda: np.array_equal(viewer._node.rgbs, alone))
    assert alone.mean() < viewer._colours.mixed(
        mixing_weights(scene).astype(np.float32), 1.0, "AgX"
    ).mean()  # fmt: skip
    page.get_by_role("checkbox").nth(DESK_SOLO).uncheck()
    until(page, lambda: viewer.panel.read() == original_lighting(viewer.viewed.scene))


def mixing_weights_of(viewer: Viewer, lighting: Lighting) -> np.ndarray:
    from luxcore.viewer.lighting import lamp_settings, light_names

    scene = viewer.viewed.scene
    return mixing_weights(scene, lamp_settings(light_names(scene), lighting)).astype(np.float32)


def test_a_still_is_the_linear_light_of_this_tabs_view(
    viewer: Viewer, open_tab: Callable[[], Page], tmp_path: Path
) -> None:
    page = open_tab()
    press(page, "Still (EXR)")
    page.get_by_text(re.compile(r"still-.*\.exr")).wait_for()
    (still,) = (tmp_path / "out").glob("still-*.exr")
    (tab,) = viewer._tabs.values()
    shot = viewer.shot(tab.client)
    image = read_exr(still)["image"]
    assert image.shape[:2] == (shot.camera.height, shot.camera.width)
    np.testing.assert_array_equal(image[..., :3], viewer.renderer.linear(shot))

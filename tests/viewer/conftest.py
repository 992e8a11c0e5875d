"""A viewer of its own for a test, and what a person does with its page in Chromium."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from page_actions import WAIT_MS
from viewer_scene import serving_room

from luxcore.viewer.app import Viewer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, ViewportSize


@pytest.fixture
def own_viewer(tmp_path: Path) -> Iterator[Viewer]:
    with serving_room(tmp_path) as running:
        yield running


@pytest.fixture
def open_own_tab(chromium: Browser, own_viewer: Viewer) -> Iterator[Callable[[], Page]]:
    """Opens tabs of `own_viewer` with the folders "presets" and "camera" unfolded."""
    contexts = []

    def opened() -> Page:
        size: ViewportSize = {"width": 760, "height": 800}
        contexts.append(chromium.new_context(viewport=size))
        contexts[-1].set_default_timeout(WAIT_MS)
        contexts[-1].set_default_navigation_timeout(WAIT_MS)
        page = contexts[-1].new_page()
        page.goto(f"http://127.0.0.1:{own_viewer.server.get_port()}")
        page.get_by_role("button", name="Original lighting").wait_for()
        for folder in ("presets", "camera"):
            page.get_by_text(folder, exact=True).click()
        page.get_by_role("button", name="Still (EXR)").wait_for()
        return page

    yield opened
    for context in contexts:
        context.close()

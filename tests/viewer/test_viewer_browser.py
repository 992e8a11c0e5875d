"""The viewer in Chromium: what a person clicks is what the splats show, in every tab."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from page_actions import until
from viewer_scene import room_scene, serving_room

from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.splats.relighting import LampSetting, mixing_weights
from luxcore.viewer.app import Viewer
from luxcore.viewer.lighting import original_lighting
from luxcore.viewer.tabs import EXACT

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser

# Rows are ambient, desk, wall, floor; each has the checkboxes "on" and "solo".
AMBIENT_SOLO, DESK_ON = 1, 2


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Viewer]:
    with serving_room(tmp_path_factory.mktemp("viewer")) as running:
        yield running


@pytest.fixture
def open_tab(chromium: Browser, viewer: Viewer) -> Iterator[Callable[[], Page]]:
    contexts, strangers = [], []

    def opened() -> Page:
        contexts.append(chromium.new_context(viewport={"width": 700, "height": 420}))
        page = contexts[-1].new_page()
        page.on("request", lambda r: _note_stranger(strangers, r.url))
        page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
        page.get_by_role("button", name="Original lighting").wait_for()
        return page

    yield opened
    for context in contexts:
        context.close()
    viewer.panel.show(original_lighting(viewer.viewed.scene))
    assert strangers == []


def _note_stranger(strangers: list[str], url: str) -> None:
    if not url.startswith(("http://127.0.0.1", "ws://127.0.0.1", "blob:", "data:")):
        strangers.append(url)


def wait_until(page: Page, checkbox: int, *, checked: bool) -> None:
    from playwright.sync_api import expect

    expect(page.get_by_role("checkbox").nth(checkbox)).to_be_checked(
        checked=checked, timeout=20_000
    )


def until_shown(page: Page, viewer: Viewer, settings: dict[str, LampSetting]) -> None:
    """Wait for the colours of `settings`: the widgets hold their values before colours follow."""
    wanted = expected(settings)

    def is_shown() -> bool:
        colours = np.asarray(viewer._node.rgbs) / 255.0
        return np.allclose(colours, wanted, rtol=0, atol=0.51 / 255 + 1e-4)

    until(page, is_shown, 20_000)


def expected(settings: dict[str, LampSetting]) -> np.ndarray:
    scene = room_scene()
    return agx(np.einsum("nmc,mc->nc", scene.radiance, mixing_weights(scene, settings)))


def test_a_switch_in_one_tab_relights_both(viewer: Viewer, open_tab: Callable[[], Page]) -> None:
    first, second = open_tab(), open_tab()
    until_shown(first, viewer, {})
    first.get_by_role("checkbox").nth(DESK_ON).uncheck()
    wait_until(second, DESK_ON, checked=False)
    until_shown(second, viewer, {"desk": LampSetting(0.0)})
    second.get_by_role("button", name="Original lighting").click()
    wait_until(first, DESK_ON, checked=True)
    until_shown(first, viewer, {})


def test_at_rest_the_exact_picture_is_shown_and_said(
    viewer: Viewer, open_tab: Callable[[], Page]
) -> None:
    page = open_tab()
    page.get_by_text("Exact picture").wait_for(timeout=30_000)
    page.get_by_role("checkbox").nth(AMBIENT_SOLO).check()
    page.get_by_text("Fast preview").wait_for()
    page.get_by_text("Exact picture").wait_for(timeout=30_000)
    assert all(tab.status.content == EXACT for tab in viewer._tabs.values())


def test_a_tab_that_closes_half_way_takes_nothing_with_it(
    viewer: Viewer, open_tab: Callable[[], Page]
) -> None:
    page = open_tab()
    page.get_by_role("checkbox").nth(DESK_ON).uncheck()
    page.context.close()
    again = open_tab()
    wait_until(again, DESK_ON, checked=False)
    assert viewer.exact.drain(30.0)


def test_a_port_in_use_is_one_sentence_and_nothing_else_is_reachable(viewer: Viewer) -> None:
    port = viewer.server.get_port()
    with pytest.raises(InputError, match=f"port {port} on 127.0.0.1 cannot be used"):
        Viewer(viewer.viewed, "127.0.0.1", port, Path("unused"))
    assert viewer.server.get_host() == "127.0.0.1"
    assert viewer.server.request_share_url() is None

"""The page in Chromium: the light that a visitor sees is the light that Python computes."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from explorer_photo import Photo
from PIL import Image

from luxcore.explorer import write_explorer
from luxcore.explorer.codes import decode
from luxcore.light.agx import agx, srgb_decode

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser

# The colours of the fixture's lamps at luminance 1: layers are stored at the lamp's luminance.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
DESK = np.array([1.0, 0.75, 0.5]) / (np.array([1.0, 0.75, 0.5]) @ LUMINANCE)
WALL = np.array([0.4, 0.45, 0.5]) / (np.array([0.4, 0.45, 0.5]) @ LUMINANCE)


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory, photo: Photo) -> Path:
    return write_explorer(tmp_path_factory.mktemp("page") / "blend.html", *photo.arguments())


@pytest.fixture
def tab(chromium: Browser, page_file: Path) -> Iterator[Page]:
    context = chromium.new_context(viewport={"width": 1200, "height": 800})
    page = context.new_page()
    faults: list[str] = []
    page.on("request", lambda r: faults.append(r.url) if not r.url.startswith("file:") else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    yield page
    assert not faults
    context.close()


def open_page(tab: Page, page_file: Path, state: str = "") -> None:
    tab.goto(f"{page_file.as_uri()}#{state}")
    tab.wait_for_selector("#view:not([hidden])")


def downloaded(tab: Page) -> np.ndarray:
    with tab.expect_download() as download:
        tab.click("#download")
    return np.asarray(Image.open(download.value.path()).convert("RGB"), np.float64) / 255


def stored_layers(page_file: Path) -> list[np.ndarray]:
    """The layers as the page holds them, decoded by Pillow instead of by the browser."""
    scene = json.loads(
        re.search(r'type="application/json">(.*?)</script>', page_file.read_text())[1]
    )
    rows = scene["rows"]
    files = [io.BytesIO(base64.b64decode(row["data"])) for row in rows]
    return [
        decode(np.asarray(Image.open(file)), row["span"])
        for file, row in zip(files, rows, strict=True)
    ]


@pytest.mark.parametrize(
    ("state", "weights", "ev"),
    [
        ("", [[1, 1, 1], DESK, WALL], 0),
        ("l0=0,0,o&l1=1,3,xff0000&l2=1,-1,o", [[0, 0, 0], [8, 0, 0], 0.5 * WALL], 0),
        ("ev=-4&solo=2&l2=0,6,x8000ff", [[0] * 3, [0] * 3, [64 * 0.21586, 0, 64]], -4),
        ("ev=6&l1=0,0,o&l2=0,0,o", [[1, 1, 1], [0] * 3, [0] * 3], 6),
    ],
)
def test_shader_matches_python_within_two_steps(
    tab: Page, page_file: Path, state: str, weights: list, ev: float
) -> None:
    open_page(tab, page_file, state)
    layers = stored_layers(page_file)
    mixed = sum(layer * np.array(w) for layer, w in zip(layers, weights, strict=True))
    expected = agx(2.0**ev * mixed)
    assert np.abs(downloaded(tab) - expected).max() * 255 <= 2.0


def test_original_lighting_is_the_photo(tab: Page, page_file: Path, photo: Photo) -> None:
    open_page(tab, page_file)
    error = np.abs(downloaded(tab) - photo.photo_display) * 255
    # 8-bit logarithmic codes cost less than one step; the sharp edges of emitters cost more.
    assert error.mean() < 1.0
    assert np.quantile(error, 0.99) < 3


def test_keyboard_switches_lamps_and_the_address_remembers(tab: Page, page_file: Path) -> None:
    open_page(tab, page_file)
    lit = downloaded(tab)
    tab.keyboard.press("1")
    assert not tab.locator(".row").nth(1).locator("[role=switch]").is_checked()
    dark = downloaded(tab)
    assert srgb_decode(dark).mean() < 0.8 * srgb_decode(lit).mean()
    tab.wait_for_url("**l1=0,0,o")
    tab.reload()
    tab.wait_for_selector("#view:not([hidden])")
    assert np.array_equal(downloaded(tab), dark)
    tab.keyboard.press("0")
    assert np.array_equal(downloaded(tab), lit)


def test_a_foreign_address_is_clamped_not_trusted(tab: Page, page_file: Path) -> None:
    open_page(tab, page_file, "ev=NaN&solo=99&l1=maybe,1e9,url(x)&l77=1,1,o&split=-4")
    state = tab.evaluate("state")
    assert state["ev"] == 0
    assert state["split"] == 0
    assert state["rows"][1] == {"on": False, "stops": 6, "colour": "o"}
    assert len(state["rows"]) == 3


def test_every_control_has_a_name_and_is_reached_by_tab(tab: Page, page_file: Path) -> None:
    open_page(tab, page_file)
    nameless = tab.evaluate(
        """() => [...document.querySelectorAll('#panel input, #panel button, #split')]
          .filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() ||
                         [...(e.labels || [])].some(l => l.textContent.trim())))
          .map(e => e.outerHTML)"""
    )
    assert nameless == []
    reached = set()
    for _ in range(40):
        tab.keyboard.press("Tab")
        reached.add(tab.evaluate("document.activeElement.className || document.activeElement.id"))
    assert {"split", "original", "exposure", "stops", "kelvin", "rgb", "solo"} <= reached


def test_on_a_phone_nothing_is_wider_than_the_screen(chromium: Browser, page_file: Path) -> None:
    context = chromium.new_context(viewport={"width": 360, "height": 740}, has_touch=True)
    page = context.new_page()
    open_page(page, page_file)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    context.close()


def test_without_webgl_the_photo_and_a_sentence_remain(
    chromium: Browser, chromium_path: str, page_file: Path
) -> None:
    browser = chromium.browser_type.launch(
        executable_path=chromium_path, args=["--no-sandbox", "--disable-3d-apis"]
    )
    page = browser.new_page()
    page.goto(page_file.as_uri())
    page.wait_for_selector("#message:not([hidden])")
    assert "no WebGL 2" in page.inner_text("#message")
    assert page.evaluate("document.getElementById('photo').naturalWidth") == 128
    assert page.locator("#panel").is_hidden()
    browser.close()

"""Keyframes and films of the viewer, worked in Chromium."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import imageio.v2 as imageio
import numpy as np
import pytest
from page_actions import WAIT_MS, drag, press, until

from luxcore.files.photos import read_photo
from luxcore.viewer.app import Viewer

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.browser

DESK_SOLO = 3


def test_a_film_goes_through_the_keyframes_and_is_a_video_too(
    own_viewer: Viewer, open_own_tab: Callable[[], Page], tmp_path: Path
) -> None:
    page = open_own_tab()
    press(page, "Render film")
    page.get_by_text("it needs two, there are 0").wait_for()
    (tab,) = own_viewer._tabs.values()
    press(page, "Add keyframe")
    until(page, lambda: len(tab.keyframes) == 1)
    drag(page, 60)
    press(page, "Add keyframe")
    until(page, lambda: len(tab.keyframes) == 2)
    assert not np.allclose(tab.keyframes[0].c2w, tab.keyframes[1].c2w)
    # The last two sliders; Home is their least.
    for place, slider, least in ((-2, own_viewer.files.seconds, 1), (-1, own_viewer.files.fps, 5)):
        page.get_by_role("slider").nth(place).press("Home")
        until(page, lambda slider=slider, least=least: slider.value == least)
    press(page, "Render film")
    page.get_by_text(re.compile(r"film\.mp4")).wait_for()
    (film,) = (tmp_path / "out").glob("film-*")
    pictures = sorted(film.glob("*.png"))
    assert [p.name for p in pictures] == [f"{i:04d}.png" for i in range(5)]
    assert len(imageio.mimread(film / "film.mp4")) == 5
    first, last = read_photo(pictures[0]), read_photo(pictures[-1])
    assert np.abs(first - last).mean() > 0.005


def test_a_film_is_stopped_and_leaves_exact_pictures_to_others(
    own_viewer: Viewer, open_own_tab: Callable[[], Page], tmp_path: Path
) -> None:
    page, other = open_own_tab(), open_own_tab()
    (first, _) = own_viewer._tabs.values()
    first.keyframes.extend(own_viewer.viewed.cameras)
    press(page, "Render film")
    page.get_by_text(re.compile(r"\d+ of 96 pictures")).wait_for()
    # While the film is made, the other tab still gets its exact picture.
    other.get_by_role("checkbox").nth(DESK_SOLO).check()
    other.get_by_text("Exact picture").wait_for()
    press(page, "Stop film")
    own_viewer.films.drain(WAIT_MS / 1000)
    assert not list((tmp_path / "out").glob("film-*/film.mp4")) or stopped_too_late(tmp_path)


def stopped_too_late(tmp_path: Path) -> bool:
    """All 96 pictures were done before the click arrived: a fast machine, no fault."""
    return len(list((tmp_path / "out").glob("film-*/*.png"))) == 96


def test_a_tab_that_closes_during_its_film_does_not_end_the_viewer(
    own_viewer: Viewer, open_own_tab: Callable[[], Page]
) -> None:
    page = open_own_tab()
    (tab,) = own_viewer._tabs.values()
    tab.keyframes.extend(own_viewer.viewed.cameras)
    press(page, "Render film")
    page.get_by_text(re.compile(r"\d+ of 96 pictures")).wait_for()
    page.context.close()
    again = open_own_tab()
    again.get_by_text("Exact picture").wait_for()
    assert len(own_viewer._tabs) == 1

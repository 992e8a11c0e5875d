"""What a person does with the viewer's page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Page

WAIT_MS = 120_000
"""Generous: Chromium draws in software, and tests share a machine."""


def press(page: Page, name: str) -> None:
    """Click the button of this name."""
    page.get_by_role("button", name=name, exact=True).click()


def drag(page: Page, across: int) -> None:
    """Turn the camera by hand."""
    page.mouse.move(100, 300)
    page.mouse.down()
    for step in range(10):
        page.mouse.move(100 + across * (step + 1) / 10, 300)
    page.mouse.up()
    page.wait_for_timeout(300)


def until(page: Page, reached: Callable[[], bool], wait_ms: int = WAIT_MS) -> None:
    """Wait for something that happens on the server."""
    for _ in range(wait_ms // 100):
        if reached():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come about in time")

"""Rooms with and without each effect: where one is switched off nothing is lost, else it shows."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.blender]

Cases = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def flipped(project_root: Path) -> Cases:
    """Every case rendered as decided and the other way round."""
    run = [sys.executable, "-m", "tests.render.flip_effects"]
    result = subprocess.run(run, capture_output=True, text=True, cwd=project_root, check=False)
    assert result.returncode == 0, result.stderr[-2000:]
    return json.loads(result.stdout)


@pytest.mark.parametrize(
    ("effect", "least_loss"),
    [("environment", 0.1), ("transmission", 0.03), ("glossy", 0.03), ("caustics", 0.005)],
)
def test_an_effect_that_a_room_calls_for_shows(
    flipped: Cases, effect: str, least_loss: float
) -> None:
    case = flipped[f"{effect} on"]
    assert case["decided"]
    assert case["light"] < 1 - least_loss
    assert case["changed"] > 0.02


@pytest.mark.parametrize("effect", ["transmission", "caustics", "glossy"])
def test_what_is_switched_off_is_not_there_to_be_lost(flipped: Cases, effect: str) -> None:
    """The same random numbers: not one pixel differs. (Glossy bounces are fewer, not none.)"""
    case = flipped[f"{effect} off"]
    assert case["decided"] is (effect == "glossy")
    assert case["light"] == pytest.approx(1, abs=1e-6)
    assert case["changed"] == 0


@pytest.mark.parametrize(
    "name", ["environment off", "portals on", "light_tree on", "light_tree off"]
)
def test_what_only_chooses_samples_keeps_the_light(flipped: Cases, name: str) -> None:
    """Other random numbers: equal up to the noise of a whole picture, 1 to 2 % at 64 samples."""
    assert flipped[name]["decided"] is name.endswith("on")
    assert flipped[name]["light"] == pytest.approx(1, abs=0.05)

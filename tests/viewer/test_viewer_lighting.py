"""Weights, presets, colours and camera paths of the viewer."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from viewer_scene import room_scene

from luxcore.cameras import look_at
from luxcore.errors import InputError
from luxcore.light.agx import agx
from luxcore.splats.relighting import mixing_weights
from luxcore.viewer.colours import Colours, tone_map
from luxcore.viewer.lighting import (
    Lighting,
    Row,
    lamp_settings,
    light_names,
    original_lighting,
)
from luxcore.viewer.path import camera_path
from luxcore.viewer.presets import load_preset, preset_value

SCENE = room_scene()
ORIGINAL = original_lighting(SCENE)


def with_row(index: int, row: Row) -> Lighting:
    rows = ORIGINAL.rows
    return replace(ORIGINAL, rows=(*rows[:index], row, *rows[index + 1 :]))


def weights(lighting: Lighting) -> np.ndarray:
    return mixing_weights(SCENE, lamp_settings(light_names(SCENE), lighting))


def test_original_lighting_is_the_scale_of_the_photos() -> None:
    expected = [[1, 1, 1], [2, 1, 0.5], [0, 0, 0], [0.3, 0.4, 0.4]]
    np.testing.assert_allclose(weights(ORIGINAL), expected)
    np.testing.assert_allclose(weights(ORIGINAL), mixing_weights(SCENE))


def test_stops_colour_and_solo() -> None:
    lighting = with_row(1, Row(True, 1.0, (0.5, 1.0, 0.0)))
    luminance = 2 * 0.2126 + 0.7152 + 0.5 * 0.0722
    np.testing.assert_allclose(weights(lighting)[1], 2 * luminance * np.array([0.5, 1.0, 0.0]))
    alone = weights(replace(lighting, solo=3))
    assert not alone[:3].any()
    np.testing.assert_allclose(alone[3], [0.3, 0.4, 0.4])


def test_a_preset_comes_back_as_it_was() -> None:
    changed = with_row(1, Row(False, -1.5, (0.1, 0.2, 1.0)))
    lighting = replace(changed, exposure_ev=0.5, tone="standard")
    text = json.dumps(preset_value(SCENE, lighting))
    assert load_preset(text, "evening.json", SCENE) == lighting


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('{"lights": {"chandelier": {"on": true}}}', "evening.json sets 'chandelier', which is"),
        ('{"lights": {"desk": {"on": true, "stops": 99}}}', "lights.desk.stops"),
        ('{"lights": {"desk": {"on": 1}}}', "lights.desk.on"),
        ('{"lights": {}, "version": 2}', "version"),
        ('{"lights": {}, "code": 2}', "code"),
        ("[1]", "not a lighting preset"),
        ("{", "not a lighting preset"),
        ("[" * 100_000, "not a lighting preset"),
    ],
)
def test_a_bad_preset_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence) as caught:
        load_preset(text, "evening.json", SCENE)
    assert "\n" not in str(caught.value)


def test_a_solo_row_is_saved_as_what_it_shows() -> None:
    lights = preset_value(SCENE, replace(ORIGINAL, solo=1))["lights"]
    assert [name for name, row in lights.items() if row["on"]] == ["desk"]


@pytest.mark.parametrize("count", [1, 25_000, 60_001])
def test_colours_are_the_tone_mapped_sum_of_lights(count: int) -> None:
    random = np.random.Generator(np.random.PCG64(0))
    radiance = random.exponential(0.5, (count, 4, 3)).astype(np.float32)
    weights = random.uniform(0, 2, (4, 3)).astype(np.float32)
    mixed = Colours(radiance).mixed(weights, 1.5, "AgX")
    picks = np.linspace(0, count - 1, 50).astype(int)
    expected = agx(1.5 * np.einsum("nmc,mc->nc", radiance[picks].astype(np.float64), weights))
    # Rounding to 8 bits, and one step where float32 falls on the other side of a half.
    assert np.abs(mixed[picks] / 255.0 - expected).max() <= 0.51 / 255 + 1e-4


def test_standard_tone_is_plain_srgb() -> None:
    grey = np.full((1, 3), 0.18, np.float32)
    np.testing.assert_allclose(tone_map(grey, 1.0, "standard"), 0.4613, atol=1e-3)
    assert tone_map(100 * grey, 1.0, "standard").max() == pytest.approx(1.0, abs=1e-6)


def test_a_path_passes_through_its_keyframes() -> None:
    stops = [look_at(np.array([x, 1.0, 1]), np.zeros(3), 60.0, 64, 48) for x in (0.0, 1.0, 3.0)]
    path = camera_path(stops, 21)
    for index, stop in ((0, stops[0]), (10, stops[1]), (20, stops[2])):
        np.testing.assert_allclose(path[index].c2w, stop.c2w, atol=1e-9)
        assert path[index].fy == pytest.approx(stop.fy)
    for camera in path:
        np.testing.assert_allclose(camera.c2w[:3, :3] @ camera.c2w[:3, :3].T, np.eye(3), atol=1e-9)


def test_a_loop_ends_before_it_starts_again() -> None:
    stops = [
        look_at(np.array([np.cos(a), np.sin(a), 1.0]), np.zeros(3), 60.0, 64, 48) for a in (0, 2, 4)
    ]
    path = camera_path(stops, 30, loop=True)
    np.testing.assert_allclose(path[0].c2w, stops[0].c2w, atol=1e-9)
    steps = np.linalg.norm(np.diff([c.centre for c in [*path, path[0]]], axis=0), axis=1)
    assert steps.max() < 2 * steps.mean()


def test_a_path_of_one_keyframe_is_one_sentence() -> None:
    with pytest.raises(InputError, match="two keyframes"):
        camera_path([look_at(np.ones(3), np.zeros(3), 60.0, 64, 48)], 10)

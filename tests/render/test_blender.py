"""Real renders, tiny: geometry and conventions, the sum of the lights, bits, what can go wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from luxcore.cameras import look_at
from luxcore.data.compact import RenderedView, as_taken, load_rendered
from luxcore.errors import LuxError
from luxcore.files.digests import array_digest
from luxcore.files.exr import read_exr
from luxcore.render import PanoramaView, View, render_unit
from luxcore.render.paths import lamps_in_sight, obstacles
from luxcore.render.unit import view_job
from luxcore.render.views import ENVIRONMENT_DISTANCE_M
from luxcore.rooms import Room, generate_room
from luxcore.rooms.batch import demo_room
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import RoomsSettings

pytestmark = pytest.mark.blender

HEIGHT, SPP = 32, 4
SETTINGS = RenderSettings(height=HEIGHT, spp=SPP)
Renders = Callable[..., Path]


@pytest.fixture(scope="module")
def room() -> Room:
    """Three lamps and a window."""
    return demo_room(RoomsSettings())


@pytest.fixture(scope="module")
def render(tmp_path_factory: pytest.TempPathFactory) -> Renders:
    """Render a view of a room; all renders of the module share one Blender process."""

    def call(room: Room, view: View, name: str, threads: int = 1, **changes: Any) -> Path:
        job = {**view_job(room, view, SETTINGS, name=name, spp=SPP), **changes}
        folder = tmp_path_factory.mktemp("views")
        render_unit(folder, threads=threads, **job)
        return folder / name

    return call


@pytest.fixture(scope="module")
def panorama(room: Room) -> PanoramaView:
    return PanoramaView(room.viewpoints[0], 2 * HEIGHT, HEIGHT)


@pytest.fixture(scope="module")
def noisy(room: Room, panorama: PanoramaView, render: Renders) -> Path:
    return render(room, panorama, "noisy", denoise="off")


def pixels_digest(stem: Path) -> list[str]:
    """Digests of every layer of the three files of a view."""
    files = (".exr", ".geometry.exr", ".masks.exr")
    layers = [read_exr(stem.with_name(stem.name + f)) for f in files]
    return [array_digest(v) for each in layers for _, v in sorted(each.items())]


def directions(height: int) -> np.ndarray:
    """[h, 2h, 3] unit vectors of an equirectangular image (docs/conventions.md)."""
    v, u = np.mgrid[0:height, 0 : 2 * height]
    phi = 2 * math.pi * (0.5 - (u + 0.5) / (2 * height))
    theta = math.pi * (0.5 - (v + 0.5) / height)
    flat = np.cos(theta)
    return np.stack([flat * np.cos(phi), flat * np.sin(phi), np.sin(theta)], axis=-1)


def test_rays_end_on_the_floor_and_walls(noisy: Path, room: Room) -> None:
    view = load_rendered(noisy)
    points = view.c2w[:3, 3] + directions(HEIGHT) * view.ray_distance_m[..., None]
    inside = view.ray_distance_m < ENVIRONMENT_DISTANCE_M
    xs, ys = zip(*room.outline, strict=True)
    low, high = np.array([min(xs), min(ys), 0.0]), np.array([max(xs), max(ys), room.height])
    # A pixel of a 64-column panorama is 5.6 degrees wide and its ray is anywhere in it.
    slack = 0.06 * view.ray_distance_m[..., None] + 0.2
    ok = ((points > low - slack) & (points < high + slack)).all(axis=2)
    assert ok[inside].mean() > 0.99
    down = view.normal[-1]
    assert down[:, 2].mean() > 0.9
    assert points[-1, :, 2] == pytest.approx(np.zeros(2 * HEIGHT), abs=0.1)


def test_lamps_are_where_the_room_says(noisy: Path, room: Room) -> None:
    """Azimuth grows to the left, elevation upward: a mirrored panorama would fail."""
    view = load_rendered(noisy)
    rays = directions(HEIGHT)
    seen = 0
    for k, lamp in enumerate(room.lamps):
        mask = view.masks["emitter"][k]
        if not mask.any():
            continue
        seen += 1
        toward = np.array(lamp.position) - view.c2w[:3, 3]
        middle = rays[mask].mean(axis=0)
        cosine = middle @ toward / np.linalg.norm(middle) / np.linalg.norm(toward)
        assert cosine > math.cos(math.radians(15))
    assert seen >= 2


def test_groups_add_up_to_what_the_renderer_sees(noisy: Path) -> None:
    # float32 sums of a dozen terms in another order; relative to the brightest pixel.
    assert json.loads(noisy.with_name("noisy.json").read_text())["sum_error"] < 1e-5


def test_the_photo_is_the_sum_of_what_is_stored(noisy: Path, room: Room) -> None:
    view = load_rendered(noisy)
    total = np.array(view.ambient, np.float64)
    for k, lamp in enumerate(room.lamps):
        total += lamp.on * np.array(lamp.scale) * view.lights[k]
    assert as_taken(view) == pytest.approx(total, rel=1e-5, abs=1e-6)


def test_each_lamp_is_white_and_brightest_at_itself(noisy: Path) -> None:
    view = load_rendered(noisy)
    for k, light in enumerate(view.lights):
        mask = view.masks["emitter"][k]
        assert light.max() > 0
        if mask.sum() > 4:
            brightest = light[mask].max(axis=0)
            # A lamp at unit white gives the same in all channels; the rest is what walls return.
            assert brightest.max() < 1.05 * brightest.min()
            assert light[mask].max() > 5 * np.median(light)


def test_same_bits_again_on_two_threads_and_after_another_room(
    room: Room, panorama: PanoramaView, render: Renders
) -> None:
    first = pixels_digest(render(room, panorama, "again"))
    other = generate_room(3, RoomsSettings())
    render(other, PanoramaView(other.viewpoints[0], 2 * HEIGHT, HEIGHT), "other")
    assert pixels_digest(render(room, panorama, "again", threads=2)) == first


def test_perspective_view_agrees_with_the_room(room: Room, render: Renders) -> None:
    lamp = next(lamp for lamp in room.lamps if lamp.kind == "ceiling")
    eye = np.array(room.viewpoints[0])
    camera = look_at(eye, np.array(lamp.position) - [0, 0, 0.3], 80.0, 48, 36)
    view = load_rendered(render(room, camera, "pinhole"))
    assert view.camera is not None
    assert view.camera.c2w == pytest.approx(camera.c2w)
    if lamps_in_sight(room, obstacles(room), camera)[lamp.id]:
        x, y, z = (camera.viewmat @ np.array([*lamp.position, 1.0]))[:3]
        column, row = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        rows, columns = np.nonzero(view.masks["hull"][lamp.id])
        assert abs(columns.mean() - column) < 5
        assert abs(rows.mean() - row) < 5
    # Along the ray, not along z: the corner of the image is farther than its z.
    assert view.ray_distance_m.min() > 0.2


def test_closed_room_renders_without_environment(room: Room, render: Renders) -> None:
    """Switching off what is not needed changes nothing: no pixel sees the outside."""
    solid = next(generate_room(s, RoomsSettings()) for s in range(100) if _closed(s))
    view = PanoramaView(solid.viewpoints[0], 2 * HEIGHT, HEIGHT)
    stem = render(solid, view, "closed", denoise="off")
    loaded = load_rendered(stem)
    assert not loaded.window.any()
    assert not loaded.ambient.any()
    assert not loaded.metadata["effects"]["environment"]["on"]


def test_the_window_mask_is_where_the_outside_is(render: Renders) -> None:
    bright = next(r for r in (generate_room(s, RoomsSettings()) for s in range(50)) if _sunny(r))
    view = PanoramaView(bright.viewpoints[0], 2 * HEIGHT, HEIGHT)
    loaded = load_rendered(render(bright, view, "sunny"))
    assert loaded.window.any()
    assert (loaded.ray_distance_m[loaded.window] == ENVIRONMENT_DISTANCE_M).all()
    assert np.median(loaded.ambient[loaded.window]) > np.median(loaded.ambient[~loaded.window])


def test_a_sky_with_values_that_cannot_be_is_rendered_without_them(
    render: Renders, tmp_path: Path
) -> None:
    """Damaged pixels as black ones: the same picture, and their number in the metadata."""
    bright = next(r for r in (generate_room(s, RoomsSettings()) for s in range(50)) if _sunny(r))
    view = PanoramaView(bright.viewpoints[0], 32, 16)
    sky = np.random.Generator(np.random.PCG64(1)).uniform(0.5, 2.0, (16, 32, 3)).astype(np.float32)
    black = sky.copy()
    black[3, 4], black[8, :10] = 0.0, 0.0
    sky[3, 4], sky[8, :10] = np.nan, -5.0
    seen = {}
    for name, pixels in (("black", black), ("damaged", sky)):
        channels = {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")}
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, channels).write(str(tmp_path / f"{name}.exr"))
        assert bright.environment is not None
        outside = replace(bright.environment, hdri=str(tmp_path / f"{name}.exr"))
        room = replace(bright, environment=outside)
        seen[name] = load_rendered(render(room, view, name, spp=1, denoise="off"))
    assert "changed_values" not in seen["black"].metadata["environment"]
    assert seen["damaged"].metadata["environment"]["changed_values"] == 33
    assert seen["damaged"].ambient.any()
    assert seen["damaged"].ambient == pytest.approx(seen["black"].ambient, rel=1e-3, abs=1e-6)


def test_top_up_renders_the_worst_lamp_only(
    room: Room, panorama: PanoramaView, render: Renders
) -> None:
    plain = _loaded(render(room, panorama, "plain"))
    topped = _loaded(render(room, panorama, "topped", top_up_noise=0.01))
    name = topped.metadata["topped_up"]
    assert plain.metadata["topped_up"] is None
    assert name == max(
        (k for k in plain.metadata["noise"] if k != "ambient"),
        key=lambda k: plain.metadata["noise"][k],
    )
    assert topped.metadata["noise"][name] < plain.metadata["noise"][name]
    for k in range(len(room.lamps)):
        same = (plain.lights[k] == topped.lights[k]).all()
        assert bool(same) is (name != f"light_{k:02d}")


def test_a_room_that_cannot_be_built_is_named(
    room: Room, panorama: PanoramaView, render: Renders
) -> None:
    broken = replace(room, environment=None, materials={})
    with pytest.raises(LuxError, match="Blender gave no image"):
        render(broken, panorama, "broken")


def test_a_room_that_needs_too_much_memory_fails_and_the_next_one_renders(
    room: Room, panorama: PanoramaView, render: Renders
) -> None:
    with pytest.raises(LuxError, match="Blender gave no image"):
        render(room, PanoramaView(room.viewpoints[0], 1024, 512), "large", memory_mb=1)
    assert load_rendered(render(room, panorama, "next")).lights.any()


def _loaded(stem: Path) -> RenderedView:
    return load_rendered(stem)


def _closed(seed: int) -> bool:
    return not generate_room(seed, RoomsSettings()).openings


def _sunny(room: Room) -> bool:
    return room.environment is not None and room.environment.mean_radiance > 1.0

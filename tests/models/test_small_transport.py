"""Shadows and bounced light on scenes whose answer is known, and powers read off known light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from luxcore.cameras import look_at
from luxcore.data.crops import LitCrop
from luxcore.models.small.features import lamp_features
from luxcore.models.small.hints import KnownLight, hints_for, references_of
from luxcore.models.small.prior import first_guess, powers_seen, unit_irradiance
from luxcore.models.small.surfaces import Surfaces, lamp_centres, surfaces_of
from luxcore.models.small.transport import BEYOND, bounce_of, visibility
from tests.models.sketched import sketched_crops

SIZE = 32
CAMERA = look_at(np.array([0.0, 0, 1]), np.array([1.0, 0, 1]), 60.0, SIZE, SIZE)
NO_MASK = torch.zeros(SIZE, SIZE)


def flat(depth_m: np.ndarray) -> Surfaces:
    """Surfaces parallel to the picture at these depths."""
    normal = np.broadcast_to(-CAMERA.c2w[:3, 2], (*depth_m.shape, 3)).astype(np.float32)
    return surfaces_of(depth_m.astype(np.float32), normal, CAMERA)


def plate_before_a_wall() -> Surfaces:
    depth = np.full((SIZE, SIZE), 3.0)
    depth[12:20, 12:20] = 1.5
    return flat(depth)


def column_of(x_m: float, z_m: float) -> int:
    return int(CAMERA.fx * x_m / z_m + CAMERA.cx)


def test_a_plate_throws_its_shadow_away_from_the_lamp() -> None:
    lamp = torch.tensor([-0.5, 0.0, 0.2])
    # From the lamp past the plate's middle (0, 1.5 m) the wall is met at x = 0.577 m.
    shadow, lit = column_of(0.577, 3.0), column_of(-0.577, 3.0)
    seen = visibility(plate_before_a_wall(), lamp, NO_MASK)
    assert seen[16, shadow] < 0.3
    assert seen[16, lit] > 0.95
    assert (visibility(flat(np.full((SIZE, SIZE), 3.0)), lamp, NO_MASK) > 0.99).all()


def test_a_fixture_does_not_stand_in_its_own_light() -> None:
    lamp = torch.tensor([-0.5, 0.0, 0.2])
    fixture = torch.zeros(SIZE, SIZE)
    fixture[12:20, 12:20] = 1
    assert (visibility(plate_before_a_wall(), lamp, fixture) > 0.99).all()


def test_a_flat_wall_sends_itself_nothing() -> None:
    bounce = bounce_of(flat(np.full((SIZE, SIZE), 2.0)))
    direct = torch.rand(SIZE, SIZE, generator=torch.Generator().manual_seed(0))
    expected = torch.full_like(direct, BEYOND * float(direct.mean()))
    torch.testing.assert_close(bounce.irradiance(direct), expected, atol=1e-5, rtol=0)


def test_a_lit_wall_lights_the_one_that_faces_it_in_proportion() -> None:
    # The left half is a wall along the view, at x = -1 m; the right half faces the camera.
    rays = np.linspace(-0.57, 0.57, SIZE)
    depth = np.full((SIZE, SIZE), 3.0)
    normal = np.broadcast_to(-CAMERA.c2w[:3, 2], (SIZE, SIZE, 3)).copy()
    depth[:, : SIZE // 2] = np.minimum(1.0 / np.maximum(-rays[: SIZE // 2], 0.1), 3.0)
    normal[:, : SIZE // 2] = CAMERA.c2w[:3, 0]
    bounce = bounce_of(surfaces_of(depth.astype(np.float32), normal.astype(np.float32), CAMERA))
    direct = torch.zeros(SIZE, SIZE)
    direct[:, : SIZE // 2] = 1
    arrived = bounce.irradiance(direct)
    facing = arrived[SIZE // 2, SIZE // 2 :]
    assert facing[1] > 1.2 * BEYOND * 0.5
    assert facing[1] > facing[-1]
    torch.testing.assert_close(bounce.irradiance(3 * direct), 3 * arrived)


def test_powers_are_read_off_known_light_whatever_the_paint() -> None:
    generator = torch.Generator().manual_seed(1)
    field = torch.rand(3, SIZE, SIZE, generator=generator) + 0.05
    paint = torch.rand(3, SIZE, SIZE, generator=generator) * 0.8 + 0.1
    powers = torch.tensor([[2.0, 1.5, 1.0], [0.2, 0.3, 0.4], [1.0, 1.0, 1.0]])
    ambient = torch.tensor([0.5, 0.7, 0.9])
    on, known = torch.tensor([True, True, False]), torch.tensor([True, True, True])
    lights = paint * field[:, None] * powers[:, :, None, None]
    photo = lights[on].sum(0) + paint * ambient.view(3, 1, 1)
    everywhere = torch.ones(SIZE, SIZE, dtype=torch.bool)
    found = powers_seen(photo, lights, field, on, known, everywhere)
    unit = found.ambient / ambient
    torch.testing.assert_close(found.lamps / unit, powers, rtol=0.02, atol=0.0)


def test_a_dark_carpet_and_a_bright_panel_do_not_decide_over_the_powers() -> None:
    y, x = torch.meshgrid(torch.linspace(0, 1, SIZE), torch.linspace(0, 1, SIZE), indexing="ij")
    field = torch.stack([1 / (0.1 + x**2 + y**2), 1 / (0.1 + (1 - x) ** 2 + y**2)])
    powers = torch.tensor([0.4, 0.1])
    lights = field[:, None] * powers.view(2, 1, 1, 1).expand(2, 3, 1, 1)
    photo = lights.sum(0) + 0.1
    photo[:, : SIZE // 6] *= 6
    photo[:, -SIZE // 6 :] *= 0.1
    plain = slice(SIZE // 6, -SIZE // 6)
    on, no_masks = torch.tensor([True, True]), torch.zeros(2, SIZE, SIZE)
    guess = first_guess(photo, no_masks, field, on)
    # Fitted powers count half, so shares are square roots of what the fit says.
    wanted = torch.cat([lights, torch.full((1, 3, SIZE, SIZE), 0.1)])[:, :, plain].sqrt()
    wanted = (wanted / wanted.sum(0))[:2]
    # One plain least-squares fit is wrong by 0.15 here.
    assert (guess.lamps[:, :, plain] - wanted).abs().mean() < 0.07


def test_references_make_the_first_guess_of_another_view_better() -> None:
    plain, told = [], []
    for room in range(4):
        here, there = sketched_crops(2, size_px=48, room=room)
        seen = [view.masks.any((1, 2)) for view in (here, there)]
        on = torch.from_numpy(here.on)
        if not on.any() or not seen[1].any():
            continue
        views = [
            as_known(view, torch.from_numpy(known))
            for view, known in zip((here, there), seen, strict=True)
        ]
        centres, placed = lamp_centres(views[0].masks, views[0].surfaces, views[0].photo, on)
        centres[~placed] = float("nan")
        field = unit_irradiance(views[0].masks, views[0].surfaces, centres, placed).total
        told_by = references_of([views[1]], len(on))
        hints = hints_for(views[0].surfaces, here.camera, told_by)
        truth = views[0].lights / (views[0].photo + 1e-4)
        wanted = on & views[1].known & placed
        for given, errors in ((None, plain), (hints, told)):
            guess = first_guess(views[0].photo, views[0].masks, field, on, given)
            errors.append(float((guess.lamps - truth)[wanted].abs().mean()))
            torch.testing.assert_close(
                guess.lamps.sum(0) + guess.ambient, torch.ones_like(guess.ambient)
            )
    assert len(plain) >= 2
    assert np.mean(told) < 0.8 * np.mean(plain)


def as_known(crop: LitCrop, known: torch.Tensor) -> KnownLight:
    photo = torch.from_numpy(crop.image_linear).movedim(-1, 0).float()
    lights = torch.from_numpy(crop.lights).movedim(-1, 1).float()
    masks = torch.from_numpy(crop.masks).float()
    surfaces = surfaces_of(crop.depth_m, crop.normal, crop.camera)
    return KnownLight(crop.camera, photo, masks, torch.from_numpy(crop.on), surfaces, lights, known)


def test_references_that_show_nothing_tell_nothing() -> None:
    crop = sketched_crops(1)[0]
    view = as_known(crop, torch.ones(len(crop.on), dtype=torch.bool))
    on = torch.from_numpy(crop.on)
    centres = torch.full((len(on), 3), float("nan"))
    white = references_of([replace(view, photo=view.photo * 0 + 16)], len(on))
    assert hints_for(view.surfaces, crop.camera, white) is None
    itself = references_of([view], len(on))
    assert hints_for(None, crop.camera, itself) is None
    hints = hints_for(view.surfaces, crop.camera, itself)
    features = lamp_features(view.photo, view.masks, on, view.surfaces, centres, hints)
    assert torch.isfinite(features).all()


def test_a_channel_that_no_light_has_leaves_everything_finite() -> None:
    crops = sketched_crops(3, room=2)
    lamps = len(crops[0].on)
    on = torch.ones(lamps, dtype=torch.bool)
    views = []
    for index, crop in enumerate(crops):
        known = torch.zeros(lamps, dtype=torch.bool)
        known[index % lamps] = True
        view = as_known(crop, known)
        red = torch.tensor([1.0, 0.5, 0.0]).view(3, 1, 1)
        lights, photo = view.lights * red, (view.lights * red).sum(0)
        views.append(replace(view, lights=lights, photo=photo, on=on))
    target = views[0]
    centres = torch.full((lamps, 3), float("nan"))
    for references in (views[1:2], views[1:]):
        told_by = references_of(references, lamps)
        hints = hints_for(target.surfaces, target.camera, told_by)
        assert hints is not None
        features = lamp_features(target.photo, target.masks, on, target.surfaces, centres, hints)
        assert torch.isfinite(features).all()

"""Light fields: fractions that add up, ratios without bound, masks that decide, any photo size."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from luxcore.models.small.emitters import emitter_masks, keep_out_of_emitters
from luxcore.models.small.grid import grid_size, lights_at_full_size, masks_to_grid
from luxcore.models.small.heads import (
    GLOW,
    LightFields,
    OnGrid,
    WarpedLight,
    lamp_light,
    light_fields,
)
from luxcore.models.small.levels import CLIPPED, PHOTO_MAX
from luxcore.models.small.network import MV_OUTPUTS, SV_OUTPUTS


def random(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def unseen(lamps: int, size: int) -> OnGrid:
    """A grey photo whose lamps' masks are empty."""
    return OnGrid(torch.full((3, size, size), 0.2), torch.zeros(lamps, size, size))


@pytest.mark.parametrize("on", [[True, True, True], [True, False, True], [False, False, False]])
def test_fractions_sum_to_one_and_lamps_that_are_off_have_none(on: list[bool]) -> None:
    burning = torch.tensor(on)
    fields = light_fields(3 * random(3, SV_OUTPUTS, 8, 8), burning, unseen(3, 8))
    torch.testing.assert_close(fields.fraction.sum(0), torch.ones(3, 8, 8))
    assert (fields.fraction[1:][~burning] == 0).all()
    assert (fields.fraction >= 0).all()


def test_no_lamps_leave_everything_to_the_ambient() -> None:
    fields = light_fields(
        torch.zeros(0, SV_OUTPUTS, 4, 4), torch.zeros(0, dtype=torch.bool), unseen(0, 4)
    )
    torch.testing.assert_close(fields.fraction, torch.ones(1, 3, 4, 4))


def test_lights_of_an_unclipped_photo_add_up_to_it() -> None:
    on = torch.tensor([True, True])
    photo = random(3, 8, 8).abs().clamp(0, 5)
    fields = light_fields(random(2, SV_OUTPUTS, 8, 8), on, unseen(2, 8))
    total = fields.fraction[0] * photo + lamp_light(fields, photo, on).sum(0)
    torch.testing.assert_close(total, photo)


def test_a_clipped_emitter_gets_more_light_than_the_photo_shows() -> None:
    on = torch.tensor([True])
    photo = torch.full((3, 4, 4), PHOTO_MAX)
    photo[:, :2] = 0.5 * CLIPPED
    outputs = torch.zeros(1, SV_OUTPUTS, 4, 4)
    fields = light_fields(outputs, on, unseen(1, 4))
    light = lamp_light(fields, photo, on)[0] / fields.fraction[1]
    assert (light[:, 2:] > photo[:, 2:] * 1.5).all()
    torch.testing.assert_close(light[:, :2], photo[:, :2])


def test_a_lamp_that_is_off_can_be_brighter_than_the_photo() -> None:
    on = torch.tensor([False])
    outputs = torch.zeros(1, SV_OUTPUTS, 4, 4)
    outputs[:, 6:9] = 4.0
    light = lamp_light(light_fields(outputs, on, unseen(1, 4)), torch.full((3, 4, 4), 0.1), on)
    assert (light > 5).all()
    dark = lamp_light(light_fields(outputs, on, unseen(1, 4)), torch.zeros(3, 4, 4), on)
    assert (dark > 0.5).all(), "a black pixel can be lit as well"


def test_trusted_warped_light_takes_over_and_still_adds_up() -> None:
    on = torch.tensor([True, True])
    ratio = torch.full((2, 3, 4, 4), 0.3)
    known = torch.ones(2, 1, 4, 4)
    known[1] = 0
    outputs = torch.zeros(2, MV_OUTPUTS, 4, 4)
    outputs[:, SV_OUTPUTS:] = 30.0
    fields = light_fields(outputs, on, unseen(2, 4), WarpedLight(ratio, known))
    torch.testing.assert_close(fields.fraction[1], torch.full((3, 4, 4), 0.3))
    torch.testing.assert_close(fields.fraction[2], torch.full((3, 4, 4), 1 / 3))
    torch.testing.assert_close(fields.fraction.sum(0), torch.ones(3, 4, 4))


def emitter_scene() -> tuple[torch.Tensor, torch.Tensor]:
    """A grey wall with two glowing squares, and their masks."""
    photo = torch.full((3, 64, 64), 0.2)
    masks = torch.zeros(2, 64, 64, dtype=torch.bool)
    masks[0, 10:20, 10:20] = True
    masks[1, 40:52, 40:52] = True
    photo[:, masks.any(0)] = 8.0
    return photo, masks


def test_no_lamp_lights_up_another_lamps_emitter() -> None:
    photo, masks = emitter_scene()
    on = torch.tensor([True, True])
    lights, ambient = 0.4 * photo.expand(2, -1, -1, -1), 0.2 * photo
    kept, rest = keep_out_of_emitters(lights, ambient, emitter_masks(photo, masks), on)
    assert kept[0][:, masks[1]].max() <= 0.4 * 0.2 + 1e-6
    assert kept[1][:, masks[0]].max() <= 0.4 * 0.2 + 1e-6
    torch.testing.assert_close(kept.sum(0) + rest, lights.sum(0) + ambient)


def test_a_lamp_that_is_off_takes_nothing_and_gives_nothing() -> None:
    photo, masks = emitter_scene()
    on = torch.tensor([True, False])
    lights, ambient = 0.4 * photo.expand(2, -1, -1, -1), 0.2 * photo
    kept, rest = keep_out_of_emitters(lights, ambient, emitter_masks(photo, masks), on)
    assert kept[1][:, masks[0]].max() <= 0.4 * 0.2 + 1e-6
    torch.testing.assert_close(kept[0] + rest, lights[0] + ambient)


def test_the_stand_of_a_fixture_is_no_emitter() -> None:
    photo, masks = emitter_scene()
    masks[0, 20:40, 14:16] = True
    assert not emitter_masks(photo, masks)[0, 20:40, 14:16].any()


@pytest.mark.parametrize("size", [(1, 1), (17, 400), (480, 640), (3000, 4000)])
def test_the_grid_fits_the_network_and_keeps_the_aspect(size: tuple[int, int]) -> None:
    height, width = grid_size(*size, 128, 16)
    assert height % 16 == 0
    assert width % 16 == 0
    assert max(height, width) == 128


def test_a_lamp_of_one_pixel_stays_visible_on_the_grid() -> None:
    masks = np.zeros((1, 512, 512), bool)
    masks[0, 300, 200] = True
    assert float(masks_to_grid(masks, (64, 64)).max()) > 0.5


def test_enlarged_lights_add_up_and_follow_the_photos_edge() -> None:
    photo = torch.full((3, 128, 128), 0.05)
    photo[:, :, 67:] = 2.0
    small = torch.nn.functional.interpolate(photo[None], (32, 32), mode="area")[0]
    lit = torch.nn.functional.interpolate((photo > 1)[None].float(), (32, 32), mode="area")[0]
    fraction = torch.stack([1 - 0.9 * lit, 0.9 * lit])
    fields = LightFields(fraction, torch.zeros(1, 3, 32, 32), torch.zeros(1, 3, 32, 32))
    lights, ambient = lights_at_full_size(
        fields,
        OnGrid(small, torch.zeros(1, 32, 32)),
        photo,
        torch.zeros(1, 128, 128, dtype=torch.bool),
        torch.tensor([True]),
    )
    torch.testing.assert_close(lights[0] + ambient, photo)
    full = (lights[0] / photo)[0, 64]
    plain = torch.nn.functional.interpolate(fraction, (128, 128), mode="bilinear")[1, 0, 64]
    step = full[67] - full[66]
    assert step > 2 * (plain[67] - plain[66]), "the guided filter restores the edge"


def test_a_chequerboard_in_the_ratio_does_not_show() -> None:
    outputs = torch.zeros(1, SV_OUTPUTS, 8, 8)
    outputs[:, 6:9, ::2, ::2] = 1
    outputs[:, 6:9, 1::2, 1::2] = 1
    ratio = light_fields(outputs, torch.tensor([False]), unseen(1, 8)).log_ratio
    torch.testing.assert_close(ratio[..., 1:-1, 1:-1], torch.full((1, 3, 6, 6), 0.5))
    outputs[:, 6:9] = 0.7
    level = light_fields(outputs, torch.tensor([False]), unseen(1, 8)).log_ratio
    torch.testing.assert_close(level, torch.full((1, 3, 8, 8), 0.7))


def test_a_lamp_switched_on_glows_to_the_edge_of_its_mask() -> None:
    photo, masks = torch.full((3, 64, 64), 0.2), torch.zeros(1, 64, 64)
    masks[:, 21:43, 21:43] = 1
    coverage = torch.nn.functional.interpolate(masks[None], (16, 16), mode="area")[0]
    outputs = torch.zeros(1, SV_OUTPUTS, 16, 16)
    outputs[:, 6:9] = torch.where(coverage > 0.5, 5.0, -1.0)
    on, small = torch.tensor([False]), OnGrid(photo[:, ::4, ::4], coverage)
    fields = light_fields(outputs, on, small)
    inside = masks[0] > 0
    light = lights_at_full_size(fields, small, photo, inside[None], on)[0][0]
    wall = 0.22 * np.exp(-1.0)
    torch.testing.assert_close(light[:, ~inside], torch.full_like(light[:, ~inside], wall))
    glow = wall * np.exp(GLOW)
    torch.testing.assert_close(light[:, inside], torch.full_like(light[:, inside], glow))

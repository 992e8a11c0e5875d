"""Lamps found in drawn rooms whose lamps are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import Camera
from luxcore.errors import LuxError
from luxcore.masks import agreement, propose_lamps, propose_photo
from luxcore.settings.masks import MasksSettings
from tests.masks.conftest import DrawnRoom, Globe, draw_capture

TWO = DrawnRoom((Globe((2.4, -1.0, 1.7)), Globe((1.8, 1.2, 2.2), radius=0.16)))


def _true(room: DrawnRoom, cameras: list[Camera]) -> list[dict[int, np.ndarray]]:
    views = [room.draw(camera)[1] for camera in cameras]
    return [
        {v: masks[lamp] for v, masks in enumerate(views) if masks[lamp].any()}
        for lamp in range(len(room.globes))
    ]


def test_two_lamps_and_no_window(tmp_path: Path, row_of_cameras: list[Camera]) -> None:
    capture = draw_capture(tmp_path / "c", TWO, row_of_cameras)
    lamps = propose_lamps(capture, MasksSettings())
    score = agreement([lamp.masks for lamp in lamps], _true(TWO, row_of_cameras))
    assert (score.recall, score.precision) == (1, 1)
    # The lamps are about 14 pixels wide: one pixel of outline is a quarter of their area.
    assert score.iou > 0.6
    for lamp in lamps:
        assert lamp.on
        assert len(lamp.masks) >= 5
        assert set(lamp.references) <= set(lamp.masks)
        assert len(lamp.references) == 3


def test_a_lamp_split_by_a_post_stays_one(tmp_path: Path, row_of_cameras: list[Camera]) -> None:
    room = DrawnRoom((Globe((2.2, 0.0, 1.6), radius=0.3),), post=True)
    capture = draw_capture(tmp_path / "c", room, row_of_cameras)
    lamps = propose_lamps(capture, MasksSettings())
    assert len(lamps) == 1
    score = agreement([lamps[0].masks], _true(room, row_of_cameras))
    assert score.iou > 0.75


def test_a_lamp_seen_by_some_views_only(tmp_path: Path, row_of_cameras: list[Camera]) -> None:
    room = DrawnRoom((Globe((2.6, -1.7, 1.5), radius=0.15),), window=False)
    cameras = [*row_of_cameras[:3], *(Camera(**{**vars(c), "cx": -60.0}) for c in row_of_cameras)]
    capture = draw_capture(tmp_path / "c", room, cameras)
    lamps = propose_lamps(capture, MasksSettings())
    true = _true(room, cameras)[0]
    assert len(lamps) == 1
    assert set(lamps[0].masks) <= set(true)


def test_a_room_without_lamps_says_so(tmp_path: Path, row_of_cameras: list[Camera]) -> None:
    capture = draw_capture(tmp_path / "c", DrawnRoom((), window=False), row_of_cameras)
    with pytest.raises(LuxError, match=r"no lamp was found in 6 views.*NNNN_LL\.png") as caught:
        propose_lamps(capture, MasksSettings())
    assert caught.value.exit_code == 1


def test_never_more_lamps_than_asked_for(tmp_path: Path, row_of_cameras: list[Camera]) -> None:
    capture = draw_capture(tmp_path / "c", TWO, row_of_cameras)
    assert len(propose_lamps(capture, MasksSettings(max_lamps=1))) == 1


def test_one_photo(row_of_cameras: list[Camera]) -> None:
    photo, masks = TWO.draw(row_of_cameras[3])
    found = propose_photo(photo)
    score = agreement([{0: m} for m in found], [{0: m} for m in masks])
    assert (score.recall, score.precision) == (1, 1)


@pytest.mark.parametrize("value", [0.0, 0.4, 1.0])
def test_a_plain_photo_has_no_lamp(value: float) -> None:
    with pytest.raises(LuxError, match="no lamp was found"):
        propose_photo(np.full((60, 80, 3), value, np.float32))


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (300, 1), (8, 8)])
def test_tiny_photos_do_not_crash(size: tuple[int, int]) -> None:
    photo = np.random.Generator(np.random.PCG64(0)).random((*size, 3), dtype=np.float32)
    with pytest.raises(LuxError, match="no lamp was found"):
        propose_photo(photo)


@pytest.mark.parametrize(
    ("photo", "masks", "least"),
    [
        ("introspectivedsgn-27703394/input.jpg", 3, 1.0),
    ],
)
def test_lamps_of_a_real_photo(shared_data: Path, photo: str, masks: int, least: float) -> None:
    """The authors' own masks of a garage: every lamp is found, and nothing else."""
    from luxcore.files.photos import read_mask, read_photo

    folder = (shared_data / "luxremix-site/static/demo/examples" / photo).parent
    image = read_photo(folder / "input.jpg")
    true = []
    for index in range(masks):
        mask = read_mask(folder / "mask" / f"mask_{index}.png")
        true.append({0: mask[: image.shape[0], : image.shape[1]]})
    found = propose_photo(image)
    score = agreement([{0: m} for m in found], true)
    assert score.recall >= least
    assert score.precision == 1

"""Masks on disk, from the truth and from the user; agreement and reference views."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from luxcore.cameras import Camera
from luxcore.capture import Capture, Points, View, write_capture
from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import write_json
from luxcore.files.exr import write_exr
from luxcore.files.photos import read_photo, write_png
from luxcore.light.agx import agx, agx_inverse
from luxcore.light.burning import burning_lamps
from luxcore.masks import agreement, find_lamps, load_masks
from luxcore.masks.references import best_views
from luxcore.settings.masks import MasksSettings
from tests.masks.conftest import DrawnRoom, Globe, draw_capture

ROOM = DrawnRoom((Globe((2.4, -1.0, 1.7)), Globe((1.8, 1.2, 2.2), radius=0.16)))


def _with_truth(folder: Path, cameras: list[Camera]) -> Capture:
    """A capture whose truth has three lamps, the second of which no view sees."""

    def truth(out: Path) -> None:
        for view, camera in enumerate(cameras):
            masks = ROOM.draw(camera)[1]
            empty = np.zeros_like(masks[0])
            layers = {}
            for light, mask in enumerate([masks[0], empty, masks[1]]):
                layers[f"fixture_{light:02d}"] = mask.astype(np.float32)
                layers[f"emitter_{light:02d}"] = mask.astype(np.float32)
            write_exr(out / f"{view:04d}.masks.exr", layers)
        lamps = [{"name": n, "on": n != "floor"} for n in ("desk", "closet", "floor")]
        write_json(out / "lights.json", {"lamps": lamps})

    views = [View(f"{i:04d}.png", ROOM.draw(c)[0], c) for i, c in enumerate(cameras)]
    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    return write_capture(
        folder, "t", views, points, source="rendered", metric=True, exposure=1.0, write_truth=truth
    )


def test_truth_lists_the_lamps_that_are_seen(tmp_path: Path, row_of_cameras) -> None:
    capture = _with_truth(tmp_path / "t", row_of_cameras[:3])
    masks = find_lamps(capture, tmp_path / "m", MasksSettings())
    assert [(lamp.name, lamp.on, lamp.truth_light) for lamp in masks.lamps] == [
        ("desk", True, 0),
        ("floor", False, 2),
    ]
    expected = ROOM.draw(row_of_cameras[1])[1][1]
    assert np.array_equal(masks.mask(1, 1), expected)
    assert masks.lamps[1].areas[1] == expected.sum()
    assert (tmp_path / "m" / "sheet.png").is_file()


def test_auto_ignores_the_truth(tmp_path: Path, row_of_cameras) -> None:
    capture = _with_truth(tmp_path / "t", row_of_cameras)
    masks = find_lamps(capture, tmp_path / "m", MasksSettings(source="auto"))
    assert [lamp.truth_light for lamp in masks.lamps] == [None, None]


def test_truth_that_is_not_there(tmp_path: Path, row_of_cameras) -> None:
    capture = draw_capture(tmp_path / "c", ROOM, row_of_cameras[:2])
    with pytest.raises(InputError, match="no truth"):
        find_lamps(capture, tmp_path / "m", MasksSettings(source="truth"))
    assert not (tmp_path / "m").exists()


@pytest.mark.parametrize("lamp", [{"on": "no"}, {}, "desk"])
def test_truth_that_does_not_say_which_lamps_burn(tmp_path: Path, row_of_cameras, lamp) -> None:
    capture = _with_truth(tmp_path / "t", row_of_cameras[:2])
    assert capture.truth is not None
    write_json(capture.truth / "lights.json", {"lamps": [lamp]})
    with pytest.raises(FormatError, match=r"lights\.json"):
        find_lamps(capture, tmp_path / "m", MasksSettings())


def test_the_users_masks_go_first(tmp_path: Path, row_of_cameras) -> None:
    capture = _with_truth(tmp_path / "t", row_of_cameras[:3])
    drawn = tmp_path / "drawn"
    lit = ROOM.draw(row_of_cameras[2])[1][0]
    dark = np.zeros_like(lit)
    dark[-30:, :40] = True
    write_png(drawn / "0002_01.png", lit)
    write_png(drawn / "0000_05.png", dark)
    masks = find_lamps(capture, tmp_path / "m", MasksSettings(), drawn)
    assert [(lamp.name, lamp.on) for lamp in masks.lamps] == [("lamp_0", True), ("lamp_1", False)]
    assert masks.lamps[0].references == (2,)
    assert masks.mask(0, 0) is None
    assert np.array_equal(masks.mask(0, 1), dark)


@pytest.mark.parametrize(("brighter", "on"), [(2.5, False), (4.0, True)])
def test_a_drawn_lamp_burns_where_decompose_says_so(
    tmp_path: Path, row_of_cameras, brighter: float, on: bool
) -> None:
    """In linear light: a pale shade of 2.5 times its room is 1.5 times as bright on display."""
    linear = np.full((240, 320, 3), 0.1, np.float32)
    mask = np.zeros((240, 320), bool)
    mask[100:140, 100:140] = True
    linear[mask] *= brighter
    points = Points(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    views = [View("0000.png", agx(linear), row_of_cameras[0])]
    capture = write_capture(tmp_path / "c", "c", views, points, source="test", metric=True)
    write_png(tmp_path / "d" / "0000_00.png", mask)
    masks = find_lamps(capture, tmp_path / "m", MasksSettings(), tmp_path / "d")
    assert masks.lamps[0].on is on
    photo = agx_inverse(read_photo(capture.frames[0].image_path))
    assert burning_lamps(photo, mask[None]).tolist() == [on]


@pytest.mark.parametrize(
    ("name", "shape", "fact"),
    [
        ("0000_00.png", (50, 40), r"0000_00\.png is 40x50, the photo is 320x240"),
        ("0009_00.png", (240, 320), "for view 9, the capture has 2 views"),
        ("lamp.png", (240, 320), "not named NNNN_LL"),
        ("0000_00.png", None, "empty mask"),
    ],
)
def test_masks_that_cannot_be_used(tmp_path: Path, row_of_cameras, name, shape, fact) -> None:
    capture = draw_capture(tmp_path / "c", ROOM, row_of_cameras[:2])
    write_png(tmp_path / "d" / name, np.ones(shape) if shape else np.zeros((240, 320)))
    with pytest.raises(InputError, match=fact):
        find_lamps(capture, tmp_path / "m", MasksSettings(), tmp_path / "d")
    assert not (tmp_path / "m").exists()


def test_a_folder_without_masks(tmp_path: Path, row_of_cameras) -> None:
    capture = draw_capture(tmp_path / "c", ROOM, row_of_cameras[:2])
    with pytest.raises(InputError, match="holds no masks"):
        find_lamps(capture, tmp_path / "m", MasksSettings(), tmp_path / "absent")


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda r: r[0].pop("on"), "list of lamps"),
        (lambda r: r[0].update(index=4), "must number its lamps"),
        (lambda r: r[0]["areas"].update({"1": 5}), r"0001_00\.png does not exist"),
    ],
)
def test_damaged_lists_are_named(tmp_path: Path, row_of_cameras, change, fact) -> None:
    capture = draw_capture(tmp_path / "c", ROOM, row_of_cameras[:2])
    write_png(tmp_path / "d" / "0000_00.png", ROOM.draw(row_of_cameras[0])[1][0])
    find_lamps(capture, tmp_path / "m", MasksSettings(), tmp_path / "d")
    path = tmp_path / "m" / "lamps.json"
    records = json.loads(path.read_text())
    change(records)
    path.write_text(json.dumps(records))
    with pytest.raises(FormatError, match=fact):
        load_masks(tmp_path / "m")


def _disc(x: int, y: int, r: int) -> np.ndarray:
    rows, columns = np.mgrid[0:60, 0:80]
    return (columns - x) ** 2 + (rows - y) ** 2 <= r * r


def test_best_views_are_large_whole_and_central() -> None:
    masks = {0: _disc(40, 30, 4), 3: _disc(40, 30, 9), 5: _disc(2, 2, 9), 7: _disc(40, 30, 9)}
    sharp = dict.fromkeys(masks, 1.0)
    assert best_views(masks, sharp, 3) == (3, 7, 0)
    assert best_views(masks, {**sharp, 3: 1e-3}, 1) == (7,)
    assert best_views({}, {}, 3) == ()


def test_agreement_counts() -> None:
    a, b = {0: _disc(20, 20, 5)}, {0: _disc(60, 40, 5)}
    half = {0: _disc(20, 20, 5) & (np.indices((60, 80))[1] >= 20)}
    assert agreement([a, b], [b, a]).iou == 1
    one = agreement([a], [a, b])
    assert (one.recall, one.precision, one.iou) == (0.5, 1.0, 1.0)
    assert agreement([half], [a]).iou == pytest.approx(half[0].sum() / a[0].sum())
    none = agreement([], [a])
    assert (none.recall, none.precision, none.iou) == (0, 1, 0)
    assert agreement([a], [b]).recall == 0

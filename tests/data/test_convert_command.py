"""`lux convert`: both ways on the command line, from shards without unpacking them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from click.testing import CliRunner

from luxcore.cli.convert import command
from luxcore.data.compact import as_taken, list_rendered, load_rendered, save_rendered
from luxcore.data.public_reader import open_scenes
from luxcore.errors import InputError, LuxError
from luxcore.files.photos import read_photo
from tests.data.analytic import panorama

PLACES = ((2.0, 2.2, 1.5), (3.0, 1.2, 1.4), (4.5, 3.0, 1.6))


@pytest.fixture
def views(tmp_path: Path) -> Path:
    """Two rooms: one seen from three places, one from a single one."""
    folder = tmp_path / "compact"
    for number, place in enumerate(PLACES):
        save_rendered(panorama(place, height=16), folder / f"{number:06d}")
    other = replace(panorama(PLACES[1], height=16), room="other")
    save_rendered(other, folder / "000003")
    return folder


def convert(*words: str | Path) -> None:
    result = CliRunner().invoke(command, [str(word) for word in words])
    if result.exception is not None:
        raise result.exception


def test_there_and_back_through_shards(views: Path, tmp_path: Path) -> None:
    public, back = tmp_path / "public", tmp_path / "back"
    convert(views, "--out", public, "--first-scene", "9", "--shards", "training")
    assert [p.name for p in sorted(public.iterdir())] == ["training-0000.tar", "training-0001.tar"]
    # The views of a scene are inferred from the names inside of the tar.
    assert [scene.views for scene in open_scenes(public)] == [[1, 2, 3], [1]]
    convert(public, "--out", back)
    assert [stem.name for stem in list_rendered(back)] == [
        "000009_1",
        "000009_2",
        "000009_3",
        "000010_1",
    ]
    for old, new in zip(list_rendered(views), list_rendered(back), strict=True):
        first, second = load_rendered(old), load_rendered(new)
        assert second.c2w == pytest.approx(first.c2w, abs=1e-6)
        # Background and mixes are stored in half precision.
        assert as_taken(second) == pytest.approx(as_taken(first), rel=2e-3, abs=1e-5)
        assert (second.on == first.on).all()
        assert np.array_equal(second.masks["emitter"], first.masks["emitter"])
    assert sorted(p.name for p in public.iterdir()) == ["training-0000.tar", "training-0001.tar"]


def test_rooms_become_photos_with_cameras_from_either_form(views: Path, tmp_path: Path) -> None:
    convert(views, "--out", tmp_path / "public")
    for form, rooms in (
        (views, ["box", "other"]),
        (tmp_path / "public", ["000000", "000001"]),
    ):
        out = tmp_path / f"photos of {form.name}"
        convert(form, "--out", out, "--photos", "3", "--photo-size", "24")
        assert sorted(p.name for p in out.iterdir()) == rooms
        for folder in out.iterdir():
            frames = json.loads((folder / "transforms.json").read_text())["frames"]
            assert [frame["file_path"] for frame in frames] == [
                f"images/000{i}.png" for i in range(3)
            ]
            assert read_photo(folder / "images" / "0002.png").shape == (24, 24, 3)
            assert len(pycolmap.Reconstruction(folder / "sparse" / "0").images) == 3


def test_a_folder_of_neither_form_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no scenes"):
        convert(tmp_path / "empty", "--out", tmp_path / "out")
    with pytest.raises(InputError, match="does not exist"):
        convert(tmp_path / "nowhere", "--out", tmp_path / "out")
    (tmp_path / "empty" / "000001").mkdir()
    for more in ([], ["--photos", "2"]):
        with pytest.raises(InputError, match="no views"):
            convert(tmp_path / "empty", "--out", tmp_path / "out", *more)
    assert not (tmp_path / "out").exists()


def test_scenes_of_the_same_name_are_not_replaced(tmp_path: Path) -> None:
    mine = tmp_path / "out" / "000000" / "mine.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("kept")
    call = CliRunner().invoke(command, [str(tmp_path), "--out", str(tmp_path / "out")])
    assert "which would be lost" in str(call.exception)
    assert mine.read_text() == "kept"


def test_a_room_that_is_damaged_is_left_out_whole_and_the_others_go_on(
    views: Path, tmp_path: Path
) -> None:
    public = tmp_path / "public"
    convert(views, "--out", public)
    (views / "000002.geometry.exr").write_bytes(b"damaged")
    for number, more in enumerate(([], ["--shards", "test"], ["--photos", "2"])):
        out = tmp_path / f"out {number}"
        call = CliRunner().invoke(command, [str(views), "--out", str(out), *more])
        assert type(call.exception) is LuxError
        assert "lacks box" in str(call.exception)
        assert "left out box: " in call.stderr
        assert "000002.geometry.exr" in call.stderr
        kept = [["000001"], ["test-0000.tar"], ["other"]][number]
        assert [p.name for p in out.iterdir()] == kept
    (public / "000000" / "1000.0003.rgb_bg.exr").write_bytes(b"damaged")
    out = tmp_path / "compact again"
    call = CliRunner().invoke(command, [str(public), "--out", str(out)])
    assert "lacks 000000" in str(call.exception)
    assert [stem.name for stem in list_rendered(out)] == ["000001_1"]
    assert len(list(out.iterdir())) == 4


def test_scene_numbers_have_six_digits(views: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="beyond six digits"):
        convert(views, "--out", tmp_path / "out", "--first-scene", "999999")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("room", ["../victim", "", "..", "a/b", "nul\0", "x" * 300])
def test_the_name_of_a_room_never_leads_out_of_the_folder(
    views: Path, tmp_path: Path, room: str
) -> None:
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim" / "mine.txt").write_text("kept")
    path = views / "000003.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "room": room}))
    out = tmp_path / "out"
    words = [str(views), "--out", str(out), "--photos", "2", "--photo-size", "16"]
    call = CliRunner().invoke(command, words)
    assert "cannot be a folder" in call.stderr
    assert [p.name for p in out.iterdir()] == ["box"]
    assert (tmp_path / "victim" / "mine.txt").read_text() == "kept"

"""The steps of a remix: which of them are done again, with every step's own work left out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from luxcore import remix as remixing
from luxcore.capture import load_capture
from luxcore.errors import InputError
from luxcore.settings.decompose import DecomposeSettings
from luxcore.settings.harmonize import HarmonizeSettings
from luxcore.settings.project import ProjectSettings
from tests.models.sketched import write_sketched_capture

Remix = Callable[[ProjectSettings], list[str]]


@pytest.fixture
def remix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Remix:
    """A remix whose steps write a line each; returns the names of those that ran."""
    ran: list[str] = []

    def writes(name: str, out_at: int) -> Callable[..., None]:
        def write(*arguments: object, **_: object) -> None:
            ran.append(name)
            (Path(str(arguments[out_at])) / "scene.json").write_text(name)

        return write

    places = {
        "ingest": 1, "find_lamps": 1, "fit_geometry": 1, "decompose_capture": 3,
        "harmonize_capture": 4, "fuse_capture": 2, "fit_lights": 4,
    }  # fmt: skip
    for name, out_at in places.items():
        monkeypatch.setattr(remixing, name, writes(name, out_at))
    capture = load_capture(write_sketched_capture(tmp_path / "room", 1)["capture"])
    monkeypatch.setattr(remixing, "load_capture", lambda _: capture)
    (tmp_path / "photos").mkdir()

    def run(settings: ProjectSettings) -> list[str]:
        ran.clear()
        remixing.remix(tmp_path / "photos", tmp_path / "out", settings, log=lambda _: None)
        return list(ran)

    return run


def test_other_bytes_under_the_name_of_the_weights_make_their_step_stale(
    remix: Remix, tmp_path: Path
) -> None:
    sv, mv = tmp_path / "sv.safetensors", tmp_path / "mv.safetensors"
    sv.write_text("one")
    mv.write_text("one")
    settings = ProjectSettings(
        decompose=DecomposeSettings(weights=str(sv)), harmonize=HarmonizeSettings(weights=str(mv))
    )
    assert len(remix(settings)) == 7
    assert remix(settings) == []
    mv.write_text("two")
    # What harmonize wrote is the same, so nothing after it is stale.
    assert remix(settings) == ["harmonize_capture"]
    sv.write_text("two")
    assert remix(settings) == ["decompose_capture"]


def test_a_folder_of_ones_own_is_no_earlier_result(remix: Remix, tmp_path: Path) -> None:
    mine = tmp_path / "out" / "work" / "notes.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with pytest.raises(InputError, match="not an earlier result"):
        remix(ProjectSettings())
    assert [p for p in (tmp_path / "out").rglob("*") if p.is_file()] == [mine]


def test_a_scene_among_the_photos_it_is_made_of_is_refused(tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    with pytest.raises(InputError, match="lies in"):
        remixing.remix(photos, photos / "scene", ProjectSettings())
    assert not any(photos.iterdir())


def test_nothing_is_left_where_no_step_ended(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "mine").mkdir()
    for out in (tmp_path / "new", tmp_path / "mine"):
        with pytest.raises(InputError):
            remixing.remix(tmp_path / "photos", out, ProjectSettings(), log=lambda _: None)
    assert not (tmp_path / "new").exists()
    assert not any((tmp_path / "mine").iterdir())

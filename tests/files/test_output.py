"""Folders that commands write: what an earlier call did not write is never lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from luxcore.errors import InputError
from luxcore.files.output import check_out_folder

NAMES = ("light_*.exr", "lights.json")


def test_new_and_earlier_results_may_be_written(tmp_path: Path) -> None:
    check_out_folder(tmp_path / "new" / "deeper", NAMES)
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    check_out_folder(earlier, NAMES)
    for name in ("light_00.exr", "light_07.exr", "lights.json"):
        (earlier / name).touch()
    check_out_folder(earlier, NAMES)


def test_anything_else_is_kept(tmp_path: Path) -> None:
    (tmp_path / "lights.json").touch()
    (tmp_path / "photo.jpg").touch()
    with pytest.raises(InputError, match=r"holds photo.jpg, which would be lost"):
        check_out_folder(tmp_path, NAMES)
    with pytest.raises(InputError, match="is a file"):
        check_out_folder(tmp_path / "photo.jpg", NAMES)


def test_without_its_mark_a_folder_is_somebody_elses(tmp_path: Path) -> None:
    (tmp_path / "light_00.exr").touch()
    with pytest.raises(InputError, match=r"holds light_00.exr"):
        check_out_folder(tmp_path, NAMES, mark="lights.json")
    (tmp_path / "lights.json").touch()
    check_out_folder(tmp_path, NAMES, mark="lights.json")


def test_the_folder_that_one_stands_in_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in (".", ".."):
        with pytest.raises(InputError, match="the folder that you are in"):
            check_out_folder(Path(name), NAMES)

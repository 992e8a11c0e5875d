"""Whatever keeps a file from being written, the sentence names the file that was asked for."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from luxcore.files.atomic import atomic_file, atomic_folder


def fail(*arguments: object) -> None:
    raise OSError(*arguments)


def test_a_name_that_is_taken_by_a_folder(tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    with pytest.raises(IsADirectoryError) as caught, atomic_file(tmp_path / "a.png") as temporary:
        temporary.write_text("new")
    assert caught.value.filename == str(tmp_path / "a.png")
    assert os.listdir(tmp_path) == ["a.png"]


@pytest.mark.parametrize("write", [atomic_file, atomic_folder])
def test_a_name_that_cannot_be_made(tmp_path: Path, write) -> None:
    path = tmp_path / ("a" * 300)
    with pytest.raises(OSError, match="too long") as caught, write(path):
        pass
    assert caught.value.filename == str(path)


def test_a_relative_name_stays_as_it_was_given(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OSError, match="full") as caught, atomic_file(Path("a.png")) as temporary:
        fail(errno.ENOSPC, "full", str(temporary))
    assert caught.value.filename == "a.png"


def test_a_full_disk_is_said_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="full") as caught, atomic_file(tmp_path / "a.png"):
        fail(errno.ENOSPC, "full")
    assert caught.value.filename == str(tmp_path / "a.png")


def test_a_file_in_a_new_folder_is_named_by_its_place(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with (
        pytest.raises(OSError, match="full") as caught,
        atomic_folder(out) as folder,
        atomic_file(folder / "deep" / "light.exr"),
    ):
        fail(errno.ENOSPC, "full")
    assert caught.value.filename == str(out / "deep" / "light.exr")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("arguments", [(errno.ENOENT, "gone", "other.png"), ("no number",)])
def test_failures_of_other_files_are_left_alone(tmp_path: Path, arguments: tuple) -> None:
    with pytest.raises(OSError, match=r"gone|no number") as caught, atomic_file(tmp_path / "a"):
        fail(*arguments)
    assert caught.value.filename == (arguments[2] if len(arguments) > 1 else None)
    assert caught.value.__cause__ is None

"""One JSON object out of a file, or one sentence that names the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from luxcore.errors import FormatError, InputError
from luxcore.files.json_object import read_object


def test_an_object_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"name": "Stehlampe é"}', encoding="utf-8")
    assert read_object(path) == {"name": "Stehlampe é"}


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b"[1]", b"3", b"null"])
def test_anything_else_is_a_format_error_naming_the_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.json") as caught:
        read_object(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_object(tmp_path / "a.json")
    with pytest.raises(InputError, match="is a folder"):
        read_object(tmp_path)

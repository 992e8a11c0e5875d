"""`python -m tasks STAGE`: what it says without a stage."""

from __future__ import annotations

import pytest

from tasks.__main__ import main
from tasks.context import STAGE_NAMES


def test_help_lists_the_stages_and_is_no_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in STAGE_NAMES)


@pytest.mark.parametrize("arguments", [[], ["rendr"], ["rooms", "render"]])
def test_no_stage_is_one_sentence_with_code_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert "one of rooms, " in capsys.readouterr().err

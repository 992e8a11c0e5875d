"""The recipe's command on two small panoramas: every kind of model, from the shipped weights."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from luxcore.data.compact import save_rendered
from luxcore.models.small.train import main
from luxcore.models.small.weights import load_network
from tests.data.analytic import panorama

SMALL = ("--base", "shipped", "--groups", "2", "--sketches", "0", "--size", "32",
         "--photos", "1", "--steps", "2")  # fmt: skip


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms")
    for number, origin in enumerate(((2.0, 2.0, 1.5), (3.5, 3.0, 1.4))):
        view = panorama(origin, 64, room=f"room{number}")
        save_rendered(view, folder / f"{number:06d}")
    return folder


@pytest.mark.parametrize("kind", ["geometry", "sv", "mv"])
def test_training_goes_on_from_the_shipped_weights(kind: str, rooms: Path, tmp_path: Path) -> None:
    out = tmp_path / kind
    result = CliRunner().invoke(main, [kind, "--data", str(rooms), "--out", str(out), *SMALL])
    assert result.exit_code == 0, result.output
    assert load_network(out / "model.safetensors", kind)
    assert [row["step"] for row in json.loads((out / "curve.json").read_text())] == [2.0]

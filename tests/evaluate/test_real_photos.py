"""Scores against what others published, on pictures made here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from luxcore.errors import InputError
from luxcore.evaluate.published import GRID_SIDE, read_published, real_photo_rows
from luxcore.evaluate.real_photos import main
from luxcore.files.exr import write_exr
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.models.interface import Decomposition

HEIGHT, WIDTH = 48, 64


def lamp_light(x: float) -> np.ndarray:
    """A round lamp at column x of a grey room."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] / WIDTH
    squared = (columns - x) ** 2 + (rows - 0.3) ** 2
    light = np.where(squared < 0.004, 40.0, 0.01 / (squared + 0.02))
    return np.repeat(light[..., None], 3, 2).astype(np.float32)


LAMPS = np.stack([lamp_light(0.25), lamp_light(0.75)])
AMBIENT = np.full((HEIGHT, WIDTH, 3), 0.05, np.float32)


@dataclass(frozen=True)
class Oracle:
    """Gives the true lamps, left one first."""

    name: str = "oracle"

    def decompose(self, image_linear, masks, on, geometry, seed):
        return Decomposition(AMBIENT, LAMPS, np.ones((len(masks), 3), np.float32))


@pytest.fixture
def published(tmp_path: Path) -> Path:
    folder = tmp_path / "olats" / "room"
    (folder / "mask").mkdir(parents=True)
    (folder / "ours").mkdir()
    write_png(folder / "input.png", agx(AMBIENT + LAMPS.sum(0)))
    for index, light in enumerate(LAMPS):
        mask = (light > 2).astype(np.float32)
        write_png(folder / "mask" / f"mask_{index}.png", mask)
        write_exr(folder / "ours" / f"olat_m{index:02d}.exr", {"rgb": light * 0.5})
    return folder


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    from PIL import Image

    folder = tmp_path / "grid"
    folder.mkdir()
    colours = np.linspace(0.4, 1.2, GRID_SIDE)
    for r in range(GRID_SIDE):
        for c in range(GRID_SIDE):
            light = AMBIENT + colours[r] * LAMPS[0] + colours[c] * LAMPS[1]
            shown = Image.fromarray(np.round(agx(light) * 255).astype(np.uint8))
            shown.save(folder / f"{r}_{c}.jpg", quality=98)
    return folder


def test_true_lamps_beat_the_copy_on_both(published: Path, grid: Path, tmp_path: Path) -> None:
    rows = real_photo_rows([published], grid, Oracle(), tmp_path)
    score = {(row.method, row.cases): row.scores["psnr"] for row in rows}
    assert score["oracle", "room"] > 60
    assert score["oracle", "room"] > score["copy the input", "room"]
    assert score["oracle", "LightLab grid"] > 30
    assert score["oracle", "LightLab grid"] > score["copy the input", "LightLab grid"] + 5
    assert {row.count for row in rows if row.cases == "LightLab grid"} == {36}
    assert (tmp_path / "olats_room.png").is_file()


def test_a_folder_without_all_parts_is_named(published: Path) -> None:
    (published / "ours" / "olat_m01.exr").unlink()
    with pytest.raises(InputError, match="as many masks as"):
        read_published(published)


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        main, ["--olats", str(tmp_path / "none"), "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 1
    assert "none" in result.output

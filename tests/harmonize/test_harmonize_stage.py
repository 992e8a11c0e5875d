"""The stage on a sketched room: whole, resumable pass by pass, and the same every time."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from luxcore.decompose.stage import decompose_capture, reference_views
from luxcore.decompose.store import read_light
from luxcore.errors import InputError, LuxError
from luxcore.files.exr import read_exr
from luxcore.files.photos import read_photo
from luxcore.harmonize import stage, unit
from luxcore.harmonize.stage import harmonize_capture
from luxcore.light.agx import agx
from luxcore.masks.store import Lamp, load_masks
from luxcore.models.interface import View
from luxcore.settings.decompose import DecomposeSettings
from luxcore.settings.harmonize import HarmonizeSettings
from luxcore.units import Unit, UnitStore
from luxcore.units import store as units_store
from tests.models.sketched import write_sketched_capture, write_tiny_weights

VIEWS = 6
SETTINGS = HarmonizeSettings(views_per_pass=4, options={"long_side_px": 32})


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A capture with its reference views decomposed by an untrained model."""
    root = tmp_path_factory.mktemp("room")
    sv, mv = write_tiny_weights(root)
    folders = write_sketched_capture(root, VIEWS, size_px=40)
    folders |= {"decompose": root / "decompose", "mv": mv}
    decompose_capture(
        folders["capture"],
        folders["masks"],
        folders["splat"],
        folders["decompose"],
        DecomposeSettings(options={"long_side_px": 32}),
        weights=sv,
    )
    return folders


def harmonize(room: dict[str, Path], out: Path, store: Path) -> dict[str, float]:
    return harmonize_capture(
        room["capture"],
        room["masks"],
        room["splat"],
        room["decompose"],
        out,
        SETTINGS,
        UnitStore(store),
        weights=room["mv"],
    )


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_references_are_decomposed_and_add_up(room: dict[str, Path]) -> None:
    index = json.loads((room["decompose"] / "decompose.json").read_text())
    lamps = load_masks(room["masks"]).lamps
    assert len(index["references"]) == len(lamps)
    view = index["references"][0][0]
    stored = read_light(room["decompose"] / f"{view:04d}")
    photo = read_photo(room["capture"] / "images" / f"{view:04d}.png")
    error = np.mean((agx(stored.light.recomposed()) - photo) ** 2)
    assert -10 * np.log10(error) > 35
    assert stored.on.tolist() == [lamp.on and view in lamp.areas for lamp in lamps]


def test_every_view_gets_all_lights_and_three_exposures(
    room: dict[str, Path], tmp_path: Path
) -> None:
    metrics = harmonize(room, tmp_path / "out", tmp_path / "store")
    lamps = len(load_masks(room["masks"]).lamps)
    names = {p.name for p in (tmp_path / "out" / "brackets").iterdir()}
    expected = {
        f"{view:04d}_{light}_ev{stops}.png"
        for view in range(VIEWS)
        for light in ["ambient", *(f"{k:02d}" for k in range(lamps))]
        for stops in (0, 2, 4)
    }
    assert names == expected
    assert metrics["passes"] == len(
        json.loads((tmp_path / "out/passes.json").read_text())["passes"]
    )
    assert metrics["passes"] >= 2
    layers = read_exr(tmp_path / "out" / "direct" / "0003.exr")
    bracket = read_photo(tmp_path / "out" / "brackets" / "0003_00_ev2.png")
    expected_picture = agx(layers["light_00"] * np.float32(0.25))
    # Half precision in the EXR and 8 bits in the PNG: about one grey level apart.
    assert np.abs(bracket - expected_picture).max() < 1.5 / 255


def test_a_kill_in_the_second_pass_resumes_there_and_ends_in_the_same_bytes(
    room: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    harmonize(room, tmp_path / "whole", tmp_path / "other")
    write_target: Callable = unit.write_target
    written: list[int] = []

    def broken(out_dir: Path, index: int, light: object, exposure: float) -> None:
        written.append(index)
        if len(written) == 4:
            raise LuxError("killed here")
        write_target(out_dir, index, light, exposure)

    monkeypatch.setattr(unit, "write_target", broken)
    with pytest.raises(LuxError, match="killed here"):
        harmonize(room, tmp_path / "out", tmp_path / "store")
    assert not (tmp_path / "out" / "passes.json").exists()
    written.clear()
    monkeypatch.setattr(
        unit, "write_target", lambda *a: (written.append(a[1]), write_target(*a))[1]
    )
    harmonize(room, tmp_path / "out", tmp_path / "store")
    assert len(written) == VIEWS - 3, "the three views of the first pass are kept"
    assert files(tmp_path / "out") == files(tmp_path / "whole")


def test_a_changed_mask_makes_the_passes_stale(room: dict[str, Path], tmp_path: Path) -> None:
    changed = dict(room)
    changed["masks"] = tmp_path / "masks"
    shutil.copytree(room["masks"], changed["masks"])
    harmonize(room, tmp_path / "a", tmp_path / "store")
    before = len(list((tmp_path / "store").rglob("manifest.json")))
    png = next(changed["masks"].glob("*.png"))
    from luxcore.files.photos import read_mask, write_png

    write_png(png, np.roll(read_mask(png), 1, axis=1))
    harmonize(changed, tmp_path / "b", tmp_path / "store")
    assert len(list((tmp_path / "store").rglob("manifest.json"))) > before


def test_a_capture_without_decomposed_references_says_so(
    room: dict[str, Path], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"decompose\.json does not exist"):
        harmonize({**room, "decompose": tmp_path}, tmp_path / "out", tmp_path / "store")


def test_lamps_share_a_reference_view_where_they_can() -> None:
    def lamp(index: int, *references: int) -> Lamp:
        return Lamp(index, f"lamp_{index}", True, references, dict.fromkeys(references, 10))

    assert reference_views([lamp(0, 4, 2), lamp(1, 2, 4)], 1) == [[4], [4]]
    assert reference_views([lamp(0, 4), lamp(1, 2, 3)], 1) == [[4], [2]]
    assert reference_views([lamp(0, 4, 2), lamp(1, 3, 2)], 2) == [[4, 2], [2, 3]]


def test_more_views_than_a_pass_holds_are_refused(room: dict[str, Path]) -> None:
    from luxcore.models.backends import open_harmonizer
    from luxcore.models.interface import BackendSettings

    harmonizer = open_harmonizer("small", BackendSettings(mv_weights=str(room["mv"])))
    view = View(
        np.zeros((32, 32, 3), np.float32), np.zeros((0, 32, 32), bool), np.zeros(0, bool), None
    )
    assert len(harmonizer.run_pass([view] * 15, [], 0)) == 15
    with pytest.raises(InputError, match="at most 15 views"):
        harmonizer.run_pass([view] * 16, [], 0)


class KeyFoundError(Exception):
    """Ends a run once the key of its first pass is known."""


KeyOf = Callable[[HarmonizeSettings], str]


@pytest.fixture
def key_of(room: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KeyOf:
    """The key of the first pass with given settings; nothing is computed."""
    found: list[str] = []

    def only_key(units: Sequence[Unit], *_: object, **__: object) -> None:
        found.append(units[0].key)
        raise KeyFoundError

    def key(settings: HarmonizeSettings) -> str:
        folders = (room[name] for name in ("capture", "masks", "splat", "decompose"))
        with pytest.raises(KeyFoundError):
            harmonize_capture(*folders, tmp_path / "out", settings, UnitStore(tmp_path / "store"))
        return found.pop()

    monkeypatch.setattr(stage, "run_units", only_key)
    return key


@pytest.mark.parametrize(
    "changed",
    [
        "luxcore/harmonize/unit.py",
        "luxcore/models/interface.py",
        "luxcore/models/backends.py",
        "luxcore/models/small/heads.py",
        "luxcore/models/multiview_unet/backend.py",
        "luxcore/models/diffusion/brackets.py",
        "luxcore/models/weights/mv.safetensors",
        "luxcore/decompose/views.py",
        "luxcore/capture/store.py",
        "luxcore/masks/store.py",
        "luxcore/files/exr.py",
        "luxcore/cameras.py",
    ],
)
def test_a_pass_is_stale_once_its_code_changes(
    key_of: KeyOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    project = Path(stage.__file__).resolve().parents[2]
    assert (project / changed).is_file()
    copied = tmp_path / "project"
    for path in stage.CODE:
        if path.endswith(".py"):
            write_text(copied / path, "")
        else:
            (copied / path).mkdir(parents=True)
    write_text(copied / changed, "before")
    monkeypatch.setattr(units_store, "_PROJECT", copied)
    before = key_of(SETTINGS)
    assert key_of(SETTINGS) == before
    write_text(copied / changed, "after")
    assert key_of(SETTINGS) != before


def test_passes_with_other_weights_have_other_keys(
    room: dict[str, Path], key_of: KeyOf, tmp_path: Path
) -> None:
    copied = Path(shutil.copyfile(room["mv"], tmp_path / "copied.safetensors"))
    weights = [None, "somebody/light", "somebody/light-2", str(copied)]
    keys = [key_of(SETTINGS.model_copy(update={"weights": name})) for name in weights]
    assert len(set(keys)) == len(weights)
    # Local weights are what they hold, not where they lie; other bytes under one name are others.
    assert key_of(SETTINGS.model_copy(update={"weights": str(room["mv"])})) == keys[-1]
    copied.write_bytes(b"other")
    assert key_of(SETTINGS.model_copy(update={"weights": str(copied)})) != keys[-1]


def write_text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)

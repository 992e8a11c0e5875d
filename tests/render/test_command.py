"""`lux render`, the stages' batch, the disk check."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from click.testing import CliRunner

from luxcore.cli.render import command
from luxcore.data.compact import list_rendered, load_rendered
from luxcore.data.public_reader import public_views
from luxcore.errors import InputError, LuxError
from luxcore.render import dataset, public
from luxcore.render.dataset import (
    check_disk,
    demo_jobs,
    estimated_bytes,
    panorama_jobs,
    render_dataset,
    run_jobs,
)
from luxcore.rooms import generate_room
from luxcore.rooms.batch import demo_room, write_rooms
from luxcore.settings.render import RenderSettings
from luxcore.settings.rooms import RoomsSettings
from luxcore.units import UnitStore
from luxcore.units.executor import SerialExecutor

TINY = RenderSettings(
    height=16, spp=1, demo_views=2, demo_width=32, demo_height=32, demo_spp=1, denoise="off"
)


class Usage(NamedTuple):
    """What shutil.disk_usage returns."""

    total: int
    used: int
    free: int


@pytest.mark.blender
def test_stage_renders_all_splits_and_resumes(tmp_path: Path) -> None:
    write_rooms(tmp_path / "rooms", RoomsSettings(train=1, test=1))
    store = UnitStore(tmp_path / "units")

    def run(name: str) -> dict[str, float]:
        return render_dataset(tmp_path / "rooms", tmp_path / name, TINY, store, SerialExecutor())

    metrics = run("first")
    assert metrics["views"] == 4
    assert metrics["failed"] == 0
    found = [str(p.relative_to(tmp_path / "first")) for p in list_rendered(tmp_path / "first")]
    assert found == ["demo/views/0000", "demo/views/0001", "test/000000", "train/000000"]
    assert load_rendered(tmp_path / "first" / "train" / "000000").kind == "panorama"
    assert load_rendered(tmp_path / "first" / "demo" / "views" / "0001").kind == "perspective"
    # All units are there: nothing is rendered, and the bytes are the same.
    assert run("second") == metrics
    one, two = (tmp_path / n / "train" / "000000.exr" for n in ("first", "second"))
    assert one.read_bytes() == two.read_bytes()


@pytest.mark.blender
def test_command_writes_the_public_layout(tmp_path: Path) -> None:
    out = tmp_path / "set"
    arguments = ["--rooms", "1", "--seed", "11", "--size", "32x16", "--spp", "1", "--views", "1"]
    result = CliRunner(env={"LUX_EXECUTOR": "serial"}).invoke(
        command, [*arguments, "--out", str(out), "--json"]
    )
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout.splitlines()[-1])
    assert answer == {"scenes": ["000011"], "views": 1, "failed": {}}
    names = {"000011", "contact_sheet.png", "statistics", "statistics.html"}
    assert {p.name for p in out.iterdir()} == names
    assert [view.room for view in public_views(out / "000011")] == ["000011"]
    statistics = json.loads((out / "statistics" / "000011.json").read_text())
    lamps = statistics["views"][0]["lamps"]
    assert len(lamps) == len(generate_room(11, RoomsSettings()).lamps)
    assert statistics["views"][0]["effects"]["diffuse"]["amount"] == 8
    steps = {"build", "render", "denoise", "top_up", "write"}
    assert set(statistics["views"][0]["seconds"]) == steps
    assert "CPU seconds by step" in (out / "statistics.html").read_text()


@pytest.mark.blender
def test_every_shard_has_a_page(tmp_path: Path) -> None:
    out = tmp_path / "set"
    arguments = ["--rooms", "2", "--seed", "19", "--size", "32x16", "--spp", "1", "--views", "1"]
    result = CliRunner(env={"LUX_EXECUTOR": "serial"}).invoke(
        command, [*arguments, "--out", str(out), "--shards", "training"]
    )
    assert result.exit_code == 0, result.output
    shards = {f"training-000{n}.{kind}" for n in (0, 1) for kind in ("tar", "html")}
    names = {"contact_sheet.png", "statistics", "statistics.html"}
    assert {p.name for p in out.iterdir()} == names | shards
    assert "<dt>rooms</dt><dd>1</dd>" in (out / "training-0001.html").read_text()
    assert "<dt>rooms</dt><dd>2</dd>" in (out / "statistics.html").read_text()


@pytest.mark.blender
def test_a_room_that_fails_is_set_aside_and_the_rest_goes_on(tmp_path: Path) -> None:
    good = generate_room(19, RoomsSettings())
    broken = replace(good, seed=20, materials={})
    settings = TINY.model_copy(update={"max_failed_ratio": 0.5})
    jobs = panorama_jobs([broken, good], settings, "train")
    store = UnitStore(tmp_path / "units")
    failed = run_jobs(jobs, tmp_path / "out", settings, store, SerialExecutor())
    assert list(failed) == ["train/000000"]
    assert "KeyError" in failed["train/000000"]
    assert [p.name for p in list_rendered(tmp_path / "out")] == ["000001"]
    (line,) = (store.root / "quarantine.jsonl").read_text().splitlines()
    assert json.loads(line) == {"unit": "train/000000", "reason": failed["train/000000"]}
    strict = TINY.model_copy(update={"max_failed_ratio": 0.4})
    with pytest.raises(LuxError, match="1 of 2 views failed: train/000000"):
        run_jobs(jobs, tmp_path / "strict", strict, store, SerialExecutor())


@pytest.mark.parametrize(
    ("taken", "fact"),
    [
        ("000011/mine.txt", "holds mine.txt"),
        ("000011", "000011 is a file"),
        ("work/mine.txt", "holds mine.txt"),
        ("training-0000.tar", "training-0000.tar was not written by this program"),
    ],
)
def test_what_is_not_ours_is_refused_before_any_rendering(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: str, fact: str
) -> None:
    def render(*_: object) -> None:
        pytest.fail("a view was rendered")

    monkeypatch.setattr(public, "run_jobs", render)
    mine = tmp_path / "set" / taken
    mine.parent.mkdir(parents=True)
    mine.write_text("kept")
    arguments = ["--rooms", "2", "--seed", "10", "--shards", "training"]
    result = CliRunner().invoke(command, [*arguments, "--out", str(tmp_path / "set")])
    assert isinstance(result.exception, InputError)
    assert fact in str(result.exception)
    assert [p for p in (tmp_path / "set").rglob("*") if p.is_file()] == [mine]
    assert mine.read_text() == "kept"


@pytest.mark.blender
def test_rendering_again_replaces_what_it_wrote(tmp_path: Path) -> None:
    out = tmp_path / "set"
    arguments = ["--rooms", "1", "--seed", "11", "--size", "32x16", "--spp", "1", "--views", "1"]
    for more in ([], [], ["--shards", "training"], ["--shards", "training"]):
        result = CliRunner(env={"LUX_EXECUTOR": "serial"}).invoke(
            command, [*arguments, *more, "--out", str(out)]
        )
        assert result.exit_code == 0, result.output
    assert (out / "training-0000.tar").is_file()


@pytest.mark.parametrize("size", ["64x33", "64", "axb", "16x8", "x", "-64x-32"])
def test_sizes_that_are_no_panorama(tmp_path: Path, size: str) -> None:
    result = CliRunner(env={"LUX_EXECUTOR": "serial"}).invoke(
        command, ["--rooms", "1", f"--size={size}", "--out", str(tmp_path / "o")]
    )
    assert isinstance(result.exception, InputError)
    assert "--size" in str(result.exception)
    assert not (tmp_path / "o").exists()


def test_a_full_disk_is_known_before_the_first_render(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs = panorama_jobs([generate_room(0, RoomsSettings())], TINY, "train")
    spare = dataset.SPARE_BYTES + estimated_bytes(jobs)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, spare))
    check_disk(jobs, tmp_path / "not" / "yet")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, spare - 1))
    with pytest.raises(LuxError, match="views need about"):
        check_disk(jobs, tmp_path / "not" / "yet")
    check_disk([], tmp_path)


def test_keys_follow_what_changes_pixels_and_nothing_else() -> None:
    room = generate_room(0, RoomsSettings())

    def keys(settings: RenderSettings) -> list[str]:
        return [job.unit.key for job in panorama_jobs([room], settings, "train")]

    base = keys(TINY)
    assert keys(TINY.model_copy(update={"timeout_s": 5.0, "max_failed_ratio": 1.0})) == base
    for change in ({"spp": 2}, {"height": 18}, {"denoise": "fast"}, {"top_up_noise": 9.0}):
        assert keys(TINY.model_copy(update=change)) != base
    assert len(set(keys(TINY.model_copy(update={"views_per_room": 4})))) == len(room.viewpoints)


def test_fewer_views_where_fewer_fit() -> None:
    four = TINY.model_copy(update={"views_per_room": 4})
    for seed in range(6):
        room = generate_room(seed, RoomsSettings())
        assert 1 <= len(panorama_jobs([room], four, "train")) == len(room.viewpoints) <= 4


def test_demo_is_a_numbered_walk() -> None:
    jobs = demo_jobs(demo_room(RoomsSettings()), TINY)
    assert [job.stem for job in jobs] == ["demo/views/0000", "demo/views/0001"]

"""Fronts, defaults, advice and pages, on measurements that were made up and on a knob that runs."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from luxcore.cli.tradeoff import command
from luxcore.errors import FormatError, InputError
from luxcore.settings.project import ProjectSettings
from luxcore.tradeoff.advise import parse_budget, with_quality, within_budget
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs import KNOBS
from luxcore.tradeoff.page import write_tradeoffs
from luxcore.tradeoff.sweep import (
    Point,
    Sweep,
    dominating,
    front,
    load_sweeps,
    measure,
    merged,
    save_sweeps,
)

ABOUT = {"scene": "capture demo", "machine": "2 cores"}


def point(label: str, seconds: float, error: float, spread: float = 0.0) -> Point:
    """Three repeats around a median."""
    works = tuple(Work(seconds * (1 + d), seconds, error * (1 + d)) for d in (-spread, 0.0, spread))
    return Point(label, {f"splat.{label}": seconds}, works)


def sweep(default: str, *points: Point, name: str = "iterations") -> Sweep:
    return Sweep(name, "RMS error", "because", default, points)


KNEE = sweep("b", point("a", 1.0, 0.2), point("b", 2.0, 0.1), point("c", 8.0, 0.09))


def test_the_front_holds_what_nothing_beats() -> None:
    points = (point("slow", 4.0, 0.1), point("fast", 1.0, 0.3), point("bad", 4.0, 0.3))
    assert [p.label for p in front(points)] == ["fast", "slow"]


def test_a_default_on_the_front_is_not_beaten() -> None:
    assert dominating(KNEE) == []


def test_a_beaten_default_is_found() -> None:
    beaten = sweep("bad", point("bad", 3.0, 0.3, 0.1), point("good", 2.0, 0.2, 0.1))
    assert [p.label for p in dominating(beaten)] == ["good"]


@pytest.mark.parametrize(("seconds", "error"), [(2.6, 0.2), (2.0, 0.28)])
def test_a_difference_within_the_spread_beats_nothing(seconds: float, error: float) -> None:
    close = sweep("bad", point("bad", 3.0, 0.3, 0.1), point("good", seconds, error, 0.1))
    assert dominating(close) == []


def test_measurements_take_turns_after_a_run_that_does_not_count() -> None:
    order: list[str] = []

    def run(prepared: str, choice: Choice, repeat: int) -> Work:
        order.append(f"{choice.label}{repeat}")
        assert prepared == "ready"
        return Work(1.0, 1.0, 0.5)

    choices = (
        Choice("x", {"splat.iterations": ProjectSettings().splat.iterations}),
        Choice("y", {"splat.iterations": 5}),
    )
    knob = Knob("k", choices, "error", "why", lambda bench: "ready", run)
    bench = Bench(Path("none"), Path("none"), ProjectSettings(), "demo")
    measured = measure(knob, bench, 2, quiet=True)
    assert order[1:] == ["x0", "y0", "x1", "y1"]
    assert measured.default == "x"
    assert [len(p.works) for p in measured.points] == [2, 2]


def test_every_knob_measures_its_own_default() -> None:
    for knob in KNOBS:
        assert knob.default(ProjectSettings()) in {c.label for c in knob.choices}, knob.name


def test_the_stopwatch_counts_work_and_not_waiting() -> None:
    with stopwatch() as watch:
        time.sleep(0.3)
    assert watch.wall_s >= 0.3
    assert watch.cpu_s < 0.15


def test_a_budget_buys_what_helps_most_per_second() -> None:
    other = sweep("q", point("p", 1.0, 0.2), point("q", 5.0, 0.19), name="samples")
    advice = within_budget([KNEE, other], 4.0)
    assert {name: p.label for name, p in advice.chosen.items()} == {
        "iterations": "b",
        "samples": "p",
    }
    assert advice.seconds == pytest.approx(3.0)
    assert within_budget([KNEE, other], 100.0).seconds == pytest.approx(13.0)
    assert advice.settings == {"splat.b": 2.0, "splat.p": 1.0}


def test_a_budget_that_is_too_small_says_what_would_do() -> None:
    with pytest.raises(InputError, match=r"the least is 1\.0 s"):
        within_budget([KNEE], 0.5)


def test_quality_takes_the_ends_of_the_front_or_the_default() -> None:
    for quality, label in (("low", "a"), ("default", "b"), ("high", "c")):
        assert with_quality([KNEE], quality).chosen["iterations"].label == label


@pytest.mark.parametrize(
    ("text", "seconds"), [("90s", 90), ("2min", 120), ("1.5 h", 5400), ("30", 30)]
)
def test_budgets_have_units(text: str, seconds: float) -> None:
    assert parse_budget(text) == seconds


@pytest.mark.parametrize("text", ["", "soon", "-2min", "2 days"])
def test_a_budget_that_is_no_time_is_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match="is not a time"):
        parse_budget(text)


def test_measurements_come_back_from_disk_and_the_page_marks_the_default(tmp_path: Path) -> None:
    beaten = sweep("bad", point("bad", 3.0, 0.3), point("good", 2.0, 0.0), name="broken <knob>")
    page = write_tradeoffs(tmp_path, [KNEE, beaten], ABOUT).read_text()
    loaded, about = load_sweeps(tmp_path / "tradeoff.json")
    assert loaded == [KNEE, beaten]
    assert about == ABOUT
    assert '<tr class="default"><td>b</td>' in page
    assert "broken &lt;knob&gt;" in page
    assert "beaten in time and in error by good" in page
    assert (tmp_path / "tradeoff-01.svg").stat().st_size > 1000


def test_knobs_measured_before_are_kept_unless_measured_on_something_else(tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    other = sweep("p", point("p", 1.0, 0.2), name="samples")
    assert merged(path, [KNEE], ABOUT, ["samples", "iterations"]) == [KNEE]
    save_sweeps(path, [KNEE, other], ABOUT)
    again = sweep("p", point("p", 2.0, 0.1), name="samples")
    assert merged(path, [again], ABOUT, ["samples", "iterations"]) == [again, KNEE]
    elsewhere = {**ABOUT, "scene": "capture attic"}
    assert merged(path, [again], elsewhere, ["samples", "iterations"]) == [again]


def test_a_sweep_of_another_version_is_one_sentence(tmp_path: Path) -> None:
    save_sweeps(tmp_path / "t.json", [KNEE], ABOUT)
    text = (tmp_path / "t.json").read_text()
    (tmp_path / "t.json").write_text(text.replace('"version": 1', '"version": 9'))
    with pytest.raises(FormatError, match="version 9"):
        load_sweeps(tmp_path / "t.json")
    (tmp_path / "t.json").write_text("{}")
    with pytest.raises(FormatError, match="does not hold sweeps"):
        load_sweeps(tmp_path / "t.json")


def test_the_command_chooses_and_says_what_to_expect(tmp_path: Path) -> None:
    save_sweeps(tmp_path / "tradeoff.json", [KNEE], ABOUT)
    chosen = CliRunner().invoke(command, ["--out", str(tmp_path), "--budget", "3s"])
    assert chosen.exit_code == 0, chosen.output
    assert "expected on capture demo: 2.0 processor seconds" in chosen.output
    assert "splat.b: 2.0" in chosen.output
    missing = CliRunner().invoke(command, ["--out", str(tmp_path / "no"), "--quality", "high"])
    assert "`lux tradeoff` measures it" in str(missing.exception)


def test_no_default_is_beaten_in_the_measurements_that_are_kept(project_root: Path) -> None:
    kept = project_root / "docs" / "tradeoff" / "tradeoff.json"
    if not kept.is_file():
        pytest.skip(f"{kept} is not there: copy it from `lux tradeoff --out docs/tradeoff`")
    sweeps, _ = load_sweeps(kept)
    for measured in sweeps:
        assert dominating(measured) == [], measured.knob

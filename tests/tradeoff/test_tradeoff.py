"""Fronts, defaults, advice and pages, on measurements that were made up and on a knob that runs."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from luxcore.cli.tradeoff import command
from luxcore.errors import FormatError, InputError
from luxcore.settings.project import ProjectSettings
from luxcore.tradeoff.advise import Quality, parse_budget, try_out, with_quality, within_budget
from luxcore.tradeoff.knob import Bench, Choice, Knob, Work, stopwatch
from luxcore.tradeoff.knobs import KNOBS
from luxcore.tradeoff.page import write_tradeoffs
from luxcore.tradeoff.store import (
    Measured,
    load_measured,
    merged,
    save_measured,
    with_trial,
)
from luxcore.tradeoff.sweep import Point, Sweep, dominating, front, measure

ABOUT = {"machine": "2 cores"}


def point(label: str, seconds: float, error: float, spread: float = 0.0) -> Point:
    """Three repeats around a median."""
    works = tuple(Work(seconds * (1 + d), seconds, error * (1 + d)) for d in (-spread, 0.0, spread))
    return Point(label, {f"splat.{label}": seconds}, works)


def sweep(
    default: str,
    *points: Point,
    name: str = "iterations",
    work: str = "fit",
    scene: str = "demo",
) -> Sweep:
    return Sweep(scene, name, work, "RMS error", "because", default, points)


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
    knob = Knob("k", "fit", choices, "error", "why", lambda bench: "ready", run)
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
    other = sweep("p", point("p", 1.0, 0.2), point("q", 5.0, 0.19), name="samples", work="render")
    advice = within_budget([KNEE, other], 4.0)
    assert {name: p.label for name, p in advice.chosen.items()} == {
        "iterations": "b",
        "samples": "p",
    }
    assert advice.seconds == pytest.approx(3.0)
    assert within_budget([KNEE, other], 100.0).seconds == pytest.approx(13.0)
    assert advice.settings == {"splat.b": 2.0, "splat.p": 1.0}


def test_knobs_of_one_work_are_expected_to_multiply() -> None:
    finer = sweep("m", point("m", 3.0, 0.4), point("n", 6.0, 0.1), name="Gaussians")
    (expected,) = with_quality([KNEE, finer], "high").works
    # Four times the default's seconds for c, twice for n; errors 0.9 and 0.25 of the default's.
    assert expected.seconds == pytest.approx(2.0 * 4.0 * 2.0)
    assert expected.error == pytest.approx(0.1 * 0.9 * 0.25)
    assert expected.labels == {"iterations": "c", "Gaussians": "n"}
    assert within_budget([KNEE, finer], 4.0).seconds <= 4.0


def test_two_knobs_never_want_different_values_of_one_setting() -> None:
    def passes(label: str, seconds: float, error: float, settings: dict[str, int]) -> Point:
        return Point(label, settings, (Work(seconds, seconds, error),))

    views = sweep("15", passes("15", 1.0, 0.2, {"views": 15}), passes("4", 2.0, 0.1, {"views": 4}))
    references = sweep(
        "1",
        passes("1", 1.0, 0.2, {"references": 1}),
        passes("3", 2.0, 0.1, {"references": 3, "views": 15}),
        name="references",
    )
    high = with_quality([views, references], "high")
    assert high.settings == {"views": 4, "references": 1}
    assert within_budget([views, references], 100.0).agrees


def test_what_params_yaml_does_not_have_is_not_advised() -> None:
    built_in = Point("x", {}, (Work(50.0, 50.0, 0.1),))
    advice = with_quality([KNEE, sweep("x", built_in, name="cut-off")], "high")
    assert set(advice.chosen) == {"iterations"}


def test_advice_that_is_tried_is_kept_beside_the_sweeps(tmp_path: Path) -> None:
    asked: list[dict] = []

    def run(prepared: str, choice: Choice, repeat: int) -> Work:
        asked.append(choice.settings)
        return Work(5.0, 6.0, 0.07)

    knob = Knob("iterations", "fit", (Choice("a", {}),), "e", "w", lambda bench: "ready", run)
    bench = Bench(Path("none"), tmp_path, ProjectSettings(), "demo")
    trial = try_out(with_quality([KNEE], "high"), "--quality high", [knob], bench)
    assert asked[-1] == {"splat.c": 8.0}
    assert (trial.expected_s, trial.obtained_s) == (8.0, 5.0)
    measured = with_trial(with_trial(Measured(ABOUT, (KNEE,)), trial), trial)
    page = write_tradeoffs(tmp_path, measured).read_text()
    assert "--quality high on demo: 8.0 s expected, 5.0 s obtained" in page
    assert load_measured(tmp_path / "tradeoff.json").trials == (trial,)
    # New measurements make the old promise void.
    assert merged(tmp_path / "tradeoff.json", [KNEE], ABOUT, ["iterations"]).trials == ()


def test_a_budget_that_is_too_small_says_what_would_do() -> None:
    with pytest.raises(InputError, match=r"the least is 1\.0 s"):
        within_budget([KNEE], 0.5)


def test_quality_takes_the_ends_of_the_front_or_the_default() -> None:
    ends: dict[Quality, str] = {"low": "a", "default": "b", "high": "c"}
    for quality, label in ends.items():
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
    (tmp_path / "a-knob-of-old.svg").write_text("<svg/>")
    page = write_tradeoffs(tmp_path, Measured(ABOUT, (KNEE, beaten))).read_text()
    assert load_measured(tmp_path / "tradeoff.json") == Measured(ABOUT, (KNEE, beaten))
    assert '<tr class="default"><td>b</td>' in page
    assert "broken &lt;knob&gt;" in page
    assert "beaten in time and in error by good" in page
    assert sorted(p.name for p in tmp_path.glob("*.svg")) == [
        "broken-knob-demo.svg",
        "iterations-demo.svg",
    ]


def test_knobs_measured_before_are_kept_unless_measured_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    order = ["samples", "iterations"]
    other = sweep("p", point("p", 1.0, 0.2), name="samples")
    assert merged(path, [KNEE], ABOUT, order).sweeps == (KNEE,)
    save_measured(path, Measured(ABOUT, (KNEE, other)))
    again = sweep("p", point("p", 2.0, 0.1), name="samples")
    assert merged(path, [again], ABOUT, order).sweeps == (again, KNEE)
    attic = sweep("p", point("p", 2.0, 0.1), name="samples", scene="attic")
    assert merged(path, [attic], ABOUT, order).sweeps == (attic, other, KNEE)
    assert merged(path, [again], {"machine": "64 cores"}, order).sweeps == (again,)


def test_a_sweep_of_another_version_is_one_sentence(tmp_path: Path) -> None:
    save_measured(tmp_path / "t.json", Measured(ABOUT, (KNEE,)))
    text = (tmp_path / "t.json").read_text()
    (tmp_path / "t.json").write_text(text.replace('"version": 2', '"version": 9'))
    with pytest.raises(FormatError, match="version 9"):
        load_measured(tmp_path / "t.json")
    (tmp_path / "t.json").write_text("{}")
    with pytest.raises(FormatError, match="does not hold sweeps"):
        load_measured(tmp_path / "t.json")


@pytest.mark.parametrize(
    ("path", "value", "fact"),
    [
        (["default"], "nope", "not whole: iterations"),
        (["points"], [], "not whole: iterations"),
        (["points", 0, "works"], [], "not whole: iterations"),
        (["points", 0, "works", 0, "error"], float("nan"), "not whole: iterations"),
        (["points", 0, "works", 0, "cpu_s"], "soon", "sweeps.0.points.0.works.0.cpu_s"),
        (["points", 0, "settings"], [1], "sweeps.0.points.0.settings"),
        (["points", 0, "works", 0], {}, "cpu_s: field required"),
    ],
)
def test_a_damaged_sweep_is_one_line_before_anything_is_measured(
    tmp_path: Path, path: list[str | int], value: object, fact: str
) -> None:
    file = tmp_path / "tradeoff.json"
    save_measured(file, Measured(ABOUT, (KNEE,)))
    document = json.loads(file.read_text())
    place = document["sweeps"][0]
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    file.write_text(json.dumps(document))
    for options in (["--quality", "high"], ["--knob", "alpha", "--artifacts", "nowhere"]):
        refused = CliRunner().invoke(command, ["--out", str(tmp_path), *options])
        assert isinstance(refused.exception, FormatError)
        assert fact in str(refused.exception)
        assert "\n" not in str(refused.exception)


def test_bytes_that_are_no_text_are_not_repeated_to_the_user(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_bytes(bytes(range(256)))
    with pytest.raises(FormatError, match="does not hold sweeps") as caught:
        load_measured(tmp_path / "t.json")
    assert len(str(caught.value)) < 300


def test_the_command_chooses_and_says_what_to_expect(tmp_path: Path) -> None:
    save_measured(tmp_path / "tradeoff.json", Measured(ABOUT, (KNEE,)))
    chosen = CliRunner().invoke(command, ["--out", str(tmp_path), "--budget", "3s"])
    assert chosen.exit_code == 0, chosen.output
    assert "expected on capture demo: 2.0 processor seconds" in chosen.output
    assert "splat.b: 2.0" in chosen.output


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--out", "nowhere", "--quality", "high"], "`lux tradeoff` measures it"),
        (["--quality", "high", "--capture", "attic"], "capture attic was not measured"),
        (["--quality", "high", "--budget", "3s"], "not both"),
        (["--try"], "give one of them"),
        (["--knob", "wheel"], "no knob is called so"),
        (["--artifacts", "nowhere", "--knob", "alpha"], "no knob could be measured"),
    ],
)
def test_what_the_command_cannot_do_is_one_sentence(
    tmp_path: Path, options: list[str], sentence: str
) -> None:
    save_measured(tmp_path / "tradeoff.json", Measured(ABOUT, (KNEE,)))
    refused = CliRunner().invoke(command, ["--out", str(tmp_path), *options])
    assert isinstance(refused.exception, InputError)
    assert sentence in str(refused.exception)


def test_no_default_is_beaten_in_the_measurements_that_are_kept(project_root: Path) -> None:
    kept = load_measured(project_root / "docs" / "tradeoff" / "tradeoff.json")
    assert {sweep.knob for sweep in kept.sweeps} <= {knob.name for knob in KNOBS}
    for measured in kept.sweeps:
        assert dominating(measured) == [], (measured.scene, measured.knob)

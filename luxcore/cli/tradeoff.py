"""`lux tradeoff`: measure what accuracy costs in time, or choose settings from a measurement."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.errors import InputError

if TYPE_CHECKING:
    from luxcore.tradeoff.advise import Advice
    from luxcore.tradeoff.knob import Bench
    from luxcore.tradeoff.sweep import Sweep

QUALITIES = ("low", "default", "high")


@click.command(name="tradeoff")
@click.option(
    "--artifacts",
    default=Path("artifacts"),
    show_default=True,
    type=click.Path(path_type=Path),
    help="Artifacts of a finished run to measure on.",
)
@click.option("--capture", default="demo", show_default=True, help="The capture to measure on.")
@click.option(
    "--out", default=Path("artifacts/tradeoff"), show_default=True, type=click.Path(path_type=Path)
)
@click.option("--knob", "names", multiple=True, help="Only knobs whose name contains this.")
@click.option("--repeats", default=3, show_default=True, type=click.IntRange(1, 100))
@click.option("--budget", help="Choose settings for a time such as 2min from OUT/tradeoff.json.")
@click.option("--quality", type=click.Choice(QUALITIES), help="Choose settings by quality instead.")
@click.option("--try", "trying", is_flag=True, help="Run the chosen settings; compare on the page.")
def command(
    artifacts: Path,
    capture: str,
    out: Path,
    names: tuple[str, ...],
    repeats: int,
    budget: str | None,
    quality: str | None,
    trying: bool,
) -> None:
    """What accuracy costs in time: one Pareto curve per knob, the rest at the program's defaults.

    Knobs measured before on the same machine are kept in OUT/tradeoff.json. With --budget or
    --quality nothing is swept: settings are chosen from the last sweep, and what they are expected
    to take is printed.
    """
    if budget and quality:
        raise InputError("give --budget or --quality, not both.")
    if trying and not (budget or quality):
        raise InputError("--try runs what --budget or --quality chooses: give one of them.")
    if budget or quality:
        _advise(artifacts, capture, out, budget, quality, trying=trying)
    else:
        _measure(artifacts, capture, out, names, repeats)


def _measure(
    artifacts: Path, capture: str, out: Path, names: tuple[str, ...], repeats: int
) -> None:
    from luxcore.tradeoff.knobs import KNOBS, ORDER
    from luxcore.tradeoff.page import write_tradeoffs
    from luxcore.tradeoff.store import load_measured, merged
    from luxcore.tradeoff.sweep import measure

    chosen = [knob for knob in KNOBS if not names or any(name in knob.name for name in names)]
    if not chosen:
        raise InputError(f"no knob is called so; there are: {'; '.join(k.name for k in KNOBS)}.")
    # Not after the first knob, whose minutes would be lost.
    out.mkdir(parents=True, exist_ok=True)
    if (out / "tradeoff.json").exists():
        load_measured(out / "tradeoff.json")
    sweeps = []
    for knob in chosen:
        with tempfile.TemporaryDirectory(prefix="lux-tradeoff-") as scratch:
            bench = _bench(artifacts, Path(scratch), capture)
            try:
                sweep = measure(knob, bench, repeats)
            except InputError as error:
                # Photos have no known light: knobs that need it are not for them.
                click.echo(f"{knob.name}: left out, {error}")
                continue
        sweeps.append(sweep)
        _tell(sweep)
        # After every knob: a sweep that is interrupted keeps what it has measured.
        write_tradeoffs(out, merged(out / "tradeoff.json", sweeps, _about(), ORDER))
    if not sweeps:
        raise InputError(f"no knob could be measured on capture {capture}.")
    click.echo(f"{out / 'tradeoff.html'}")


def _tell(sweep: Sweep) -> None:
    from luxcore.tradeoff.sweep import front

    best = {point.label for point in front(sweep.points)}
    click.echo(f"{sweep.knob} on {sweep.scene}: {sweep.error_name}")
    for point in sweep.points:
        marks = (" best for its time" if point.label in best else "") + (
            " (default)" if point.label == sweep.default else ""
        )
        click.echo(f"  {point.label:28} {point.seconds:9.3f} CPU-s  {point.error:.5f}{marks}")


def _advise(
    artifacts: Path,
    capture: str,
    out: Path,
    budget: str | None,
    quality: str | None,
    *,
    trying: bool,
) -> None:
    from luxcore.tradeoff.advise import parse_budget, with_quality, within_budget
    from luxcore.tradeoff.store import load_measured

    sweeps = load_measured(out / "tradeoff.json").of(capture)
    if budget:
        advice = within_budget(sweeps, parse_budget(budget))
        asked = f"--budget {budget}"
    else:
        advice = with_quality(sweeps, quality)  # type: ignore[arg-type]
        asked = f"--quality {quality}"
    click.echo(f"expected on capture {capture}: {advice.seconds:.1f} processor seconds")
    for expected in advice.works:
        click.echo(
            f"  {expected.work}: {expected.seconds:.2f} s, {expected.error_name} "
            f"{expected.error:.4g}"
        )
        for knob, label in expected.labels.items():
            click.echo(f"    {knob}: {label}")
    click.echo("in params.yaml:")
    for name, value in sorted(advice.settings.items()):
        click.echo(f"  {name}: {'null' if value is None else value}")
    if trying:
        _try(artifacts, capture, out, advice, asked)


def _try(artifacts: Path, capture: str, out: Path, advice: Advice, asked: str) -> None:
    from luxcore.tradeoff.advise import try_out
    from luxcore.tradeoff.knobs import KNOBS
    from luxcore.tradeoff.page import write_tradeoffs
    from luxcore.tradeoff.store import load_measured, with_trial

    with tempfile.TemporaryDirectory(prefix="lux-tradeoff-") as scratch:
        trial = try_out(advice, asked, KNOBS, _bench(artifacts, Path(scratch), capture))
    click.echo(f"obtained: {trial.obtained_s:.1f} processor seconds")
    for tried in trial.works:
        click.echo(
            f"  {tried.work}: {tried.obtained.cpu_s:.2f} s, error {tried.obtained.error:.4g}"
        )
    page = write_tradeoffs(out, with_trial(load_measured(out / "tradeoff.json"), trial))
    click.echo(f"{page}")


def _bench(artifacts: Path, scratch: Path, capture: str) -> Bench:
    from luxcore.settings.project import ProjectSettings
    from luxcore.tradeoff.knob import Bench

    return Bench(artifacts, scratch, ProjectSettings(), capture)


def _about() -> dict[str, str]:
    import os
    import platform

    return {"machine": f"{os.cpu_count()} cores ({platform.machine()})"}

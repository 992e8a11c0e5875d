"""`lux tradeoff`: measure what accuracy costs in time, or choose settings from a measurement."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.errors import InputError

if TYPE_CHECKING:
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
def command(
    artifacts: Path,
    capture: str,
    out: Path,
    names: tuple[str, ...],
    repeats: int,
    budget: str | None,
    quality: str | None,
) -> None:
    """What accuracy costs in time: one Pareto curve per knob, the rest at the program's defaults.

    Knobs measured before on the same capture and machine are kept in OUT/tradeoff.json.
    With --budget or --quality nothing is measured: settings are chosen from the last sweep, and
    what they are expected to take is printed.
    """
    if budget and quality:
        raise InputError("give --budget or --quality, not both.")
    if budget or quality:
        _advise(out / "tradeoff.json", budget, quality)
        return
    _measure(artifacts, capture, out, names, repeats)


def _measure(
    artifacts: Path, capture: str, out: Path, names: tuple[str, ...], repeats: int
) -> None:
    from luxcore.settings.project import ProjectSettings
    from luxcore.tradeoff.knob import Bench
    from luxcore.tradeoff.knobs import KNOBS, ORDER
    from luxcore.tradeoff.page import write_tradeoffs
    from luxcore.tradeoff.sweep import measure, merged

    chosen = [knob for knob in KNOBS if not names or any(name in knob.name for name in names)]
    if not chosen:
        raise InputError(f"no knob is called so; there are: {'; '.join(k.name for k in KNOBS)}.")
    with tempfile.TemporaryDirectory(prefix="lux-tradeoff-") as scratch:
        sweeps = []
        for index, knob in enumerate(chosen):
            folder = Path(scratch) / str(index)
            folder.mkdir()
            sweeps.append(
                measure(knob, Bench(artifacts, folder, ProjectSettings(), capture), repeats)
            )
            _tell(sweeps[-1])
            about = _about(capture)
            # After every knob: a sweep that is interrupted keeps what it has measured.
            write_tradeoffs(out, merged(out / "tradeoff.json", sweeps, about, ORDER), about)
    click.echo(f"{out / 'tradeoff.html'}")


def _tell(sweep: Sweep) -> None:
    from luxcore.tradeoff.sweep import front

    best = {point.label for point in front(sweep.points)}
    click.echo(f"{sweep.knob}: {sweep.error_name}")
    for point in sweep.points:
        marks = (" best for its time" if point.label in best else "") + (
            " (default)" if point.label == sweep.default else ""
        )
        click.echo(f"  {point.label:28} {point.seconds:9.3f} CPU-s  {point.error:.5f}{marks}")


def _advise(path: Path, budget: str | None, quality: str | None) -> None:
    from luxcore.tradeoff.advise import parse_budget, with_quality, within_budget
    from luxcore.tradeoff.sweep import load_sweeps

    sweeps, about = load_sweeps(path)
    if budget:
        advice = within_budget(sweeps, parse_budget(budget))
    else:
        advice = with_quality(sweeps, quality)  # type: ignore[arg-type]
    click.echo(f"expected on {about['scene']}: {advice.seconds:.1f} processor seconds")
    for sweep in sweeps:
        point = advice.chosen[sweep.knob]
        click.echo(
            f"  {sweep.knob}: {point.label}  ({point.seconds:.2f} s, {sweep.error_name} "
            f"{point.error:.4g})"
        )
    click.echo("in params.yaml:")
    for name, value in sorted(advice.settings.items()):
        click.echo(f"  {name}: {'null' if value is None else value}")


def _about(capture: str) -> dict[str, str]:
    import os
    import platform

    machine = f"{os.cpu_count()} cores ({platform.machine()})"
    return {"scene": f"capture {capture}", "machine": machine}

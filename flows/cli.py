"""`lux run`, `lux plan`, `lux verify`, `lux schedule`, `lux dashboards`."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import click

from luxcore.errors import InputError, LuxError


@click.command()
@click.argument("stages", nargs=-1)
@click.option("--stages-at-once", default=1, show_default=True, type=click.IntRange(1, 16))
def run(stages: tuple[str, ...], stages_at_once: int) -> None:
    """Run the flow: every stage that is stale, in order; all of them or only STAGES."""
    root = project_root()
    _check_names(stages)
    from flows.checks import check_project
    from flows.own_server import start_own_server
    from flows.records import check_records
    from flows.summary import metrics_table

    check_project(root)
    check_records(root)
    # A termination would leave stages and their times unrecorded; it is taken as an interrupt.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    start_own_server(root)
    from flows.pipeline import run_pipeline

    run_pipeline(root, list(stages) or None, stages_at_once)
    click.echo(metrics_table(root))
    report = root / "reports" / "index.html"
    if report.is_file():
        click.echo(f"report: {report}")


@click.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of a table.")
def plan(as_json: bool) -> None:
    """What `lux run` would do: fresh, cached or stale stages, missing units, time and disk."""
    from flows.plan import make_plan, totals

    plans = make_plan(project_root())
    count, seconds, timed = totals(plans)
    if as_json:
        click.echo(json.dumps({"stages": [p.row() for p in plans], "seconds": seconds}))
        return
    from flows.summary import plan_table

    click.echo(plan_table(plans))
    known = f"about {seconds / 60:.1f} min" if timed else "some of them never timed here"
    click.echo(f"{count} of {len(plans)} stages would run, {known}.")


@click.command()
@click.option("--digests", is_flag=True, help="Print one digest per stage over pixels and values.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
def verify(digests: bool, as_json: bool) -> None:
    """Check every artifact and finished unit against its manifest; exit code 1 on damage."""
    root = project_root()
    if digests:
        from flows.digests import stage_digests

        found = stage_digests(root)
        lines = [f"{digest}  {name}" for name, digest in found.items()]
        click.echo(json.dumps(found, indent=1) if as_json else "\n".join(lines))
        return
    from flows.verify import verify as check

    count, damage = check(root)
    if as_json:
        rows = [{"folder": str(d.folder), "files": d.files} for d in damage]
        click.echo(json.dumps({"checked": count, "damaged": rows}))
    if damage:
        first = damage[0]
        raise LuxError(
            f"{len(damage)} of {count} folders are damaged: {first.folder} ({first.files[0]}); "
            "`lux run` computes what is missing again."
        )
    if not as_json:
        click.echo(f"{count} folders checked, all as their manifests say.")


@click.command()
@click.option("--cron", required=True, help='When, as in "0 3 * * *".')
@click.argument("stages", nargs=-1)
@click.option("--worktree", type=click.Path(path_type=Path), help="Where; beside the project.")
@click.option(
    "--set", "changes", multiple=True, metavar="STAGE.NAME=VALUE",
    help="A parameter for these runs alone, as in rooms.train=200.",
)  # fmt: skip
def schedule(
    cron: str, stages: tuple[str, ...], worktree: Path | None, changes: tuple[str, ...]
) -> None:
    """Build STAGES and all they need (or everything) on a cron schedule, until interrupted.

    Runs happen in a git worktree of its own at the project's present commit, with the project's
    cache and finished units. A run that is due while another is going ends at once.
    """
    root = project_root()
    _check_names(stages)
    from flows.records import check_records
    from flows.schedule import serve

    check_records(root)
    serve(root, cron, list(stages) or None, worktree, list(changes))


@click.command()
@click.option("--mlflow-port", default=5000, show_default=True, type=click.IntRange(1, 65535))
@click.option("--prefect-port", default=4200, show_default=True, type=click.IntRange(1, 65535))
@click.option("--report-port", default=4300, show_default=True, type=click.IntRange(1, 65535))
def dashboards(mlflow_port: int, prefect_port: int, report_port: int) -> None:
    """Start mlflow's and Prefect's pages and the report, and print their addresses.

    They listen on 127.0.0.1 only, and end with this command.
    """
    root = project_root()
    from flows.dashboards import dashboards as servers
    from flows.dashboards import serve_dashboards
    from flows.records import check_records

    check_records(root)
    serve_dashboards(root, servers(root, mlflow_port, prefect_port, report_port), click.echo)


def project_root() -> Path:
    """The folder above (or at) the current one that holds `params.yaml` and `dvc.yaml`."""
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / "dvc.yaml").exists() and (folder / "params.yaml").exists():
            return folder
    raise InputError(f"{here} is not inside a project: no dvc.yaml with a params.yaml beside it.")


def _check_names(stages: tuple[str, ...]) -> None:
    import difflib

    from tasks.context import STAGE_NAMES

    for name in stages:
        if name not in STAGE_NAMES:
            near = difflib.get_close_matches(name, STAGE_NAMES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(STAGE_NAMES)}."
            raise InputError(f"there is no stage {name}; {hint}")

"""`python -m tasks STAGE`: how DVC runs a stage."""

from __future__ import annotations

import importlib
import inspect
import resource
import shutil
import sys
import time
from pathlib import Path

from luxcore.errors import InputError, LuxError, system_sentence
from luxcore.files.atomic import write_json
from luxcore.lifetime import die_with_parent
from luxcore.settings.load import load_settings
from luxcore.units.store import seal_folder
from tasks.context import STAGE_NAMES, StageContext, metrics_file
from tasks.process import stage_lock
from tasks.system_metrics import Sample, SystemSampler


def main(arguments: list[str]) -> int:
    """Run one stage; one sentence on standard error and a code other than 0 where it fails."""
    if arguments in (["-h"], ["--help"]):
        print(f"{__doc__}\n\n{_usage()}")
        return 0
    try:
        die_with_parent()
        run_stage(_stage_name(arguments), Path.cwd())
    except LuxError as error:
        print(f"lux: {error}", file=sys.stderr)
        return error.exit_code
    except OSError as error:
        sentence = system_sentence(error)
        if sentence is None:
            raise
        print(f"lux: {sentence}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("lux: stopped.", file=sys.stderr)
        return 130
    return 0


def run_stage(name: str, root: Path) -> StageContext:
    """Empty the stage's folder, run it, and record metrics, timings and an mlflow run."""
    context = StageContext(name, load_settings(root / "params.yaml"), root)
    with stage_lock(root, name):
        shutil.rmtree(context.out, ignore_errors=True)
        context.out.mkdir(parents=True)
        start = time.monotonic()
        module = importlib.import_module(f"tasks.{name}")
        with SystemSampler() as sampler:
            module.run(context)
        seconds = time.monotonic() - start
        seal_folder(context.out)
        _record(context, inspect.getdoc(module) or "", seconds, sampler.samples)
    return context


def _record(context: StageContext, does: str, seconds: float, samples: list[Sample]) -> None:
    from tasks.tracking import log_stage

    peak_mb = max(
        resource.getrusage(who).ru_maxrss / 1024
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    write_json(context.root / metrics_file(context.name), context.metrics)
    timings = {**context.timings, "wall_s": seconds, "peak_memory_mb": peak_mb}
    write_json(context.root / "artifacts" / "timings" / f"{context.name}.json", timings)
    log_stage(context, does, seconds, peak_mb, samples)
    print(f"{context.name}: {seconds:.1f} s, {peak_mb:.0f} MB", file=sys.stderr)


def _stage_name(arguments: list[str]) -> str:
    if len(arguments) != 1 or arguments[0] not in STAGE_NAMES:
        raise InputError(_usage())
    return arguments[0]


def _usage() -> str:
    return f"usage: python -m tasks STAGE, one of {', '.join(STAGE_NAMES)}."


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

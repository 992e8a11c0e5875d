"""The harmonize stage for one capture: every view's light, pass by pass."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from luxcore.capture import Capture, load_capture
from luxcore.errors import FormatError
from luxcore.files.atomic import write_json
from luxcore.files.digests import tree_digest
from luxcore.files.json_object import read_object
from luxcore.harmonize.plan import Pass, PassPlan, plan_passes
from luxcore.harmonize.poses import pose_distance, views_linked
from luxcore.progress import progress
from luxcore.settings.harmonize import HarmonizeSettings
from luxcore.units import Unit, UnitStore, run_units
from luxcore.units.store import unit_key

CODE = (
    "luxcore/harmonize",
    "luxcore/models",
    "luxcore/decompose",
    "luxcore/capture",
    "luxcore/masks",
    "luxcore/light",
    "luxcore/files",
    "luxcore/cameras.py",
    "luxcore/settings/paper_models.py",
)
"""Code whose change makes finished passes stale, whichever backend made them; the weights that
backends ship with are in it."""


def harmonize_capture(
    capture_dir: Path,
    masks_dir: Path,
    splat_dir: Path | None,
    decompose_dir: Path,
    out: Path,
    settings: HarmonizeSettings,
    store: UnitStore,
    *,
    weights: Path | None = None,
    seed: int = 0,
) -> dict[str, float]:
    """Carry the decomposition of the reference views to all views; returns flat metrics.

    Writes `passes.json`, `direct/` and `brackets/` into `out`. Passes run in order, since each may
    build on those before; a pass that `store` already holds is taken from there.
    """
    capture = load_capture(capture_dir)
    plan = plan_capture(capture, decompose_dir, settings)
    inputs = {
        "capture": str(capture_dir),
        "masks": str(masks_dir),
        "decompose": str(decompose_dir),
        "splat": str(splat_dir) if splat_dir and settings.use_geometry else None,
    }
    path = settings.weights or (str(weights) if weights is not None else None)
    shared = {
        "backend": settings.backend,
        "weights": path,
        "options": dict(settings.options),
        "seed": seed,
    }
    folders = _run(plan, inputs, shared, store, capture.id)
    for folder in folders:
        _copy(folder, out)
    write_json(out / "passes.json", plan_record(plan))
    return {
        "passes": float(len(plan.passes)),
        "views": float(len(capture.frames)),
        "disconnected": float(len(plan.disconnected)),
    }


def plan_capture(capture: Capture, decompose_dir: Path, settings: HarmonizeSettings) -> PassPlan:
    """The plan for a capture, from its cameras and its decomposed references."""
    cameras = [frame.camera for frame in capture.frames]
    return plan_passes(
        pose_distance(cameras),
        views_linked(cameras),
        _references(decompose_dir),
        max_views=settings.views_per_pass,
        chain=settings.chain,
    )


def plan_record(plan: PassPlan) -> dict[str, Any]:
    """The plan as JSON."""
    return {
        "passes": [
            {
                "index": index,
                "targets": list(step.targets),
                "references": list(step.references),
                "secondary": list(step.secondary),
            }
            for index, step in enumerate(plan.passes)
        ],
        "disconnected": list(plan.disconnected),
    }


def _run(
    plan: PassPlan,
    inputs: dict[str, str | None],
    shared: dict[str, Any],
    store: UnitStore,
    capture_id: str,
) -> list[Path]:
    digests = _input_digests(inputs)
    keyed = {**shared, "weights": _weights_identity(shared["weights"])}
    folders: list[Path] = []
    done_in: dict[int, int] = {}
    keys: list[str] = []
    with progress(f"harmonize {capture_id}", len(plan.passes), "passes") as bar:
        for index, step in enumerate(plan.passes):
            before = {view: done_in[view] for view in step.secondary}
            key = _key(step, keyed, [*digests, *(keys[p] for p in sorted(set(before.values())))])
            arguments = {
                "inputs": inputs,
                "targets": list(step.targets),
                "references": list(step.references),
                "secondary": {str(view): str(folders[p]) for view, p in before.items()},
                **shared,
            }
            name = f"{capture_id} pass {index}"
            unit = Unit(name, "luxcore.harmonize.unit:harmonize_pass", arguments, key)
            folders.append(run_units([unit], store, label="passes").folders[name])
            keys.append(key)
            done_in.update(dict.fromkeys(step.targets, index))
            bar.advance()
    return folders


def _key(step: Pass, keyed: dict[str, Any], digests: list[str]) -> str:
    about = {
        "targets": list(step.targets),
        "references": list(step.references),
        "secondary": list(step.secondary),
        **keyed,
    }
    return unit_key(CODE, about, digests)


def _weights_identity(weights: str | None) -> str | None:
    """What the weights are, wherever they lie: a digest of local ones, else their hub id."""
    path = Path(weights) if weights else None
    if path is None or not path.exists():
        return weights
    return tree_digest([path], path)


def _input_digests(inputs: dict[str, str | None]) -> list[str]:
    digests = []
    for folder in inputs.values():
        root = Path(folder) if folder else None
        files = [root / "depth"] if root and (root / "depth").is_dir() else [root]
        digests.append(tree_digest([f for f in files if f], root) if root else "none")
    return digests


def _references(decompose_dir: Path) -> list[int]:
    path = decompose_dir / "decompose.json"
    about = read_object(path)
    try:
        return sorted({int(view) for views in about["references"] for view in views})
    except (ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{path} names no reference views: {error!r}.") from error


def _copy(unit: Path, out: Path) -> None:
    for kind in ("direct", "brackets"):
        (out / kind).mkdir(parents=True, exist_ok=True)
        for file in sorted((unit / kind).iterdir()):
            shutil.copyfile(file, out / kind / file.name)

"""Train or fine-tune the small models on rendered rooms; never hand on worse weights than the base.

The same code serves the short fine-tuning of the train stages and the full recipe
(`luxcore.models.small.train`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.random import PCG64, Generator, SeedSequence
from torch import Tensor

from luxcore.data.compact import list_rendered, read_metadata
from luxcore.data.multiview import MultiViewSets
from luxcore.errors import InputError
from luxcore.files.atomic import write_json
from luxcore.files.digests import value_digest
from luxcore.models.small.batches import (
    GroupBatches,
    SingleBatches,
    group_example,
    single_features,
)
from luxcore.models.small.examples import Example, to_example
from luxcore.models.small.fit import Batches, FitResult, FitSettings, Validate, fit
from luxcore.models.small.network import LampNet, NetworkShape, UNet
from luxcore.models.small.pictures import validation_sheet
from luxcore.models.small.samples import CropPool, relit
from luxcore.models.small.scores import lamp_scores, mean_psnr
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.weights import (
    CHANNELS,
    load_network,
    save_weights,
    shipped_network,
    shipped_weights,
)
from luxcore.settings.train_mv import TrainMvSettings
from luxcore.settings.train_sv import TrainingSettings, TrainSvSettings

WIDTHS = (40, 80, 160, 224)
SHAPES = {
    kind: NetworkShape(*channels, WIDTHS, middle=2, attending=1, overall=True, together=3)
    for kind, channels in CHANNELS.items()
    if kind != "geometry"
}
SKETCH_ROOMS = 100_000

Cases = Sequence[tuple[Tensor, Example]]
Weights = Mapping[str, Tensor]


@dataclass(frozen=True)
class TrainingResult:
    """What a training gave, in the files that it wrote and in numbers."""

    metrics: dict[str, float]
    curve: list[dict[str, float]]
    picture: np.ndarray


def train_sv(
    dataset_dir: Path,
    out: Path,
    settings: TrainSvSettings,
    seed: int,
    *,
    base: Path | None = None,
    checkpoint: Path | None = None,
    workers: int = 0,
) -> TrainingResult:
    """Train the single-view model on the rendered views below `dataset_dir`.

    Writes `model.safetensors`, `card.json` and `curve.json` into `out`. `base` are weights to
    start from (default: as the settings say). With `checkpoint` an interrupted training goes on
    where it was, to the same bits. `workers` processes make photos ahead of their use.
    """
    pool, aside = pools(dataset_dir, settings, seed)
    net = start_network("sv", base_weights("sv", settings, base), seed)
    estimator = shipped_network("geometry")
    batches = SingleBatches(
        pool, seed, settings.photos_per_step, settings.geometry_share, estimator
    )
    cases = single_cases(aside, seed, estimator)
    return _train("sv", net, batches, cases, settings, out, checkpoint, dataset_dir, workers)


def train_mv(
    dataset_dir: Path,
    out: Path,
    settings: TrainMvSettings,
    seed: int,
    *,
    base: Path | None = None,
    checkpoint: Path | None = None,
    workers: int = 0,
) -> TrainingResult:
    """Train the multi-view model; see `train_sv`. From scratch it starts from the shipped
    single-view weights, whose channels it shares."""
    pool, aside = pools(dataset_dir, settings, seed)
    net = start_network("mv", base_weights("mv", settings, base), seed)
    batches = GroupBatches(pool, seed, settings.photos_per_step, shipped_network("sv"))
    cases = group_cases(aside, seed)
    return _train("mv", net, batches, cases, settings, out, checkpoint, dataset_dir, workers)


def pools(dataset_dir: Path, settings: TrainingSettings, seed: int) -> tuple[CropPool, CropPool]:
    """(training, validation) photos: validation has the last tenth of the rooms, or other photos
    where there is only one room."""
    stems = list_rendered(dataset_dir)
    room_of = {stem: str(read_metadata(stem).get("room")) for stem in stems}
    rooms = sorted(set(room_of.values()))[: settings.rooms or None]
    kept = rooms[: max(1, len(rooms) - max(1, len(rooms) // 10))]
    training = [stem for stem in stems if room_of[stem] in kept]
    aside = [stem for stem in stems if room_of[stem] in set(rooms) - set(kept)] or training
    size = (settings.size_px, settings.size_px)
    views = settings.views_per_group
    sets = MultiViewSets(training, size, seed, views_per_set=views, relit=False)
    pool = CropPool.collect(sets, range(settings.groups), views)
    if settings.sketches:
        sketches = SketchRooms(SKETCH_ROOMS, settings.size_px, seed)
        pool = pool + CropPool.collect(sketches, range(settings.sketches), views)
    # Another seed: where there is one room only, at least its photos are others.
    held_out = MultiViewSets(aside, size, seed + 1, views_per_set=views, relit=False)
    return pool, CropPool.collect(held_out, range(settings.validation_groups), views)


def start_network(kind: str, base: Path | None, seed: int) -> UNet:
    """The network to train: from `base`, else new; a new multi-view network takes the shipped
    single-view weights for the channels that both have."""
    if base is not None:
        return load_network(base, kind)
    torch.manual_seed(seed)
    net = LampNet(SHAPES[kind])
    if kind == "mv" and (single := shipped_network("sv")) is not None:
        widen(single, net)
    return net


def widen(narrow: UNet, wide: UNet) -> None:
    """Copy weights of a network with fewer inputs and outputs; the further ones start at zero."""
    weights = dict(narrow.state_dict())
    for name in ("stem.weight", "head.weight", "head.bias"):
        padded = torch.zeros_like(wide.state_dict()[name])
        padded[tuple(slice(0, size) for size in weights[name].shape)] = weights[name]
        weights[name] = padded
    wide.load_state_dict(weights)


def single_cases(pool: CropPool, seed: int, estimator: UNet | None = None) -> Cases:
    """Every photo once, under a light drawn from its number, with guessed and with given geometry
    in turn, two photos in new light and two in their own."""
    cases = []
    for number, crop in enumerate(pool.photos()):
        rng = Generator(PCG64(SeedSequence((seed, number))))
        (lit,) = relit([crop], rng, own_light=number % 4 >= 2)
        example = to_example(lit, geometry=number % 2 == 1)
        if len(example.on):
            cases.append((single_features(example, estimator), example))
    return cases


def group_cases(pool: CropPool, seed: int) -> Cases:
    """Per group: each further photo with the first one's true light as its reference."""
    cases = []
    for number, group in enumerate(pool.groups):
        rng = Generator(PCG64(SeedSequence((seed, number))))
        reference, *targets = relit(group, rng, own_light=number % 2 == 1)
        known = reference.masks.any((1, 2))
        cases += [group_example(t, [reference], known) for t in targets if known.any()]
    return cases


def base_weights(kind: str, settings: TrainingSettings, base: Path | None) -> Path | None:
    """Which weights a training starts from: `base`, else what the settings name, else none.

    Raises InputError where there are none and the result is to be blended with them.
    """
    found = _base_weights(kind, settings, base)
    if found is None and settings.blend < 1:
        raise InputError(f"blend {settings.blend} needs base, the weights that {kind} starts from.")
    return found


def _base_weights(kind: str, settings: TrainingSettings, base: Path | None) -> Path | None:
    if base is not None:
        return base
    if settings.base == "shipped":
        path = shipped_weights(kind)
        return path if path.is_file() else None
    return Path(settings.base) if settings.base else None


def _train(
    kind: str,
    net: UNet,
    batches: Batches,
    cases: Cases,
    settings: TrainingSettings,
    out: Path,
    checkpoint: Path | None,
    dataset_dir: Path,
    workers: int,
) -> TrainingResult:
    if not cases:
        raise InputError(f"{dataset_dir} shows no lamp in its validation photos.")
    before = mean_psnr(net.eval(), cases)
    original = {name: value.detach().clone() for name, value in net.state_dict().items()}
    result = _fit(net, batches, settings, lambda n: lamp_scores(n, cases), checkpoint, workers)
    trained = blended(original, result.weights, settings.blend)
    net.load_state_dict(trained)
    after = mean_psnr(net.eval(), cases)
    improved = after > before
    chosen = trained if improved else original
    net.load_state_dict(chosen)
    save_weights(out / "model.safetensors", kind, net.shape, chosen)
    write_json(out / "curve.json", result.curve)
    metrics = {
        "psnr_validation": max(before, after),
        "psnr_base": before,
        "psnr_trained": after,
        "kept_base": float(not improved),
        "parameters": float(sum(p.numel() for p in net.parameters())),
    }
    write_json(out / "card.json", _card(kind, settings, metrics, dataset_dir))
    return TrainingResult(metrics, result.curve, validation_sheet(net.eval(), cases))


def _fit(
    net: UNet,
    batches: Batches,
    settings: TrainingSettings,
    validate: Validate,
    checkpoint: Path | None,
    workers: int,
) -> FitResult:
    if settings.steps == 0:
        return FitResult(net.state_dict(), [])
    return fit(net, batches, fit_settings(settings), validate, checkpoint, workers=workers)


def blended(base: Weights, trained: Weights, share: float) -> Weights:
    """Weights between both, `share` of the way to the trained ones. Trained on few photos, what
    lies between often does better on other photos than either end (Wortsman et al. 2022)."""
    return {name: torch.lerp(base[name], trained[name], share) for name in base}


def fit_settings(settings: TrainingSettings) -> FitSettings:
    """The loop's settings for a training's."""
    return FitSettings(
        settings.steps,
        settings.rate,
        warmup=min(50, max(1, settings.steps // 10)),
        cooldown=settings.cooldown,
        check_every=settings.check_every,
    )


def _card(
    kind: str, settings: TrainingSettings, metrics: dict[str, float], dataset_dir: Path
) -> dict[str, object]:
    views = [stem.name for stem in list_rendered(dataset_dir)]
    return {
        "kind": kind,
        "settings": settings.model_dump(mode="json"),
        "views": len(views),
        "views_sha256": value_digest(views),
        "metrics": metrics,
    }

"""Train the network that guesses a photo's depth, normals and focal length.

Its photos are those of the single-view training, relit anew each time, so that surfaces are
recognised under any lamp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from numpy.random import PCG64, Generator, SeedSequence
from torch import Tensor

from luxcore.data.crops import LitCrop
from luxcore.data.repaint import repainted
from luxcore.files.atomic import write_json
from luxcore.models.small.examples import to_example
from luxcore.models.small.features import photo_features
from luxcore.models.small.fit import fit
from luxcore.models.small.geometry import (
    GEOMETRY_OUTPUTS,
    PHOTO_CHANNELS,
    geometry_loss,
    indoors,
    read_outputs,
)
from luxcore.models.small.network import NetworkShape, UNet
from luxcore.models.small.samples import CropPool, relit
from luxcore.models.small.surfaces import Surfaces
from luxcore.models.small.training import WIDTHS, base_weights, blended, fit_settings, pools
from luxcore.models.small.weights import load_network, save_weights
from luxcore.settings.train_sv import TrainingSettings

SHAPE = NetworkShape(PHOTO_CHANNELS, GEOMETRY_OUTPUTS, WIDTHS, middle=2, attending=1, overall=True)


@dataclass(frozen=True)
class SeenPhoto:
    """What is true of a photo: its surfaces, and the focal length in long sides."""

    surfaces: Surfaces
    focal: Tensor


@dataclass(frozen=True)
class PhotoBatches:
    """Photos of `pool` under new light, half of them mirrored, the share `repaint` in other paint;
    a pure function of the step."""

    pool: CropPool
    seed: int
    photos: int
    repaint: float = 0.6

    def batch(self, step: int) -> list[tuple[Tensor, SeenPhoto]]:
        """`photos` examples."""
        rng = Generator(PCG64(SeedSequence((self.seed, step, 1))))
        return [self._photo(rng) for _ in range(self.photos)]

    def _photo(self, rng: Generator) -> tuple[Tensor, SeenPhoto]:
        (crop,) = self.pool.relit(rng, 1)
        if rng.random() < self.repaint:
            crop = repainted(crop, rng)
        return seen_photo(crop, flip=bool(rng.random() < 0.5))


def seen_photo(crop: LitCrop, *, flip: bool = False) -> tuple[Tensor, SeenPhoto]:
    """Features [1, PHOTO_CHANNELS, h, w] of a photo, and its truth."""
    example = to_example(crop, geometry=True, flip=flip)
    assert example.surfaces is not None
    focal = torch.tensor(crop.camera.fx / max(crop.camera.width, crop.camera.height))
    return photo_features(example.photo)[None], SeenPhoto(example.surfaces, focal)


def train_geometry(
    dataset_dir: Path,
    out: Path,
    settings: TrainingSettings,
    seed: int,
    *,
    checkpoint: Path | None = None,
    workers: int = 0,
) -> dict[str, float]:
    """Train on the rendered views below `dataset_dir`; writes `model.safetensors` and `curve.json`
    into `out` and returns the scores on photos kept aside. `workers` as in `train_sv`.
    """
    pool, aside = pools(dataset_dir, settings, seed)
    torch.manual_seed(seed)
    base = base_weights("geometry", settings, None)
    net = UNet(SHAPE) if base is None else load_network(base, "geometry")
    rng = Generator(PCG64(SeedSequence((seed, 2))))
    cases = [seen_photo(relit([crop], rng)[0]) for crop in aside.photos()]
    batches = PhotoBatches(pool, seed, settings.photos_per_step)
    original = {name: value.detach().clone() for name, value in net.state_dict().items()}
    result = fit(
        net,
        batches,
        fit_settings(settings),
        lambda n: geometry_scores(n, cases),
        checkpoint,
        _loss,
        workers,
    )
    net.load_state_dict(blended(original, result.weights, settings.blend))
    save_weights(out / "model.safetensors", "geometry", net.shape, net.state_dict())
    write_json(out / "curve.json", result.curve)
    return geometry_scores(net.eval(), cases)


def geometry_scores(net: UNet, cases: Sequence[tuple[Tensor, SeenPhoto]]) -> dict[str, float]:
    """Means over photos: relative error of depth after the best scale (median), and the angle of
    normals in degrees."""
    depth, angle = [], []
    with torch.no_grad():
        for features, truth in cases:
            guess, valid = read_outputs(net(features)[0].float()), indoors(truth.surfaces)
            error = (guess.log_depth - torch.log(truth.surfaces.points[2]))[valid]
            depth.append(torch.expm1((error - error.median()).abs()).mean())
            cosine = (guess.normals * truth.surfaces.normals).sum(0)[valid]
            angle.append(torch.rad2deg(torch.arccos(cosine.clamp(-1, 1))).mean())
    return {
        "depth_relative_error": float(torch.stack(depth).mean()),
        "normal_error_deg": float(torch.stack(angle).mean()),
    }


def _loss(outputs: Tensor, truth: SeenPhoto) -> Tensor:
    return geometry_loss(outputs, truth.surfaces, truth.focal)

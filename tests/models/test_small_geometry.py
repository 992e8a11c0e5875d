"""The geometry guess: what it means, what it is scored by, and that it reaches the lamp network."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from luxcore.models.small.batches import single_features
from luxcore.models.small.fit import FitSettings, fit
from luxcore.models.small.geometry import (
    ESTIMATED_TRUST,
    GEOMETRY_OUTPUTS,
    PHOTO_CHANNELS,
    estimate_surfaces,
    geometry_loss,
    read_outputs,
)
from luxcore.models.small.geometry_training import PhotoBatches, geometry_scores, seen_photo
from luxcore.models.small.network import LampNet, NetworkShape, UNet
from luxcore.models.small.samples import CropPool
from luxcore.models.small.single_view import SmallDecomposer
from luxcore.models.small.sketch import SketchRooms
from luxcore.models.small.surfaces import Surfaces
from luxcore.models.small.weights import CHANNELS, load_network, save_weights
from tests.models.sketched import TINY


@pytest.fixture(scope="module")
def pool() -> CropPool:
    return CropPool.collect(SketchRooms(1000, 32, 0), range(3), 2)


def tiny() -> UNet:
    torch.manual_seed(0)
    return UNet(NetworkShape(PHOTO_CHANNELS, GEOMETRY_OUTPUTS, TINY))


def outputs_of(truth: Surfaces, focal: torch.Tensor) -> torch.Tensor:
    """What a perfect network would answer."""
    log_depth = torch.log(truth.points[2] / 3.0)
    normals = truth.normals + torch.tensor([0, 0, 0.5]).view(3, 1, 1)
    log_focal = torch.log(focal / 0.87).expand_as(log_depth)
    return torch.cat([log_depth[None], normals, log_focal[None]])


def test_a_perfect_answer_costs_nothing_and_gives_back_the_points(pool: CropPool) -> None:
    _, truth = seen_photo(next(pool.photos()))
    outputs = outputs_of(truth.surfaces, truth.focal)
    assert float(geometry_loss(outputs[None], truth.surfaces, truth.focal)) < 1e-4
    guess = read_outputs(outputs).surfaces()
    valid = truth.surfaces.valid
    torch.testing.assert_close(
        guess.points[:, valid], truth.surfaces.points[:, valid], rtol=1e-3, atol=1e-3
    )
    assert guess.trust == ESTIMATED_TRUST


def test_a_wrong_scale_costs_less_than_a_wrong_shape(pool: CropPool) -> None:
    _, truth = seen_photo(next(pool.photos()))
    right = outputs_of(truth.surfaces, truth.focal)
    farther, tilted = right.clone(), right.clone()
    farther[0] += 0.2
    tilted[0] += torch.linspace(-0.4, 0.4, right.shape[2])
    losses = [float(geometry_loss(o[None], truth.surfaces, truth.focal)) for o in (farther, tilted)]
    assert 0 < losses[0] < losses[1]


def test_a_mirrored_photo_has_mirrored_surfaces() -> None:
    net = tiny().eval()
    torch.nn.init.normal_(net.head.weight, std=0.2)
    photo = torch.rand(3, 32, 32)
    straight, turned = (estimate_surfaces(net, view) for view in (photo, photo.flip(-1)))
    mirror = torch.tensor([-1.0, 1, 1]).view(3, 1, 1)
    assert float((straight.normals - turned.normals).abs().max()) > 1e-2
    torch.testing.assert_close(turned.points.flip(-1) * mirror, straight.points)
    torch.testing.assert_close(turned.normals.flip(-1) * mirror, straight.normals)


def test_an_untrained_network_sees_a_wall_three_metres_away() -> None:
    surfaces = read_outputs(torch.zeros(GEOMETRY_OUTPUTS, 32, 48)).surfaces()
    np.testing.assert_allclose(surfaces.points[2], 3.0, rtol=1e-5)
    np.testing.assert_allclose(surfaces.normals[2], -1.0, rtol=1e-5)
    width_m = float(surfaces.points[0, 0, -1] - surfaces.points[0, 0, 0]) * 48 / 47
    assert 2 * math.degrees(math.atan(width_m / 6)) == pytest.approx(60, abs=0.5)


def test_training_lowers_the_error_of_normals(pool: CropPool) -> None:
    cases = [seen_photo(crop) for crop in pool.photos()]
    before = geometry_scores(tiny(), cases)["normal_error_deg"]

    def loss(outputs: torch.Tensor, seen: object) -> torch.Tensor:
        return geometry_loss(outputs, seen.surfaces, seen.focal)  # type: ignore[attr-defined]

    settings = FitSettings(steps=25, rate=3e-3, warmup=2, ema=0.5, check_every=25)
    result = fit(
        tiny(), PhotoBatches(pool, 0, 3), settings, lambda n: geometry_scores(n, cases), None, loss
    )
    assert result.curve[-1]["normal_error_deg"] < 0.8 * before


def test_a_lone_photo_is_told_the_guess_and_half_trusts_it(pool: CropPool) -> None:
    _, truth = seen_photo(next(pool.photos()))
    crop = next(pool.photos())
    from luxcore.models.small.examples import to_example

    example = to_example(crop, geometry=False)
    blind, told = single_features(example, None), single_features(example, tiny())
    trust_channel = 26
    assert not blind[:, trust_channel].any()
    assert (told[:, trust_channel] == ESTIMATED_TRUST).all()
    assert truth.surfaces.trust == 1.0


def test_weights_come_back_and_change_what_a_lone_photo_gives(
    pool: CropPool, tmp_path: Path
) -> None:
    path = tmp_path / "geometry.safetensors"
    net = tiny()
    save_weights(path, "geometry", net.shape, net.state_dict())
    loaded = load_network(path, "geometry")
    assert type(loaded) is UNet
    crop = next(pool.photos())
    lamps = LampNet(NetworkShape(*CHANNELS["sv"], TINY)).eval()
    image = crop.image_linear.astype(np.float32)
    masks, on = crop.masks, np.ones(len(crop.masks), bool)
    alone = SmallDecomposer(lamps, 32).decompose(image, masks, on, None, 0)
    guessed = SmallDecomposer(lamps, 32, loaded).decompose(image, masks, on, None, 0)
    assert not np.allclose(alone.olat, guessed.olat)
    np.testing.assert_allclose(
        guessed.ambient + guessed.contributions().sum(0), image, rtol=1e-3, atol=1e-3
    )

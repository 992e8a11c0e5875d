"""The tables: exact on predictions that are known, and whole on a small dataset."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from luxcore.data.crops import LitCrop
from luxcore.errors import InputError
from luxcore.evaluate.baselines import BASELINES
from luxcore.evaluate.captures import capture_group, smaller
from luxcore.evaluate.cases import LampCase, photo_of
from luxcore.evaluate.consistency import consistency_db, warped
from luxcore.evaluate.dataset import evaluation_views
from luxcore.evaluate.leakage import foreign_energy
from luxcore.evaluate.run import evaluate_models
from luxcore.evaluate.scenes import seen_by_none
from luxcore.evaluate.single import single_table
from luxcore.evaluate.table import Row, flat_metrics, mean_row, write_table
from luxcore.metrics.score import score_pair
from luxcore.models.interface import Decomposition
from luxcore.settings.evaluate import EvaluateSettings
from tests.models.sketched import sketched_crops, write_sketched_capture, write_tiny_weights


@pytest.fixture(scope="module")
def crops() -> list[LitCrop]:
    return sketched_crops(4, 48)


class Oracle:
    """Knows the truth of one crop."""

    name = "oracle"

    def __init__(self, crop: LitCrop) -> None:
        self.crop = crop

    def decompose(self, image_linear, masks, on, geometry, seed):  # type: ignore[no-untyped-def]
        exposure = np.float32(self.crop.exposure)
        scale = np.repeat(on[:, None], 3, axis=1).astype(np.float32)
        return Decomposition(self.crop.ambient * exposure, self.crop.lights * exposure, scale)


def case(crop: LitCrop) -> LampCase:
    lamp = int(np.flatnonzero(crop.masks.any((1, 2)))[0])
    return LampCase("sketch", crop, lamp)


def test_the_truth_scores_near_perfect_and_beats_every_baseline(crops: list[LitCrop]) -> None:
    crop = replace(crops[0], exposure=0.7)
    result = single_table([case(crop)], Oracle(crop), "on")
    scores = {row.method: row.scores["psnr"] for row in result.rows}
    assert set(BASELINES) < set(scores)
    best = max(scores[name] for name in BASELINES)
    assert scores["oracle, photo alone"] > max(best + 6, 40)
    assert result.recomposition_db > 35


@pytest.mark.parametrize("exposure", [0.3, 4.0])
def test_copying_a_photo_of_one_light_is_that_light_unscaled_too(
    crops: list[LitCrop], exposure: float
) -> None:
    asked = case(crops[0])
    # Within what an 8-bit picture shows at either exposure.
    lights = np.clip(asked.crop.lights, 0.05, 2.0)
    alone = np.arange(len(lights)) == asked.lamp
    dark = np.zeros_like(asked.crop.ambient)
    crop = replace(asked.crop, lights=lights, on=alone, ambient=dark, exposure=exposure)
    lit = replace(asked, crop=crop)
    score = score_pair(BASELINES["copy the input"](lit), lit.truth, exposure)
    assert min(score["psnr"], score["psnr_picture"], score["psnr_unscaled"]) > 45


class Noted(Oracle):
    """Remembers the seeds that it was given."""

    def __init__(self, crop: LitCrop) -> None:
        super().__init__(crop)
        self.seeds: list[int] = []

    def decompose(self, image_linear, masks, on, geometry, seed):  # type: ignore[no-untyped-def]
        self.seeds.append(seed)
        return super().decompose(image_linear, masks, on, geometry, seed)


def test_models_that_sample_are_given_the_seed(crops: list[LitCrop]) -> None:
    noted = Noted(crops[0])
    single_table([case(crops[0])], noted, "lamp on", 7)
    assert noted.seeds == [7, 7]


def test_views_that_a_stage_was_trained_on_are_not_scored() -> None:
    assert seen_by_none(12, (4, 4)) == [3, 7, 11]
    assert seen_by_none(12, (4, 3)) == [11]
    assert seen_by_none(12, (4, 24)) == []


def test_a_photo_of_a_case_is_clipped_and_rounded(crops: list[LitCrop]) -> None:
    crop = replace(crops[0], exposure=100.0)
    photo = photo_of(crop)
    # White is 16.3; a tinted white comes back a little above it in its strongest channel.
    assert photo.max() < 30 < crop.image_linear.max() * crop.exposure
    assert np.isfinite(photo).all()


def test_warping_a_view_into_itself_changes_nothing(crops: list[LitCrop]) -> None:
    crop = crops[0]
    moved = warped(crop, crop.lights, crop)
    inside = (slice(None), slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(moved[inside], crop.lights[inside], rtol=1e-3, atol=1e-4)
    assert min(consistency_db(crop, crop, [0])) > 60


def test_true_lights_agree_across_views_and_scaled_ones_do_not(crops: list[LitCrop]) -> None:
    first, second = crops[0], crops[1]
    agreed = consistency_db(first, second, [0])
    wrong = consistency_db(first, replace(second, lights=second.lights * 2), [0])
    assert agreed
    assert np.mean(agreed) > np.mean(wrong) + 3


def test_leakage_is_the_share_inside_other_burning_masks() -> None:
    light = np.ones((10, 10, 3), np.float32)
    masks = np.zeros((3, 10, 10), bool)
    masks[0, 0], masks[1, 5], masks[2, 7] = True, True, True
    on = np.array([True, True, False])
    assert foreign_energy(light, masks, on, 0) == pytest.approx(0.1)
    assert foreign_energy(light * 0, masks, on, 0) is None
    assert foreign_energy(light, masks[:1], on[:1], 0) is None


def test_rows_are_means_and_missing_scores_stay_missing(tmp_path: Path) -> None:
    row = mean_row("A, b", "on", [{"psnr": 10.0, "lpips": None}, {"psnr": 20.0, "lpips": None}])
    assert row.scores["psnr"] == 15.0
    assert row.scores["lpips"] is None
    assert flat_metrics("single", [row]) == {"single_a_b_on_psnr": 15.0}
    write_table(tmp_path, "t", "Title", [row], {"paper's": (27.68, 0.898, 0.082)})
    text = (tmp_path / "t.md").read_text()
    assert "| A, b | on | 2 | 15.00 | – |" in text
    assert "27.68 | 0.898 | 0.082" in text
    assert json.loads((tmp_path / "t.json").read_text())["rows"][0]["count"] == 2


def test_an_empty_row_has_no_numbers() -> None:
    assert mean_row("a", "b", []) == Row("a", "b", 0, dict.fromkeys(mean_row("a", "b", []).scores))


def test_a_capture_with_truth_becomes_a_group(tmp_path: Path) -> None:
    folders = write_sketched_capture(tmp_path, 4, size_px=40)
    group = capture_group(folders["capture"], folders["masks"], 3, 32)
    assert group is not None
    assert [crop.camera.width for crop in group] == [32, 32, 32]
    assert group[0].masks[0].any()
    truths = [smaller(crop, 32).depth_m for crop in sketched_crops(4, 40)]
    for crop in group:
        assert min(float(np.abs(crop.depth_m - truth).max()) for truth in truths) < 1e-3


def test_the_multi_view_table_is_whole(tmp_path: Path) -> None:
    folders = write_sketched_capture(tmp_path, 3, size_px=40)
    sv, mv = write_tiny_weights(tmp_path)
    metrics = evaluate_models(
        [],
        [(folders["capture"], folders["masks"])],
        tmp_path / "out",
        EvaluateSettings(capture_views=3, options={"long_side_px": 32}),
        sv_weights=sv,
        mv_weights=mv,
    )
    table = (tmp_path / "out" / "tables" / "multi.md").read_text()
    for words in ("SV per view", "depth warp alone", "MV without warp", "predicted reference"):
        assert words in table
    assert metrics["multi_mv_true_reference_psnr"] > metrics["multi_sv_per_view_no_reference_psnr"]


def test_a_folder_without_views_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        evaluation_views(tmp_path)
    with pytest.raises(InputError, match="does not exist"):
        evaluation_views(tmp_path / "none")

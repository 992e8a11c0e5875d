"""The public evaluation list: read, checked, and cut from scenes in the public layout."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from luxcore.data.crops import ViewSource
from luxcore.data.public_writer import write_scene, write_shards
from luxcore.errors import FormatError, InputError
from luxcore.evaluate import public_run
from luxcore.evaluate.multi import MultiModels
from luxcore.evaluate.public_cases import (
    CaseList,
    PublicCamera,
    PublicGroups,
    SceneCameras,
    public_cases,
    read_cameras,
    read_case_list,
)
from luxcore.models.interface import Decomposition, Geometry, Reference, View
from luxcore.settings.evaluate import EvaluateSettings
from tests.models_paper.room import panorama

SIDE = 48
LIST: dict[str, Any] = {
    "mv_eval_views": ["0001", "0003"],
    "scenes": {"014649": {"view_id": "0001", "pass_ids": ["1001", "1002"]}},
}


def camera(view: str, azimuth: float, elevation: float = 0.0, fov: float = 90.0) -> dict[str, Any]:
    return {"view_id": view, "azimuth": azimuth, "elevation": elevation, "fov": fov}


def cameras_of() -> dict[str, Any]:
    multi = []
    for number in range(4):
        entry = camera("0001" if number < 2 else "0002", 0.3 * number)
        multi.append({**entry, "mv_id": number, "pano_view_id": entry.pop("view_id")})
    return {"014649": {"sv": camera("0001", 0.0), "mv": multi}}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("public")
    write_scene(root, "014649", [panorama(), panorama(offset_m=0.5)])
    return root


@pytest.fixture
def listed(tmp_path: Path) -> tuple[CaseList, dict[str, SceneCameras]]:
    (tmp_path / "cases.json").write_text(json.dumps(LIST))
    (tmp_path / "cameras.json").write_text(json.dumps(cameras_of()))
    return read_case_list(tmp_path / "cases.json"), read_cameras(tmp_path / "cameras.json")


def test_cases_and_images_are_counted_as_the_paper_does(tmp_path: Path) -> None:
    """112 cases of 14 views are 1,568 images."""
    scenes = {f"{i:06d}": {"view_id": "0001", "pass_ids": ["1001"]} for i in range(112)}
    views = [f"{number:04d}" for number in range(2, 29, 2)]
    path = tmp_path / "cases.json"
    path.write_text(json.dumps({"mv_eval_views": views, "scenes": scenes}))
    listed = read_case_list(path)
    assert (listed.cases, listed.multi_images) == (112, 1568)


def test_every_listed_lamp_is_a_case(
    dataset: Path, listed: tuple[CaseList, dict[str, SceneCameras]]
) -> None:
    cases = public_cases(dataset, *listed, side_px=SIDE)
    assert [(case.scene, case.lamp) for case in cases] == [("014649", 0), ("014649", 1)]
    for case in cases:
        assert case.crop.ambient.shape == (SIDE, SIDE, 3)
        assert case.crop.exposure == 1.0
        assert case.truth.any()
    assert cases[0].crop is cases[1].crop  # one photo in memory for all of its lamps


def test_lamps_that_are_not_listed_are_part_of_the_ambient_light(
    dataset: Path, listed: tuple[CaseList, dict[str, SceneCameras]]
) -> None:
    both, cameras = listed
    one = replace(both, scenes=(replace(both.scenes[0], passes=(1002,)),))
    [case] = public_cases(dataset, one, cameras, side_px=SIDE)
    whole = public_cases(dataset, both, cameras, side_px=SIDE)[1].crop
    assert len(case.crop.on) == 1
    np.testing.assert_allclose(case.crop.lights[0], whole.lights[1])
    np.testing.assert_allclose(case.crop.image_linear, whole.image_linear, rtol=1e-6)


def test_groups_begin_with_the_reference_and_keep_the_list_s_order(
    dataset: Path, listed: tuple[CaseList, dict[str, SceneCameras]]
) -> None:
    [group] = PublicGroups(dataset, *listed, side_px=SIDE)
    assert len(group) == 3
    reference = public_cases(dataset, *listed, side_px=SIDE)[0].crop
    np.testing.assert_array_equal(group[0].image_linear, reference.image_linear)
    offsets = [float(np.linalg.norm(c.camera.centre - group[0].camera.centre)) for c in group]
    np.testing.assert_allclose(offsets, [0, 0, 0.5], atol=1e-5)


def test_shards_serve_as_well_as_folders(
    tmp_path: Path, dataset: Path, listed: tuple[CaseList, dict[str, SceneCameras]]
) -> None:
    write_shards([dataset / "014649"], tmp_path, "test")
    ours = public_cases(tmp_path, *listed, side_px=SIDE)[0].crop
    theirs = public_cases(dataset, *listed, side_px=SIDE)[0].crop
    np.testing.assert_array_equal(ours.image_linear, theirs.image_linear)


@pytest.mark.parametrize(
    ("azimuth", "elevation"), [(0.0, 0.0), (math.pi / 2, 0.0), (4.577, 0.025), (7.56, -0.41)]
)
def test_a_camera_looks_where_the_layout_says(azimuth: float, elevation: float) -> None:
    """In the layout's axes (y up) a panorama's column u shows the direction whose atan2(x, -z) is
    2π(u - 1/2), its row v that whose acos(y) is πv; a camera looks along minus its own place."""
    place = np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.sin(elevation),
            math.cos(elevation) * math.sin(azimuth),
        ]
    )
    x, y, z = -place
    view = panorama(height=128)
    u = math.atan2(x, -z) / (2 * math.pi) + 0.5
    v = math.acos(y) / math.pi
    spot = np.zeros_like(view.ambient)
    spot[int(v * 128), int(u * 256) % 256] = 1.0
    right = np.zeros_like(view.ambient)
    right[int(v * 128), int(u * 256 + 12) % 256] = 1.0
    crop = PublicCamera(1, azimuth, elevation, 60.0).cut(
        ViewSource(replace(view, ambient=spot)), side_px=65
    )
    rows, columns = np.nonzero(crop.ambient[..., 0] > 0.2)
    # A panorama's pixel is 1.4 degrees, a photo's one: it lands within two pixels of the middle.
    assert abs(rows.mean() - 32) < 2.5
    assert abs(columns.mean() - 32) < 2.5
    aside = PublicCamera(1, azimuth, elevation, 60.0).cut(
        ViewSource(replace(view, ambient=right)), side_px=65
    )
    assert np.nonzero(aside.ambient[..., 0] > 0.2)[1].mean() > 40


def test_missing_scenes_lamps_and_views_are_named(
    dataset: Path, listed: tuple[CaseList, dict[str, SceneCameras]]
) -> None:
    both, cameras = listed
    scene = both.scenes[0]
    other = replace(both, scenes=(replace(scene, scene_id="015063"),))
    with pytest.raises(InputError, match="lacks 1 listed scenes, the first is 015063"):
        public_cases(dataset, other, cameras)
    with pytest.raises(InputError, match="list of cameras lacks"):
        public_cases(dataset, both, {})
    lamp = replace(both, scenes=(replace(scene, passes=(1007,)),))
    with pytest.raises(InputError, match="scene 014649 has no OLAT pass 1007"):
        public_cases(dataset, lamp, cameras)
    views = replace(both, multi_views=(31,))
    with pytest.raises(InputError, match="lack view 31"):
        PublicGroups(dataset, views, cameras)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        '{"mv_eval_views": [], "scenes": {}}',
        '{"mv_eval_views": [], "scenes": {"../x": {"view_id": "1", "pass_ids": ["1001"]}}}',
        '{"mv_eval_views": [], "scenes": {"014649": {"view_id": "1", "pass_ids": []}}}',
        '{"mv_eval_views": ["x"], "scenes": {"014649": {"view_id": "1", "pass_ids": ["1"]}}}',
    ],
)
def test_another_file_is_refused_as_a_case_list(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cases.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=r"cases\.json"):
        read_case_list(path)


@pytest.mark.parametrize(
    "entry",
    [
        {"sv": camera("0001", math.nan), "mv": []},
        {"sv": camera("0001", 0.0, fov=180.0), "mv": []},
        {"sv": {}, "mv": []},
        [],
    ],
)
def test_bad_cameras_are_refused(tmp_path: Path, entry: Any) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"014649": entry}))
    with pytest.raises(FormatError, match=r"cameras\.json"):
        read_cameras(path)
    with pytest.raises(InputError, match="does not exist"):
        read_cameras(tmp_path / "none.json")


class Copying:
    """Says that each lamp's light is the photo itself."""

    name = "copying"

    def decompose(
        self,
        image_linear: np.ndarray,
        masks: np.ndarray,
        on: np.ndarray,
        geometry: Geometry | None,
        seed: int,
    ) -> Decomposition:
        scale = np.repeat(on[:, None], 3, axis=1).astype(np.float32)
        return Decomposition(0 * image_linear, np.stack([image_linear] * len(masks)), scale)

    def run_pass(
        self, views: Sequence[View], references: Sequence[Reference], seed: int
    ) -> list[Decomposition]:
        return [self.decompose(v.image_linear, v.masks, v.on, None, seed) for v in views]


def test_both_tables_are_made_on_the_listed_cases(
    tmp_path: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models = MultiModels(Copying(), Copying(), None)
    monkeypatch.setattr(public_run, "open_models", lambda *_: models)
    scenes = {"014649": {"view_id": "0001", "pass_ids": ["1001"]}}
    (tmp_path / "cases.json").write_text(json.dumps({**LIST, "scenes": scenes}))
    (tmp_path / "cameras.json").write_text(json.dumps(cameras_of()))
    metrics = public_run.evaluate_public(
        dataset,
        tmp_path / "cases.json",
        tmp_path / "cameras.json",
        tmp_path / "out",
        EvaluateSettings(size_px=64),
    )
    assert (metrics["public_cases"], metrics["public_images"]) == (1, 2)
    single = json.loads((tmp_path / "out" / "tables" / "public_single.json").read_text())
    multi = json.loads((tmp_path / "out" / "tables" / "public_multi.json").read_text())
    assert {row["count"] for row in single["rows"]} == {1}
    assert {row["count"] for row in multi["rows"]} == {2}
    assert all(np.isfinite(value) for value in metrics.values())

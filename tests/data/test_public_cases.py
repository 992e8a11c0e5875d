"""The paper's evaluation list on public scenes: right cameras, right lamp, clear refusals."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from analytic import panorama

from luxcore.data.panorama import directions_of_pixels
from luxcore.data.public_cases import PaperPose, paper_crop, paper_crops, read_paper_scenes
from luxcore.data.public_reader import open_scenes
from luxcore.data.public_writer import write_scene
from luxcore.errors import FormatError, InputError

CAMERA = {"fov": 70.0, "azimuth": 1.2, "elevation": -0.1}


def lists(folder: Path, **changes) -> tuple[Path, Path]:
    cases = {
        "mv_eval_views": ["0001"],
        "scenes": {"014649": {"view_id": "0002", "pass_ids": ["1001", "1003"]}},
    } | changes
    cameras = {
        "014649": {
            "sv": {**CAMERA, "view_id": "0002"},
            "mv": [{**CAMERA, "mv_id": i, "pano_view_id": f"{2 - i:04d}"} for i in (1, 0)],
        }
    }
    (folder / "cases.json").write_text(json.dumps(cases))
    (folder / "cameras.json").write_text(json.dumps(cameras))
    return folder / "cases.json", folder / "cameras.json"


def test_cases_and_cameras_are_joined(tmp_path):
    [scene] = read_paper_scenes(*lists(tmp_path))
    assert scene.passes == (1001, 1003)
    assert scene.single == PaperPose(2, 1.2, -0.1, 70.0)
    assert [pose.view for pose in scene.multi] == [2, 1]
    assert scene.scored == (1,)


@pytest.mark.parametrize(("phi", "theta"), [(0.3, 0.1), (4.577, 0.025), (7.6, -0.34), (3.0, 0.0)])
def test_direction_is_that_of_the_public_tools(phi, theta):
    rotation = PaperPose(1, phi, theta, 70.0).rotation
    # Their latitude-longitude map: column (atan2(x, −z)/2π + ½)·W, row acos(y)/π·H, y up.
    x, y, z = -np.array([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)])
    height, width = 512, 1024
    column = (np.arctan2(x, -z) / (2 * np.pi) + 0.5) * width
    row = np.arccos(y) / np.pi * height
    ours = directions_of_pixels(height, width)[int(row), int(column) % width]
    assert ours @ rotation[:, 2] > np.cos(np.radians(0.5))
    # The picture's right points to falling azimuth, as columns grow: not mirrored.
    right = directions_of_pixels(height, width)[height // 2, (int(column) + 5) % width]
    assert right @ rotation[:, 0] > 0
    assert rotation[2, 1] < 0


def test_case_is_a_photo_with_its_lamp_first(tmp_path):
    views = [panorama(height=32), panorama((4.0, 3.0, 1.4), height=32)]
    write_scene(tmp_path, "014649", views)
    [scene] = open_scenes(tmp_path)
    [paper] = read_paper_scenes(*lists(tmp_path))
    crop = paper_crop(scene, paper.single, 1003, side_px=24)
    assert crop.image_linear.shape == (24, 24, 3)
    assert crop.on.all()
    full = paper_crop(scene, paper.single, 1001, side_px=24)
    assert np.allclose(full.image_linear, crop.image_linear, rtol=1e-4)
    assert not np.allclose(full.lights[0], crop.lights[0])
    both = paper_crops(scene, paper.multi, 1003, side_px=16)
    assert len(both) == 2
    assert len({len(c.on) for c in both}) == 1
    with pytest.raises(InputError, match="no pass 1009"):
        paper_crop(scene, paper.single, 1009)


@pytest.mark.parametrize(
    "changes",
    [
        {"scenes": {"014650": {"view_id": "0001", "pass_ids": []}}},
        {"scenes": {"014649": {"view_id": "0001", "pass_ids": ["1001"]}}},
        {"mv_eval_views": ["0007"]},
        {"scenes": 3},
    ],
)
def test_lists_that_do_not_fit(tmp_path, changes):
    with pytest.raises(FormatError, match="do not fit together"):
        read_paper_scenes(*lists(tmp_path, **changes))


def test_lists_that_cannot_be_read(tmp_path):
    cases, cameras = lists(tmp_path)
    cases.write_text("[]")
    with pytest.raises(FormatError, match="not a JSON object"):
        read_paper_scenes(cases, cameras)
    with pytest.raises(InputError, match="does not exist"):
        read_paper_scenes(tmp_path / "none.json", cameras)

"""Training rooms: either layout gives the photos, wherever the files lie."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from luxcore.data.convert import public_to_compact
from luxcore.data.public_writer import write_scene, write_shards
from luxcore.errors import InputError
from luxcore.models.diffusion.rooms import open_photos, open_sets, photo_with_lamp
from luxcore.settings.paper_models import DataSettings
from tests.models_paper.room import panorama


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("public")
    write_scene(root, "000012", [panorama(), panorama(offset_m=0.5)])
    return root


def settings(root: Path) -> DataSettings:
    return DataSettings(root=str(root), side=64)


def test_scenes_shards_and_the_compact_form_give_photos(scenes: Path, tmp_path: Path) -> None:
    write_shards([scenes / "000012"], tmp_path / "shards", "train")
    public_to_compact(scenes, tmp_path / "compact")
    roots = (scenes, tmp_path / "shards", tmp_path / "compact")
    taken = [photo_with_lamp(open_photos(settings(root), 0), 3) for root in roots]
    np.testing.assert_array_equal(taken[0].image_linear, taken[1].image_linear)
    assert taken[2].image_linear.shape == taken[0].image_linear.shape == (64, 64, 3)
    assert len(open_sets(settings(scenes), 0).crops(0, 3)) == 3


def test_photos_of_shards_reach_the_workers_of_a_loader(scenes: Path, tmp_path: Path) -> None:
    write_shards([scenes / "000012"], tmp_path, "train")
    photos = open_photos(settings(tmp_path), 0)
    again = pickle.loads(pickle.dumps(photos))
    np.testing.assert_array_equal(again.crop(1).image_linear, photos.crop(1).image_linear)


def test_a_folder_without_rooms_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=str(tmp_path)):
        open_photos(settings(tmp_path), 0)
    with pytest.raises(InputError, match="does not exist"):
        open_photos(settings(tmp_path / "none"), 0)

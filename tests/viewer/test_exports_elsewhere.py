"""What we write, read back by libraries that share no code with us."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from viewer_scene import room_scene, save_room

from luxcore.cli.export import command
from luxcore.files.exr import write_exr
from luxcore.light.agx import agx
from luxcore.splats.gaussians import SH_C0
from luxcore.splats.relighting import LampSetting, mixing_weights

OpenImageIO = pytest.importorskip("OpenImageIO")
plyfile = pytest.importorskip("plyfile")


def test_openimageio_reads_one_part_per_lamp(tmp_path: Path) -> None:
    random = np.random.Generator(np.random.PCG64(0))
    names = ["ambient", "light_00", "light_01"]
    layers = {n: random.exponential(2, (7, 9, 3)).astype(np.float32) for n in names}
    write_exr(tmp_path / "lamps.exr", layers, half=False)
    for index, name in enumerate(names):
        part = OpenImageIO.ImageBuf(str(tmp_path / "lamps.exr"), index, 0)
        assert part.spec().get_string_attribute("oiio:subimagename") == name
        assert list(part.spec().channelnames) == ["R", "G", "B"]
        np.testing.assert_array_equal(part.get_pixels(OpenImageIO.FLOAT), layers[name])
    assert part.nsubimages == len(names)


def test_plyfile_reads_the_baked_splats(tmp_path: Path) -> None:
    room = save_room(tmp_path / "room")
    out = tmp_path / "evening.ply"
    options = [str(room), "--set", "desk=0", "--set", "floor=2", "--out", str(out)]
    assert CliRunner().invoke(command, options).exit_code == 0
    vertex = plyfile.PlyData.read(str(out))["vertex"].data
    scene = room_scene()
    assert len(vertex) == len(scene.gaussians)
    settings = {"desk": LampSetting(0.0), "floor": LampSetting(2.0)}
    light = np.einsum("nmc,mc->nc", scene.radiance, mixing_weights(scene, settings))
    colour = 0.5 + SH_C0 * np.stack([vertex[f"f_dc_{c}"] for c in range(3)], axis=1)
    np.testing.assert_allclose(colour, agx(light), atol=2e-6)
    np.testing.assert_array_equal(vertex["x"], scene.gaussians.means[:, 0])
    np.testing.assert_array_equal(vertex["scale_0"], scene.gaussians.log_scales[:, 0])
    np.testing.assert_array_equal(vertex["opacity"], scene.gaussians.opacity_logits)


def test_every_lamp_has_a_file_of_its_own(tmp_path: Path) -> None:
    room = save_room(tmp_path / "room")
    options = [str(room), "--lamps", "--out", str(tmp_path / "lamps")]
    assert CliRunner().invoke(command, options).exit_code == 0
    files = sorted((tmp_path / "lamps").iterdir())
    assert [f.name for f in files] == [
        "00_ambient.ply", "01_desk.ply", "02_wall.ply", "03_floor.ply",
    ]  # fmt: skip
    for file in files:
        assert len(plyfile.PlyData.read(str(file))["vertex"].data) == 600

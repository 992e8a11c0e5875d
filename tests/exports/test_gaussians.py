"""Baked Gaussians as PLY, SPZ and glTF, read back by other programs or from the formats' pages."""

from __future__ import annotations

import gzip
import json
import struct
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import trimesh
from plyfile import PlyData
from scipy.spatial.transform import Rotation

from luxcore.errors import InputError
from luxcore.exports.gltf import write_glb
from luxcore.exports.spz import write_spz
from luxcore.exports.upright import y_up
from luxcore.splats.gaussians import Gaussians, color_from_sh
from luxcore.splats.ply import write_ply

SCHEMA = {
    # The properties and the required ones of mesh.primitive.KHR_gaussian_splatting.
    "type": "object",
    "properties": {
        "kernel": {"const": "ellipse"},
        "colorSpace": {"enum": ["srgb_rec709_display", "lin_rec709_display"]},
        "projection": {"const": "perspective"},
        "sortingMethod": {"const": "cameraDistance"},
    },
    "required": ["kernel", "colorSpace"],
    "additionalProperties": False,
}
FORMAT = "KHR_gaussian_splatting"
COUNTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
DTYPES = {5126: "<f4", 5121: "u1"}


def make(n: int = 40, degree: int = 0, antialiased: bool = False, spread: float = 3) -> Gaussians:
    draw = np.random.Generator(np.random.PCG64(7))
    return Gaussians(
        means=draw.normal(scale=spread, size=(n, 3)).astype(np.float32),
        quats=draw.normal(size=(n, 4)).astype(np.float32),
        log_scales=draw.uniform(-6, 0, size=(n, 3)).astype(np.float32),
        opacity_logits=draw.uniform(-4, 6, size=n).astype(np.float32),
        sh=draw.uniform(-1.7, 1.7, size=(n, (degree + 1) ** 2, 3)).astype(np.float32),
        antialiased=antialiased,
    )


def covariances(quats_wxyz: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """[n, 3, 3]; the same for a quaternion and its negative."""
    turn = Rotation.from_quat(quats_wxyz[:, [1, 2, 3, 0]]).as_matrix()
    half = turn * scales[:, None, :]
    return half @ half.transpose(0, 2, 1)


def test_ply_in_plyfile(tmp_path: Path) -> None:
    gaussians = make()
    write_ply(tmp_path / "a.ply", gaussians)
    vertex = PlyData.read(str(tmp_path / "a.ply"))["vertex"]
    for column, axis in enumerate("xyz"):
        np.testing.assert_array_equal(vertex[axis], gaussians.means[:, column])
    np.testing.assert_array_equal(vertex["f_dc_1"], gaussians.sh[:, 0, 1])
    np.testing.assert_array_equal(vertex["rot_0"], gaussians.quats[:, 0])
    np.testing.assert_array_equal(vertex["scale_2"], gaussians.log_scales[:, 2])
    np.testing.assert_array_equal(vertex["opacity"], gaussians.opacity_logits)


def test_y_up_turns_ellipsoids_with_their_centres() -> None:
    gaussians, turn = make(), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    turned = y_up(gaussians)
    assert turned.means == pytest.approx(gaussians.means @ turn.T)
    scales = np.exp(gaussians.log_scales)
    before, after = covariances(gaussians.quats, scales), covariances(turned.quats, scales)
    assert after == pytest.approx(turn @ before @ turn.T, abs=1e-6)
    with pytest.raises(ValueError, match="degree 0"):
        y_up(make(degree=1))


@pytest.mark.parametrize("antialiased", [False, True])
def test_spz_by_its_published_layout(tmp_path: Path, antialiased: bool) -> None:
    gaussians = make(antialiased=antialiased)
    write_spz(tmp_path / "a.spz", gaussians)
    raw = gzip.decompress((tmp_path / "a.spz").read_bytes())
    magic, version, n, degree, bits, flags, zero = struct.unpack_from("<IIIBBBB", raw)
    assert (magic, version, n, degree) == (0x5053474E, 3, 40, 0)
    assert (bits, flags, zero) == (12, int(antialiased), 0)
    assert len(raw) == 16 + n * (9 + 1 + 3 + 3 + 4)
    read = np.frombuffer(raw, np.uint8, offset=16)
    positions, alphas, colors, scales, rotations = np.split(read, np.cumsum([9, 1, 3, 3]) * n)

    upright = y_up(gaussians)
    low, middle, high = positions.reshape(n, 3, 3).astype(np.int32).transpose(2, 0, 1)
    fixed = low | middle << 8 | high << 16
    fixed -= (fixed & 0x800000) << 1
    # Half a step of 2^-12 m; half a step of the 8-bit codes below.
    assert fixed / 4096 == pytest.approx(upright.means, abs=0.5 / 4096 + 1e-6)
    opacity = 1 / (1 + np.exp(-gaussians.opacity_logits))
    assert alphas / 255 == pytest.approx(opacity, abs=0.51 / 255)
    dc = (colors.reshape(n, 3) / 255 - 0.5) / 0.15
    assert dc == pytest.approx(gaussians.sh[:, 0], abs=0.51 / 255 / 0.15)
    logs = scales.reshape(n, 3) / 16 - 10
    assert logs == pytest.approx(gaussians.log_scales, abs=0.51 / 16)
    quats = smallest_three(rotations.view("<u4"))
    ours = upright.quats[:, [1, 2, 3, 0]] / np.linalg.norm(upright.quats, axis=1, keepdims=True)
    # 9 bits for ±0.7071: the angle between the two rotations, radians.
    angle = (Rotation.from_quat(quats).inv() * Rotation.from_quat(ours)).magnitude()
    assert angle.max() < 0.005


def smallest_three(codes: np.ndarray) -> np.ndarray:
    """x-y-z-w of 2 bits of index of the largest and three of sign and 9-bit magnitude."""
    quats = np.zeros((len(codes), 4))
    for row, code in zip(quats, codes.tolist(), strict=True):
        largest = code >> 30
        for axis in reversed(range(4)):
            if axis != largest:
                row[axis] = (-1 if code & 512 else 1) * (code & 511) / 511 * 0.5**0.5
                code >>= 10
        row[largest] = max(0.0, 1 - (row**2).sum()) ** 0.5
    return quats


def test_spz_gives_up_steps_for_range_and_says_where_it_ends(tmp_path: Path) -> None:
    wide = make(spread=3000)
    write_spz(tmp_path / "a.spz", wide)
    bits = gzip.decompress((tmp_path / "a.spz").read_bytes())[13]
    assert np.abs(wide.means).max() * 2**bits < 2**23
    assert bits < 12
    with pytest.raises(InputError, match="SPZ cannot hold a coordinate of"):
        write_spz(tmp_path / "b.spz", make(spread=1e8))
    assert not (tmp_path / "b.spz").exists()


def test_equal_spz_have_equal_bytes(tmp_path: Path) -> None:
    for name in "ab":
        write_spz(tmp_path / name, make())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def read_glb(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """The JSON chunk, and the attributes of the only primitive."""
    raw = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", raw)
    assert (magic, version, length) == (b"glTF", 2, len(raw))
    size, kind = struct.unpack_from("<I4s", raw, 12)
    document = json.loads(raw[20 : 20 + size])
    assert kind == b"JSON"
    body, kind = struct.unpack_from("<I4s", raw, 20 + size)
    assert kind == b"BIN\0"
    assert size % 4 == body % 4 == 0
    binary = raw[28 + size :]
    assert document["buffers"] == [{"byteLength": len(binary)}]
    arrays = {}
    for name, index in document["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        columns, kind = COUNTS[accessor["type"]], np.dtype(DTYPES[accessor["componentType"]])
        assert view["byteOffset"] % 4 == 0
        assert view["byteLength"] == accessor["count"] * columns * kind.itemsize
        values = np.frombuffer(binary, kind, accessor["count"] * columns, view["byteOffset"])
        arrays[name] = values.reshape(-1, columns)
    return document, arrays


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_glb_by_the_extension(tmp_path: Path, degree: int) -> None:
    gaussians = make(n=41, degree=degree)
    write_glb(tmp_path / "a.glb", gaussians)
    document, arrays = read_glb(tmp_path / "a.glb")
    primitive = document["meshes"][0]["primitives"][0]
    assert document["extensionsUsed"] == [FORMAT]
    assert primitive["mode"] == 0
    jsonschema.validate(primitive["extensions"][FORMAT], SCHEMA)

    position = document["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal(arrays["POSITION"], gaussians.means)
    assert position["min"] == gaussians.means.min(0).tolist()
    assert position["max"] == gaussians.means.max(0).tolist()
    # Linear scales, opacities in 0..1, unit quaternions x-y-z-w: the three that writers get wrong.
    scale, turn = arrays[f"{FORMAT}:SCALE"], arrays[f"{FORMAT}:ROTATION"]
    assert scale == pytest.approx(np.exp(gaussians.log_scales), rel=1e-6)
    assert np.linalg.norm(turn, axis=1) == pytest.approx(1, abs=1e-6)
    theirs = covariances(turn[:, [3, 0, 1, 2]], scale)
    ours = covariances(gaussians.quats, np.exp(gaussians.log_scales))
    assert theirs == pytest.approx(ours, abs=1e-6)
    opacity = 1 / (1 + np.exp(-gaussians.opacity_logits[:, None]))
    assert arrays[f"{FORMAT}:OPACITY"] == pytest.approx(opacity, abs=1e-6)
    names = [f"{FORMAT}:SH_DEGREE_{d}_COEF_{i}" for d in range(4) for i in range(2 * d + 1)]
    assert [name for name in arrays if "SH_DEGREE" in name] == names[: (degree + 1) ** 2]
    for index, name in enumerate(names[: (degree + 1) ** 2]):
        np.testing.assert_array_equal(arrays[name], gaussians.sh[:, index])


def test_trimesh_shows_the_glb_as_a_coloured_cloud_y_up(tmp_path: Path) -> None:
    gaussians = make()
    write_glb(tmp_path / "a.glb", gaussians)
    scene = trimesh.load_scene(tmp_path / "a.glb")
    cloud = scene.to_geometry()
    assert cloud.vertices == pytest.approx(y_up(gaussians).means, abs=1e-5)
    display = color_from_sh(gaussians.sh).clip(0, 1)
    linear = np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)
    # trimesh keeps colours in 8 bits.
    assert cloud.colors[:, :3] / 255 == pytest.approx(linear, abs=1.01 / 255)

"""Files that a scene names are judged before another program opens it."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from luxcore.errors import FormatError, InputError
from luxcore.imports import import_room


def _gltf(folder: Path, uri: str) -> Path:
    (folder / "a.gltf").write_text(json.dumps({"buffers": [{"uri": uri}], "asset": {}}))
    return folder / "a.gltf"


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/passwd", "%2e%2e/secret.bin"])
def test_gltf_outside(tmp_path: Path, uri: str) -> None:
    with pytest.raises(InputError, match="outside its folder"):
        import_room(_gltf(tmp_path, uri))


def test_binary_gltf_outside(tmp_path: Path) -> None:
    text = json.dumps({"buffers": [{"uri": "../a.bin"}]}).encode()
    header = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON")
    (tmp_path / "a.glb").write_bytes(header + text)
    with pytest.raises(InputError, match="outside its folder"):
        import_room(tmp_path / "a.glb")
    (tmp_path / "a.glb").write_bytes(header[:9])
    with pytest.raises(FormatError, match="not readable glTF"):
        import_room(tmp_path / "a.glb")


def test_gltf_from_elsewhere(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing is fetched"):
        import_room(_gltf(tmp_path, "https://example.org/a.bin"))


@pytest.mark.parametrize("text", ["", "{", "[]", '{"buffers": 3}', '{"buffers": [4]}'])
def test_damaged_gltf(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.gltf").write_text(text)
    with pytest.raises(FormatError, match="not readable glTF"):
        import_room(tmp_path / "a.gltf")


def test_obj_and_its_materials_outside(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib ../other.mtl\nv 0 0 0\n")
    with pytest.raises(InputError, match=r"other\.mtl.*outside"):
        import_room(tmp_path / "a.obj")
    (tmp_path / "a.obj").write_text("mtllib in.mtl\nv 0 0 0\n")
    (tmp_path / "in.mtl").write_text("newmtl m\nmap_Kd -s 1 1 1 ../../picture.png\n")
    with pytest.raises(InputError, match=r"picture\.png.*outside"):
        import_room(tmp_path / "a.obj")


def test_usd_text_outside(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0\n(subLayers = [@../../other.usda@])\n")
    with pytest.raises(InputError, match=r"other\.usda.*outside"):
        import_room(tmp_path / "a.usda")


@pytest.mark.parametrize(
    ("name", "fact"), [("absent.blend", "does not exist"), ("a.fbx", "is none of")]
)
def test_files_that_cannot_be_imported(tmp_path: Path, name: str, fact: str) -> None:
    (tmp_path / "a.fbx").write_text("x")
    with pytest.raises(InputError, match=fact):
        import_room(tmp_path / name)

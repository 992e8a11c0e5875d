"""Scene files of other programs as plain data, read by Blender in a process of its own."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.errors import FormatError, InputError, LuxError
from luxcore.imports.links import check_inside, check_text_links
from luxcore.render.process import BlenderProcess

SERVER = "luxcore.imports.blender.server"
SUFFIXES = frozenset({".blend", ".gltf", ".glb", ".obj", ".usd", ".usda", ".usdc", ".usdz"})
MAX_BYTES = 2_000_000_000
TIMEOUT_S = 180.0


@dataclass(frozen=True)
class SceneMesh:
    """One object: world-space vertices [n, 3] in the file's units, polygons, materials."""

    name: str
    parent: str | None
    vertices: np.ndarray
    faces: tuple[tuple[int, ...], ...]
    slots: np.ndarray
    """[faces] index into `materials`."""
    materials: tuple[dict[str, Any], ...]


@dataclass(frozen=True)
class SceneData:
    """What a file holds: meshes, lights and cameras as Blender describes them."""

    path: Path
    meshes: tuple[SceneMesh, ...]
    lights: tuple[dict[str, Any], ...]
    cameras: tuple[dict[str, Any], ...]
    unit_m: float
    """Metres in one unit of the file."""


def read_scene_file(path: Path) -> SceneData:
    """Read a .blend, glTF, USD or OBJ file, or a folder of OBJ files.

    Raises InputError (missing, unknown kind, links outside its folder) or FormatError (unreadable).
    """
    paths = _files(Path(path))
    root = paths[0].parent.resolve()
    for file in paths:
        check_text_links(file, root)
    process = BlenderProcess(SERVER)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "meshes.npz"
        request = {"paths": [str(p.resolve()) for p in paths], "out": str(out)}
        try:
            answer = process.request(request, TIMEOUT_S)
        except LuxError as error:
            raise FormatError(f"{path} is not a readable scene: {error}") from error
        finally:
            process.stop()
        for link in answer["links"]:
            check_inside(paths[0], link, root)
        with np.load(out, allow_pickle=False) as arrays:
            meshes = tuple(_mesh(f, i, arrays) for i, f in enumerate(answer["meshes"]))
    if not meshes:
        raise FormatError(f"{path} holds no surfaces.")
    return SceneData(
        Path(path),
        meshes,
        tuple(answer["lights"]),
        tuple(answer["cameras"]),
        float(answer["scale_length"]),
    )


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix.lower() == ".obj")
        if not files:
            raise InputError(f"{path} is a folder without .obj files.")
    elif path.is_file():
        files = [path]
    else:
        raise InputError(f"{path} does not exist.")
    if files[0].suffix.lower() not in SUFFIXES:
        raise InputError(f"{path} is none of {', '.join(sorted(SUFFIXES))}.")
    if sum(f.stat().st_size for f in files) > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES} bytes.")
    return files


def _mesh(facts: dict[str, Any], index: int, arrays: Any) -> SceneMesh:
    corners, sizes = arrays[f"m{index}c"], arrays[f"m{index}n"]
    ends = np.cumsum(sizes)
    faces = [tuple(int(v) for v in corners[e - n : e]) for e, n in zip(ends, sizes, strict=True)]
    if arrays[f"m{index}f"]:
        faces = [face[::-1] for face in faces]
    return SceneMesh(
        facts["name"],
        facts["parent"],
        arrays[f"m{index}v"].astype(float),
        tuple(faces),
        arrays[f"m{index}s"],
        tuple(facts["materials"]),
    )

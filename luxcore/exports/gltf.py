"""Binary glTF 2.0 with KHR_gaussian_splatting, as ratified by Khronos: kernel "ellipse".

One primitive of POINTS; viewers that do not know the extension show a coloured point cloud. Scales
are linear, opacities 0..1, rotations x-y-z-w; colours are display-referred sRGB as spherical
harmonics. glTF is y up, so the node that holds the mesh is turned; attributes stay as they are.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from luxcore.errors import InputError
from luxcore.files.atomic import atomic_file
from luxcore.splats.gaussians import Gaussians, color_from_sh

EXTENSION = "KHR_gaussian_splatting"
_PROPERTIES = {
    "kernel": "ellipse",
    "colorSpace": "srgb_rec709_display",
    "projection": "perspective",
    "sortingMethod": "cameraDistance",
}
_Z_TO_Y = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Quaternion x-y-z-w of the node: z up becomes y up."""
_POINTS, _ARRAY_BUFFER = 0, 34962
_FLOAT, _UNSIGNED_BYTE = 5126, 5121
_TYPE = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


def write_glb(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians of any degree of spherical harmonics, atomically.

    Raises InputError where there are none: glTF knows no empty arrays.
    """
    if len(gaussians) == 0:
        raise InputError(f"{path}: glTF cannot hold a scene of 0 Gaussians.")
    attributes = _attributes(gaussians)
    views, accessors, blob = _pack(attributes)
    primitive = {
        "attributes": {name: index for index, name in enumerate(attributes)},
        "mode": _POINTS,
        "extensions": {EXTENSION: _PROPERTIES},
    }
    document = {
        "asset": {"version": "2.0", "generator": "LuxRemix"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "rotation": _Z_TO_Y}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    # Chunks are multiples of four bytes: text is filled with spaces.
    text += b" " * (-len(text) % 4)
    with atomic_file(Path(path)) as temporary, open(temporary, "wb") as stream:
        stream.write(struct.pack("<III", _MAGIC, 2, 12 + 8 + len(text) + 8 + len(blob)))
        stream.write(struct.pack("<II", len(text), _JSON) + text)
        stream.write(struct.pack("<II", len(blob), _BIN) + blob)


def _attributes(gaussians: Gaussians) -> dict[str, np.ndarray]:
    """Attribute → [n, components], in the order in which they are written."""
    quats = gaussians.quats / np.linalg.norm(gaussians.quats, axis=1, keepdims=True)
    opacity = 1.0 / (1.0 + np.exp(-gaussians.opacity_logits.astype(np.float64)))
    attributes = {
        "POSITION": gaussians.means.astype("<f4"),
        "COLOR_0": _point_colors(gaussians, opacity),
        f"{EXTENSION}:ROTATION": quats[:, [1, 2, 3, 0]].astype("<f4"),
        f"{EXTENSION}:SCALE": np.exp(gaussians.log_scales).astype("<f4"),
        f"{EXTENSION}:OPACITY": opacity[:, None].astype("<f4"),
    }
    for degree in range(gaussians.sh_degree + 1):
        for order in range(2 * degree + 1):
            name = f"{EXTENSION}:SH_DEGREE_{degree}_COEF_{order}"
            attributes[name] = gaussians.sh[:, degree**2 + order].astype("<f4")
    return attributes


def _point_colors(gaussians: Gaussians, opacity: np.ndarray) -> np.ndarray:
    """COLOR_0 [n, 4], which glTF takes as linear light; 8 bits, which every reader knows."""
    display = color_from_sh(gaussians.sh).clip(0, 1).astype(np.float64)
    low = display <= 0.04045
    linear = np.where(low, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)
    return np.round(255 * np.column_stack([linear, opacity])).astype(np.uint8)


def _pack(
    attributes: Mapping[str, np.ndarray],
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], bytes]:
    """(buffer views, accessors, bytes); every attribute in a view of its own."""
    views, accessors, blob = [], [], b""
    for index, (name, values) in enumerate(attributes.items()):
        view = {"buffer": 0, "byteOffset": len(blob), "byteLength": values.nbytes}
        views.append({**view, "target": _ARRAY_BUFFER})
        integers = values.dtype.kind == "u"
        accessor: dict[str, Any] = {
            "bufferView": index,
            "componentType": _UNSIGNED_BYTE if integers else _FLOAT,
            "count": len(values),
            "type": _TYPE[values.shape[1]],
        }
        if integers:
            accessor["normalized"] = True
        if name == "POSITION":
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        accessors.append(accessor)
        # Every element is of a multiple of four bytes, so views stay aligned.
        blob += np.ascontiguousarray(values).tobytes()
    return views, accessors, blob

"""What a room is looked at through: a panorama or a pinhole camera, and their JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera, camera_from_nerfstudio, camera_to_nerfstudio
from luxcore.errors import InputError
from luxcore.rooms.shapes import Vec3

ENVIRONMENT_DISTANCE_M = 1000.0
"""`ray_distance_m` where a ray leaves through an opening."""


@dataclass(frozen=True)
class PanoramaView:
    """An equirectangular image [h, 2h] from `position`; its centre looks along yaw (world +x)."""

    position: Vec3
    width: int
    height: int
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.width != 2 * self.height or self.height < 2:
            raise InputError(
                f"a panorama must be twice as wide as high, got {self.width}x{self.height}."
            )

    @property
    def c2w(self) -> Float[np.ndarray, "4 4"]:
        """The panorama's rotation about z and its centre, in metres."""
        yaw = np.radians(self.yaw_deg)
        matrix = np.eye(4)
        matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        matrix[:3, 3] = self.position
        return matrix


View = PanoramaView | Camera


def view_to_json(view: View) -> dict[str, Any]:
    """One nerfstudio frame for a pinhole; width, height, position and yaw for a panorama."""
    if isinstance(view, PanoramaView):
        return {
            "kind": "panorama",
            "camera": {
                "camera_model": "EQUIRECTANGULAR",
                "w": view.width,
                "h": view.height,
                "position": list(view.position),
                "yaw_deg": view.yaw_deg,
                "transform_matrix": view.c2w.tolist(),
            },
        }
    return {"kind": "perspective", "camera": camera_to_nerfstudio(view)}


def view_from_json(value: dict[str, Any]) -> View:
    """The inverse of `view_to_json`; other keys are ignored."""
    camera = value["camera"]
    if value["kind"] == "panorama":
        x, y, z = camera["position"]
        return PanoramaView((x, y, z), camera["w"], camera["h"], camera["yaw_deg"])
    return camera_from_nerfstudio(camera)

"""One photo cut out of a rendered view: every light that falls into it, its masks, its surfaces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

from luxcore.cameras import Camera
from luxcore.data.compact import MASK_KINDS, RenderedView
from luxcore.data.panorama import depth_from_distance, focal_length, padded, sample_padded


@dataclass(frozen=True)
class LitCrop:
    """A photo whose light is known; linear radiance, metres, normals in world axes.

    `lights[i]` is what lamp i adds when it is on (c_i · OLAT_i); the photo is
    ambient + Σ on_i · lights_i, shown as AgX(exposure · photo).
    """

    camera: Camera
    ambient: Float[np.ndarray, "h w 3"]
    lights: Float[np.ndarray, "m h w 3"]
    masks: Bool[np.ndarray, "m h w"]
    on: Bool[np.ndarray, " m"]
    depth_m: Float[np.ndarray, "h w"]
    normal: Float[np.ndarray, "h w 3"]
    kinds: tuple[str, ...]
    """Kind of each lamp, as its dataset calls it."""
    exposure: float

    @property
    def image_linear(self) -> Float[np.ndarray, "h w 3"]:
        """The photo's light."""
        return self.ambient + np.einsum("m,mhwc->hwc", self.on.astype(np.float32), self.lights)


class ViewSource:
    """A rendered view prepared for cutting many photos out of it.

    Layers that may be interpolated (lights, ambient, normals) are kept apart from those that may
    not (masks, distance).
    """

    def __init__(self, view: RenderedView) -> None:
        self.view = view
        smooth = [view.ambient, *view.lights, view.normal]
        sharp = [view.ray_distance_m, *(m for kind in MASK_KINDS for m in view.masks[kind])]
        self.smooth = torch.from_numpy(np.concatenate(smooth, -1)).movedim(-1, 0).contiguous()
        self.sharp = torch.from_numpy(np.stack([layer.astype(np.float32) for layer in sharp]))
        if view.kind == "panorama":
            self.smooth, self.sharp = padded(self.smooth), padded(self.sharp)

    def cut(
        self,
        rotation: Float[np.ndarray, "3 3"],
        fov_x_deg: float,
        width: int,
        height: int,
        mask_kind: str = "fixture",
    ) -> LitCrop:
        """The photo of a pinhole at the panorama's centre; `rotation`: camera to panorama axes."""
        smooth = sample_padded(self.smooth, rotation, fov_x_deg, width, height)
        sharp = sample_padded(self.sharp, rotation, fov_x_deg, width, height, nearest=True)
        c2w = self.view.c2w.copy()
        c2w[:3, :3] = self.view.c2w[:3, :3] @ rotation
        focal = focal_length(fov_x_deg, width)
        camera = Camera(focal, focal, width / 2, height / 2, width, height, c2w)
        return self._crop(
            camera, smooth, sharp, depth_from_distance(sharp[0], fov_x_deg), mask_kind
        )

    def whole(self, width: int, height: int, mask_kind: str = "fixture") -> LitCrop:
        """A perspective view on another pixel grid, cropped at the centre to the new aspect."""
        camera = self.view.camera
        assert camera is not None, "a panorama has no camera: use cut"
        scale = min(camera.width / width, camera.height / height)
        x0 = round((camera.width - scale * width) / 2)
        y0 = round((camera.height - scale * height) / 2)
        x1, y1 = round(x0 + scale * width), round(y0 + scale * height)
        window = Camera(
            camera.fx, camera.fy, camera.cx - x0, camera.cy - y0, x1 - x0, y1 - y0, camera.c2w
        )
        smooth = self.smooth[None, :, y0:y1, x0:x1]
        sharp = self.sharp[None, :, y0:y1, x0:x1]
        target = window.resized(width, height)
        sharp = functional.interpolate(sharp, (height, width), mode="nearest-exact")[0]
        depth = sharp[0] / _ray_lengths(target)
        smooth = functional.interpolate(smooth, (height, width), mode="area")[0]
        return self._crop(target, smooth, sharp, depth, mask_kind)

    def _crop(
        self, camera: Camera, smooth: Tensor, sharp: Tensor, depth_m: Tensor, mask_kind: str
    ) -> LitCrop:
        view, lamps = self.view, len(self.view.lamps)
        colours = smooth.reshape(lamps + 2, 3, *smooth.shape[1:]).movedim(1, -1).numpy()
        first = 1 + MASK_KINDS.index(mask_kind) * lamps
        lights = colours[1:-1] * view.scale[:, None, None]
        normal = colours[-1] / np.maximum(np.linalg.norm(colours[-1], axis=-1, keepdims=True), 1e-6)
        return LitCrop(
            camera=camera,
            ambient=np.ascontiguousarray(colours[0]),
            lights=lights,
            masks=sharp[first : first + lamps].numpy() > 0.5,
            on=view.on,
            depth_m=depth_m.numpy(),
            normal=normal,
            kinds=tuple(lamp.kind for lamp in view.lamps),
            exposure=view.exposure,
        )


def with_lamps(crop: LitCrop, kept: list[int]) -> LitCrop:
    """Only the lamps in `kept`, in that order; the light of others that burn joins the ambient."""
    others = [i for i in range(len(crop.on)) if i not in kept and crop.on[i]]
    return replace(
        crop,
        ambient=crop.ambient + crop.lights[others].sum(0),
        lights=crop.lights[kept],
        masks=crop.masks[kept],
        on=crop.on[kept],
        kinds=tuple(crop.kinds[i] for i in kept),
    )


def _ray_lengths(camera: Camera) -> Tensor:
    """Distance to the camera centre per unit of depth, for each pixel. [h, w]"""
    x = (torch.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (torch.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    return (1 + x[None] ** 2 + y[:, None] ** 2).sqrt().float()

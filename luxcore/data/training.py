"""Training photos for the single-view model, made on the fly and the same for ever.

Sample `i` is a function of (views, size, seed, i) alone: any number of workers, in any order, give
the same bits (paper, supplement, On-the-fly sampling).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy.random import PCG64, Generator, SeedSequence

from luxcore.data.compact import MASK_KINDS
from luxcore.data.crops import LitCrop, ViewSource, with_lamps
from luxcore.data.lighting import draw_relighting, exposed
from luxcore.data.panorama import directions_of_pixels, sample_padded, view_rotation
from luxcore.data.store import AnyView, ViewStore

FOV_DEG = (50.0, 90.0)
ELEVATION_DEG = (-25.0, 30.0)
"""Photographers hold a camera nearly level."""
MIN_MASK_PIXELS = 4
"""A lamp with a smaller mask is not in sight: its light belongs to the ambient."""
MIN_DEPTH_M = 0.8
"""Median depth below which a photo is too close to a wall."""
ATTEMPTS = 8
_PREVIEW = 24


class SingleViewSamples:
    """Photos with a lamp in sight, by number; numbers beyond `len` go on with new photos.

    Consecutive numbers share a view (`photos_per_view`), so that files are read seldom. With
    `relit` the light is recomposed and exposed anew, else the photo is as taken.
    """

    def __init__(
        self,
        views: Sequence[AnyView],
        size: tuple[int, int],
        seed: int,
        *,
        relit: bool = True,
        photos_per_view: int = 8,
        mask_kinds: Sequence[str] = MASK_KINDS,
    ) -> None:
        """`size` is (height, width). Raises InputError when there are no views."""
        self.store = ViewStore(views)
        self.size, self.seed, self.relit = size, seed, relit
        self.photos_per_view, self.mask_kinds = photos_per_view, tuple(mask_kinds)

    def __len__(self) -> int:
        return len(self.store) * self.photos_per_view

    def __iter__(self) -> Iterator[dict[str, np.ndarray]]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        """Arrays of a photo, K lamps in sight, the target first (`as_arrays`)."""
        return as_arrays(self.crop(index))

    def crop(self, index: int) -> LitCrop:
        """Photo `index`: its target lamp is lamp 0; without any lamp in sight K is 0."""
        rng = generator(self.seed, 0, index)
        source = self.store.source(self._view_of(index))
        mask_kind = str(rng.choice(self.mask_kinds))
        crop, target = aimed_crop(source, rng, self.size, mask_kind)
        if self.relit:
            crop = draw_relighting(rng, len(crop.on)).apply(crop)
            [crop] = exposed([crop], rng)
        return with_lamps(crop, lamps_in_sight(crop.masks, target))

    def _view_of(self, index: int) -> int:
        epoch, place = divmod(index, len(self))
        order = generator(self.seed, 1, epoch).permutation(len(self.store))
        return int(order[place // self.photos_per_view])


def generator(*key: int) -> Generator:
    """Random numbers that depend on nothing but the key."""
    return Generator(PCG64(SeedSequence(list(key))))


def as_arrays(crop: LitCrop) -> dict[str, np.ndarray]:
    """A photo as plain arrays.

    input_linear, ambient, normal (world axes) [h, w, 3]; lights [k, h, w, 3], each as it adds to
    the photo when on; masks [k, h, w] bool; on [k] bool; depth_m [h, w] along z; exposure [];
    intrinsics [3, 3]; c2w [4, 4].
    """
    return {
        "input_linear": crop.image_linear,
        "ambient": crop.ambient,
        "lights": crop.lights,
        "masks": crop.masks,
        "on": crop.on,
        "depth_m": crop.depth_m,
        "normal": crop.normal,
        "exposure": np.array(crop.exposure, np.float32),
        "intrinsics": crop.camera.intrinsics,
        "c2w": crop.camera.c2w,
    }


def lamps_in_sight(masks: Bool[np.ndarray, "m h w"], target: int | None) -> list[int]:
    """Lamps whose mask is large enough, the target first."""
    seen = [i for i, mask in enumerate(masks) if mask.sum() >= MIN_MASK_PIXELS]
    return sorted(seen, key=lambda i: (i != target, i))


def aimed_crop(
    source: ViewSource, rng: Generator, size: tuple[int, int], mask_kind: str
) -> tuple[LitCrop, int | None]:
    """A photo of a random lamp of the view, and the lamp; any photo and None where none is seen.

    The lamp's mask guides azimuth and elevation; poses close to a wall are drawn again.
    """
    height, width = size
    if source.view.kind == "perspective":
        crop = source.whole(width, height, mask_kind)
        seen = lamps_in_sight(crop.masks, None)
        return crop, int(rng.choice(seen)) if seen else None
    target, fov, rotation = aimed_pose(source, rng, width / height, mask_kind)
    return source.cut(rotation, fov, width, height, mask_kind), target


def aimed_pose(
    source: ViewSource, rng: Generator, aspect: float, mask_kind: str
) -> tuple[int | None, float, Float[np.ndarray, "3 3"]]:
    """(target lamp, field of view, camera-to-panorama rotation) of a photo that shows the lamp."""
    masks = source.view.masks[mask_kind]
    visible = [i for i, mask in enumerate(masks) if mask.any()]
    target = int(rng.choice(visible)) if visible else None
    fov = float(rng.uniform(*FOV_DEG))
    if target is None:
        return None, fov, view_rotation(float(rng.uniform(-180, 180)), float(rng.uniform(-10, 10)))
    azimuth, elevation = mask_centre_deg(masks[target])
    layer = 1 + MASK_KINDS.index(mask_kind) * len(masks) + target
    for attempt in range(ATTEMPTS):
        # Every attempt aims closer to the lamp.
        reach = 0.45 * fov * (1 - attempt / ATTEMPTS)
        aim = elevation + rng.uniform(-reach, reach) / max(aspect, 1.0)
        aim = float(np.clip(aim, *ELEVATION_DEG))
        rotation = view_rotation(azimuth + rng.uniform(-reach, reach), aim, rng.normal(0, 1.5))
        height = max(8, round(_PREVIEW / aspect))
        small = sample_padded(source.sharp, rotation, fov, _PREVIEW, height, nearest=True)
        if small[layer].any() and float(small[0].median()) >= MIN_DEPTH_M:
            return target, fov, rotation
    return target, fov, view_rotation(azimuth, elevation)


def mask_centre_deg(mask: Bool[np.ndarray, "h w"]) -> tuple[float, float]:
    """Azimuth and elevation of the middle of a panorama's mask, in its own axes."""
    directions = directions_of_pixels(*mask.shape)
    # Pixels near the poles are small: weigh by the cosine of the elevation.
    weight = mask * np.sqrt(np.maximum(1 - directions[..., 2] ** 2, 0))
    x, y, z = (directions * weight[..., None]).sum((0, 1))
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arctan2(z, np.hypot(x, y))))

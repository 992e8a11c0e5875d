"""Names and colours of the public LuxRemix layout: which file is which pass of which view.

Facts from the FORMAT page of facebookresearch/luxremix-dataset. A file is
`{pass}.{view}.{type}.{ext}` or `{pass}.meta.json` in a folder named by a six-digit scene id.
"""

from __future__ import annotations

import re
from functools import cache

import numpy as np
from jaxtyping import Bool, Float

SCENE_ID = re.compile(r"\d{6}")
FILE_NAME = re.compile(
    r"(?P<pass>\d{4})\.((?P<view>\d{4})\.(?P<type>[a-z_]+)\.(exr|png|jpg)|meta\.json)"
)
MIX_PASSES = range(4)
BACKGROUND_PASS = 1000
FIRST_OLAT_PASS = 1001
SCENES_PER_SHARD = 10

LAMP_TYPES = {"ceiling": "Ceiling", "floor": "Floor", "table": "Desk", "wall": "Wall"}
"""Our kinds of lamps in the layout's words; it has no wall lamps, readers take any word."""

_COLOUR_TOLERANCE = 0.12
"""Sum over channels, as the public tools match mask colours."""


def file_name(pass_id: int, view_id: int, kind: str) -> str:
    """`kind` with its extension, such as "depth.exr"."""
    return f"{pass_id:04d}.{view_id:04d}.{kind}"


def meta_name(pass_id: int) -> str:
    """The metadata of a pass."""
    return f"{pass_id:04d}.meta.json"


@cache
def mask_colours(lights: int) -> Float[np.ndarray, "n 3"]:
    """The colour of each of `lights` lights in the mask images: turbo, resampled."""
    import matplotlib

    return matplotlib.colormaps["turbo"].resampled(max(lights, 1))(np.arange(lights))[:, :3]


def paint_masks(masks: Bool[np.ndarray, "n h w"]) -> Float[np.ndarray, "h w 3"]:
    """One picture of all masks; where two overlap the later light is seen."""
    picture = np.zeros((*masks.shape[1:], 3))
    for mask, colour in zip(masks, mask_colours(len(masks)), strict=True):
        picture[mask] = colour
    return picture


def pick_mask(
    picture: Float[np.ndarray, "h w 3"], light: int, lights: int
) -> Bool[np.ndarray, "h w"]:
    """The mask of one of `lights` lights in a painted picture."""
    distance = np.abs(picture - mask_colours(lights)[light]).sum(-1)
    # With many lights neighbouring colours lie closer than the tolerance: the nearest wins.
    nearest = np.abs(picture[..., None, :] - mask_colours(lights)).sum(-1).argmin(-1)
    return (distance < _COLOUR_TOLERANCE) & (nearest == light)

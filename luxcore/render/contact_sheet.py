"""All rendered photos on one page, as a photographer lays out a day's work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.data.compact import as_taken, list_rendered, load_rendered
from luxcore.files.photos import write_png
from luxcore.light.agx import agx

TILE_HEIGHT = 128
MOST_TILES = 24


def write_contact_sheet(folder: Path, path: Path, columns: int = 4) -> int:
    """A PNG of up to 24 views below `folder`, evenly chosen; returns how many it shows."""
    stems = list_rendered(folder)
    chosen = [stems[k] for k in np.unique(np.linspace(0, len(stems) - 1, MOST_TILES).astype(int))]
    tiles = [_tile(stem) for stem in chosen]
    width = max(t.shape[1] for t in tiles)
    rows = -(-len(tiles) // columns)
    sheet = np.zeros((rows * TILE_HEIGHT, columns * width, 3), np.float32)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        top, left = row * TILE_HEIGHT, column * width
        sheet[top : top + tile.shape[0], left : left + tile.shape[1]] = tile
    write_png(path, sheet)
    return len(tiles)


def _tile(stem: Path) -> Float[np.ndarray, "h w 3"]:
    """The photo as taken through AgX, TILE_HEIGHT rows."""
    from PIL import Image

    view = load_rendered(stem)
    photo = np.asarray(agx(as_taken(view) * np.float32(view.exposure)))
    image = Image.fromarray(np.round(photo * 255).astype(np.uint8))
    width = round(image.width * TILE_HEIGHT / image.height)
    return np.asarray(image.resize((width, TILE_HEIGHT)), np.float32) / 255

"""Rendered photos on one page, as a photographer lays out a day's work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from luxcore.data.compact import as_taken, list_rendered
from luxcore.data.store import AnyView, load_view
from luxcore.errors import InputError
from luxcore.files.atomic import atomic_file
from luxcore.files.photos import write_png
from luxcore.light.agx import agx

TILE_HEIGHT = 128
MOST_TILES = 24
COLUMNS = 4
JPEG_QUALITY = 88


def contact_sheet(views: Sequence[AnyView]) -> Float[np.ndarray, "h w 3"]:
    """Up to 24 views, evenly chosen, as taken and through AgX. Raises InputError without views."""
    if not views:
        raise InputError("there are no views for a contact sheet.")
    chosen = np.unique(np.linspace(0, len(views) - 1, MOST_TILES).astype(int))
    tiles = [_tile(views[k]) for k in chosen]
    width = max(tile.shape[1] for tile in tiles)
    rows = -(-len(tiles) // COLUMNS)
    sheet = np.zeros((rows * TILE_HEIGHT, COLUMNS * width, 3), np.float32)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, COLUMNS)
        top, left = row * TILE_HEIGHT, column * width
        sheet[top : top + tile.shape[0], left : left + tile.shape[1]] = tile
    return sheet


def write_contact_sheet(folder: Path, path: Path) -> None:
    """The sheet of the rendered views below `folder`, as a PNG or (by its suffix) a JPEG."""
    save_sheet(path, contact_sheet(list_rendered(folder)))


def save_sheet(path: Path, sheet: Float[np.ndarray, "h w 3"]) -> None:
    """A PNG, or a JPEG where the suffix says so."""
    if path.suffix.lower() not in (".jpg", ".jpeg"):
        write_png(path, sheet)
        return
    from PIL import Image

    with atomic_file(path) as temporary:
        pixels = np.round(np.clip(sheet, 0, 1) * 255).astype(np.uint8)
        Image.fromarray(pixels).save(temporary, format="JPEG", quality=JPEG_QUALITY)


def _tile(view: AnyView) -> Float[np.ndarray, "h w 3"]:
    """The photo as taken through AgX, TILE_HEIGHT rows."""
    from PIL import Image

    loaded = load_view(view)
    photo = np.asarray(agx(as_taken(loaded) * np.float32(loaded.exposure)))
    image = Image.fromarray(np.round(photo * 255).astype(np.uint8))
    width = round(image.width * TILE_HEIGHT / image.height)
    return np.asarray(image.resize((width, TILE_HEIGHT)), np.float32) / 255

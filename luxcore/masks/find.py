"""The masks stage for one capture: from the user, from the truth, or found in the photos."""

from __future__ import annotations

from pathlib import Path

from luxcore.capture.store import Capture
from luxcore.files.atomic import atomic_folder
from luxcore.files.photos import write_png
from luxcore.masks.known import folder_lamps, truth_lamps
from luxcore.masks.propose import propose_lamps
from luxcore.masks.sheet import contact_sheet
from luxcore.masks.store import FoundLamp, LampMasks, load_masks, write_masks
from luxcore.settings.masks import MasksSettings

SHEET = "sheet.png"
"""The contact sheet's name, beside the masks."""


def find_lamps(
    capture: Capture, out: Path, settings: MasksSettings, drawn: Path | None = None
) -> LampMasks:
    """Write the lamps of a capture into the folder `out`, whole or not at all.

    `drawn` is a folder of the user's own `NNNN_LL.png` masks; it goes before all else, and next
    come the masks that the user drew beside the photos, unless the settings ask for others.
    Raises LuxError when no lamp is found, InputError for masks that cannot be used.
    """
    lamps = _lamps(capture, settings, drawn)
    with atomic_folder(out) as temporary:
        masks = write_masks(temporary, lamps)
        write_png(temporary / SHEET, contact_sheet(capture, masks))
    return load_masks(out)


def _lamps(capture: Capture, settings: MasksSettings, drawn: Path | None) -> list[FoundLamp]:
    if drawn is None and settings.source == "best":
        drawn = capture.drawn_masks
    if drawn is not None:
        return folder_lamps(capture, drawn, settings)
    if settings.source == "truth" or (settings.source == "best" and capture.truth is not None):
        return truth_lamps(capture, settings)
    return propose_lamps(capture, settings)

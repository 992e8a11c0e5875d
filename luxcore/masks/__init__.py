"""Which pixels of a photo are which lamp."""

from luxcore.masks.agreement import Agreement, agreement
from luxcore.masks.find import find_lamps
from luxcore.masks.propose import propose_lamps
from luxcore.masks.sheet import contact_sheet, overlay
from luxcore.masks.single import propose_photo
from luxcore.masks.store import FoundLamp, Lamp, LampMasks, load_masks, write_masks

__all__ = [
    "Agreement",
    "FoundLamp",
    "Lamp",
    "LampMasks",
    "agreement",
    "contact_sheet",
    "find_lamps",
    "load_masks",
    "overlay",
    "propose_lamps",
    "propose_photo",
    "write_masks",
]

"""8- and 16-bit pictures in and out, and the checks that a stranger's photo must pass."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from luxcore.errors import FormatError, InputError
from luxcore.files.atomic import atomic_file

PHOTO_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp"})
MAX_PIXELS = 300_000_000


def read_photo(path: Path) -> np.ndarray:
    """[H, W, 3] float32 in 0..1, display-referred (sRGB-encoded), EXIF rotation applied.

    CMYK is converted, alpha is dropped, 16-bit keeps its precision.
    Raises InputError (missing) or FormatError (not a picture, or cut short).
    """
    from PIL import Image, ImageOps

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist.")
    try:
        # What Pillow has to say about odd metadata is not the one sentence that a user gets.
        with warnings.catch_warnings(action="ignore"), Image.open(path) as image:
            if image.width * image.height > MAX_PIXELS:
                raise FormatError(f"{path} claims {image.width}x{image.height} pixels, too many.")
            if image.mode == "F":
                raise FormatError(f"{path} holds floating point values; give linear light as EXR.")
            if image.mode.startswith("I;16") or image.mode == "I":
                grey = np.asarray(image, np.float32) / 65535.0
                return np.repeat(np.clip(grey, 0, 1)[..., None], 3, axis=2)
            if _is_16_bit_colour(path):
                return _read_16_bit(path)
            upright = ImageOps.exif_transpose(image)
            return np.asarray(upright.convert("RGB"), np.float32) / 255.0
    except FormatError:
        raise
    # Pillow's decoders raise whatever a damaged file makes them trip over.
    except Exception as error:
        raise FormatError(f"{path} is not a readable picture: {error}.") from error


def read_mask(path: Path, size: tuple[int, int] | None = None) -> np.ndarray:
    """[H, W] bool; a pixel is on above one half. `size` is the (height, width) it must have."""
    mask = read_photo(path).mean(axis=2) > 0.5
    if size is not None and mask.shape != tuple(size):
        raise InputError(
            f"{path} is {mask.shape[1]}x{mask.shape[0]}, the photo is {size[1]}x{size[0]}."
        )
    if not mask.any():
        raise InputError(f"{path} is an empty mask: no pixel is brighter than one half.")
    return mask


def write_png(path: Path, image: np.ndarray) -> None:
    """[H, W] or [H, W, 3] in 0..1 (float) or uint8 or bool, as an 8-bit PNG, written atomically."""
    from PIL import Image

    pixels = np.asarray(image)
    if pixels.dtype != np.uint8:
        pixels = np.round(np.clip(np.nan_to_num(pixels.astype(np.float32)), 0, 1) * 255)
    with atomic_file(Path(path)) as temporary:
        Image.fromarray(pixels.astype(np.uint8)).save(temporary, format="PNG")


def list_photos(folder: Path) -> list[Path]:
    """The pictures directly in `folder`, by name. Raises InputError when there are none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder.")
    photos = sorted(p for p in folder.iterdir() if p.suffix.lower() in PHOTO_SUFFIXES)
    if not photos:
        raise InputError(f"{folder} holds no photos ({', '.join(sorted(PHOTO_SUFFIXES))}).")
    return photos


def _is_16_bit_colour(path: Path) -> bool:
    if path.suffix.lower() == ".png":
        with open(path, "rb") as stream:
            header = stream.read(26)
        return len(header) == 26 and header[24] == 16 and header[25] in (2, 6)
    return path.suffix.lower() in {".tif", ".tiff"} and _tiff_bits(path) == 16


def _tiff_bits(path: Path) -> int:
    from PIL import Image

    with Image.open(path) as image:
        bits = getattr(image, "tag_v2", {}).get(258, (8,))
    return int(bits[0]) if isinstance(bits, tuple) else int(bits)


def _read_16_bit(path: Path) -> np.ndarray:
    import cv2

    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED | cv2.IMREAD_ANYDEPTH)
    if pixels is None:
        raise FormatError(f"{path} is not a readable picture.")
    return pixels[..., 2::-1].astype(np.float32) / 65535.0

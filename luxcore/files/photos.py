"""8- and 16-bit pictures in and out, and the checks that a stranger's photo must pass."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from luxcore.errors import FormatError, InputError, LuxError
from luxcore.files.atomic import atomic_file
from luxcore.files.input import check_input_file
from luxcore.files.quiet import quiet

if TYPE_CHECKING:
    from PIL import Image

PHOTO_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp"})
MAX_PIXELS = 300_000_000
_BITS_PER_SAMPLE, _PLANAR_CONFIGURATION, _SEPARATE = 258, 284, 2


@contextmanager
def open_picture(path: Path) -> Iterator[Image.Image]:
    """A picture of at most MAX_PIXELS, opened with Pillow; its pixels are not read yet.

    Raises InputError (missing) or FormatError, also for what the body trips over in a damaged file.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    check_input_file(path)
    try:
        # What Pillow has to say about odd metadata is not the one sentence that a user gets. Given
        # a path, it maps uncompressed TIFFs into memory and gets the sideways ones wrong.
        with (
            warnings.catch_warnings(action="ignore"),
            open(path, "rb") as stream,
            Image.open(stream) as image,
        ):
            if image.width * image.height > MAX_PIXELS:
                raise FormatError(f"{path} claims {image.width}x{image.height} pixels, too many.")
            yield image
    except LuxError:
        raise
    except UnidentifiedImageError as error:
        raise FormatError(f"{path} is not a readable picture.") from error
    # Pillow's decoders raise whatever a damaged file makes them trip over.
    except Exception as error:
        fact = " ".join(str(error).split()).rstrip(".")
        raise FormatError(f"{path} is not a readable picture: {fact}.") from error


def read_photo(path: Path) -> np.ndarray:
    """[H, W, 3] float32 in 0..1, display-referred (sRGB-encoded), EXIF rotation applied.

    CMYK is converted, alpha is dropped, 16-bit keeps its precision.
    Raises InputError (missing) or FormatError (not a picture, or cut short).
    """
    from PIL import ImageOps

    path = Path(path)
    with open_picture(path) as image:
        if image.mode == "F":
            raise FormatError(f"{path} holds floating point values; give linear light as EXR.")
        if image.mode.startswith("I;16") or image.mode == "I":
            grey = np.asarray(ImageOps.exif_transpose(image), np.float32) / 65535.0
            return np.repeat(np.clip(grey, 0, 1)[..., None], 3, axis=2)
        if _is_16_bit_colour(path, image):
            return _read_16_bit(path, image)
        upright = ImageOps.exif_transpose(image)
        return np.asarray(upright.convert("RGB"), np.float32) / 255.0


def read_mask(path: Path, size: tuple[int, int] | None = None) -> np.ndarray:
    """[H, W] bool; a pixel is on above one half. `size` is the (height, width) it must have.

    A shape drawn in the alpha channel is the mask, whatever its colours. Raises InputError for
    another size or no pixel that is on, else as `read_photo` does.
    """
    drawn = _drawn_in_alpha(path)
    mask = read_photo(path).mean(axis=2) > 0.5 if drawn is None else drawn
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


def _drawn_in_alpha(path: Path) -> np.ndarray | None:
    """[H, W] bool: the opaque pixels, where some are opaque and some are not; else None."""
    from PIL import ImageOps

    with open_picture(path) as image:
        if not image.has_transparency_data:
            return None
        alpha = ImageOps.exif_transpose(image).convert("RGBA").getchannel("A")
        opaque = np.asarray(alpha) > 127
    return None if opaque.all() or not opaque.any() else opaque


def _is_16_bit_colour(path: Path, image: Image.Image) -> bool:
    if path.suffix.lower() == ".png":
        with open(path, "rb") as stream:
            header = stream.read(26)
        return len(header) == 26 and header[24] == 16 and header[25] in (2, 6)
    return path.suffix.lower() in {".tif", ".tiff"} and _tiff_bits(image) == 16


def _tiff_bits(image: Image.Image) -> int:
    bits = getattr(image, "tag_v2", {}).get(_BITS_PER_SAMPLE, (8,))
    return int(bits[0]) if isinstance(bits, tuple) else int(bits)


def _read_16_bit(path: Path, image: Image.Image) -> np.ndarray:
    import cv2

    # OpenCV fills such pictures with whatever the memory held.
    if getattr(image, "tag_v2", {}).get(_PLANAR_CONFIGURATION) == _SEPARATE:
        raise FormatError(f"{path} has 16 bits and each channel apart; save it interleaved.")
    # imread would do for PNG, but it refuses TIFFs that lie on their side.
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    with quiet():
        found, pages = cv2.imreadmulti(str(path), start=0, count=1, flags=flags)
    if not found or not pages:
        raise FormatError(f"{path} is not a readable picture.")
    return pages[0][..., ::-1].astype(np.float32) / 65535.0

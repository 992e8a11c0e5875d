"""Photos of strangers: whatever a damaged file makes a decoder do, one sentence comes of it."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from luxcore.errors import FormatError, InputError
from luxcore.files.photos import read_mask, read_photo


def test_a_png_without_a_whole_header_is_refused(tmp_path: Path) -> None:
    chunk = b"IHDR" + struct.pack(">I", 8)
    crc = struct.pack(">I", zlib.crc32(chunk))
    path = tmp_path / "short.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 4) + chunk + crc)
    with pytest.raises(FormatError, match="is not a readable picture"):
        read_photo(path)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".webp", ".bmp"])
def test_flipped_bytes_are_read_or_refused(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    whole, path = tmp_path / f"whole{suffix}", tmp_path / f"damaged{suffix}"
    Image.fromarray(rng.integers(0, 255, (24, 32, 3), np.uint8)).save(whole)
    for _ in range(60):
        data = bytearray(whole.read_bytes())
        for at in rng.integers(0, min(len(data), 200), 4):
            data[at] = rng.integers(256)
        path.write_bytes(data)
        with suppress(FormatError):
            assert read_photo(path).shape[2] == 3


def test_floating_point_is_no_display_picture(tmp_path: Path) -> None:
    path = tmp_path / "linear.tif"
    Image.fromarray(np.full((8, 8), 0.5, np.float32)).save(path)
    with pytest.raises(FormatError, match="give linear light as EXR"):
        read_photo(path)


def upright(stored: np.ndarray, orientation: int) -> np.ndarray:
    """What EXIF's orientation 1 to 8 makes of the stored rows and columns."""
    swapped = stored.swapaxes(0, 1)
    turned = [stored, stored[:, ::-1], stored[::-1, ::-1], stored[::-1]]
    turned += [swapped, swapped[:, ::-1], swapped[::-1, ::-1], swapped[::-1]]
    return turned[orientation - 1]


def save_16_bit(path: Path, pixels: np.ndarray, orientation: int) -> None:
    """A PNG with an eXIf chunk or a TIFF with an orientation tag."""
    if path.suffix == ".tif":
        tag = (274, "H", 1, orientation)
        tifffile.imwrite(path, pixels, extratags=[tag], compression="zlib")
        return
    cv2.imwrite(str(path), pixels[..., ::-1] if pixels.ndim == 3 else pixels)
    exif = Image.Exif()
    exif[0x0112] = orientation
    body = b"eXIf" + exif.tobytes().removeprefix(b"Exif\0\0")
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    data = path.read_bytes()
    after_header = 33
    path.write_bytes(data[:after_header] + chunk + data[after_header:])


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("channels", [1, 3])
def test_orientation_counts_at_16_bits(
    tmp_path: Path, suffix: str, channels: int, orientation: int
) -> None:
    stored = np.random.default_rng(0).integers(0, 65536, (12, 20, channels)).astype(np.uint16)
    path = tmp_path / f"turned{suffix}"
    save_16_bit(path, stored if channels == 3 else stored[..., 0], orientation)
    expected = np.broadcast_to(upright(stored, orientation) / 65535, read_photo(path).shape)
    np.testing.assert_allclose(read_photo(path), expected, atol=1e-6)


def test_an_uncompressed_grey_tiff_may_lie_on_its_side(tmp_path: Path) -> None:
    stored = np.arange(12 * 20, dtype=np.uint8).reshape(12, 20)
    tifffile.imwrite(tmp_path / "a.tif", stored, extratags=[(274, "H", 1, 6)])
    expected = upright(stored, 6) / 255
    np.testing.assert_allclose(read_photo(tmp_path / "a.tif")[..., 0], expected, atol=1e-6)


def test_channels_stored_apart_at_16_bits_are_refused(tmp_path: Path) -> None:
    planes = np.zeros((3, 12, 20), np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", planes, photometric="rgb", planarconfig="separate")
    with pytest.raises(FormatError, match="each channel apart"):
        read_photo(tmp_path / "a.tif")


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_decoders_of_16_bits_are_silent(tmp_path: Path, suffix: str, capfd) -> None:
    path = tmp_path / f"damaged{suffix}"
    save_16_bit(path, np.random.default_rng(0).integers(0, 65536, (24, 32, 3)).astype(np.uint16), 1)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 8] = bytes(8)
    path.write_bytes(data)
    with suppress(FormatError):
        read_photo(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("colour", [0, 255])
@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_a_mask_may_be_drawn_in_alpha(tmp_path: Path, colour: int, depth: type) -> None:
    pixels = np.full((12, 20, 4), colour, np.uint8)
    pixels[..., 3] = 0
    pixels[3:7, 5:9, 3] = 255
    cv2.imwrite(str(tmp_path / "m.png"), pixels.astype(depth) * (257 if depth is np.uint16 else 1))
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png"), pixels[..., 3] > 0)


@pytest.mark.parametrize("alpha", [0, 255])
def test_alpha_without_a_shape_is_not_the_mask(tmp_path: Path, alpha: int) -> None:
    pixels = np.full((12, 20, 4), alpha, np.uint8)
    pixels[..., :3] = 0
    pixels[3:7, 5:9, :3] = 255
    Image.fromarray(pixels).save(tmp_path / "m.png")
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png"), pixels[..., 0] > 0)


def test_a_folder_is_said_to_be_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder, not a file"):
        read_photo(tmp_path)

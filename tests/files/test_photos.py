"""Photos of strangers: whatever a damaged file makes a decoder do, one sentence comes of it."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from luxcore.errors import FormatError
from luxcore.files.photos import read_photo


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

"""safetensors files with one order of bytes: the library writes metadata in a random order."""

from __future__ import annotations

import json
import struct
from pathlib import Path

_ALIGNMENT = 8


def settle_header(path: Path) -> None:
    """Rewrite a safetensors header with its metadata sorted; the tensors stay as they are."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    header["__metadata__"] = dict(sorted(header.get("__metadata__", {}).items()))
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + length :])

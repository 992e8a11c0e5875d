"""Files that a scene refers to must lie in the scene's own folder."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path
from urllib.parse import unquote

from luxcore.errors import FormatError, InputError

_USD_ASSET = re.compile(r"@+([^@\n]+)@+")
_MAX_TEXT = 500_000_000


def check_inside(scene: Path, link: str, root: Path) -> None:
    """Raises InputError when `link` (relative to `root`, or absolute) leads out of `root`."""
    target = (root / link).resolve()
    if not target.is_relative_to(root):
        raise InputError(f"{scene} refers to {link!r:.120}, which is outside its folder.")


def check_text_links(path: Path, root: Path) -> None:
    """Judge what can be judged before another program opens the file: glTF, OBJ, USDA."""
    kind = path.suffix.lower()
    if kind not in {".gltf", ".glb", ".obj", ".mtl", ".usda"} or path.stat().st_size > _MAX_TEXT:
        return
    for link in _links(path, kind):
        check_inside(path, link, root)
        if kind == ".obj" and link.lower().endswith(".mtl") and (root / link).is_file():
            check_text_links(root / link, root)


def _links(path: Path, kind: str) -> list[str]:
    if kind in {".gltf", ".glb"}:
        return _gltf_links(path)
    text = path.read_text(encoding="utf-8", errors="replace")
    if kind == ".usda":
        return _USD_ASSET.findall(text)
    words = [line.split() for line in text.splitlines() if line[:1] in "mbdnrKTP"]
    # Texture options come before the file name, which is last.
    named = [
        w for w in words if w and (w[0] == "mtllib" or w[0].lower().startswith(("map_", "bump")))
    ]
    return [w[-1] for w in named if len(w) > 1]


def _gltf_json(path: Path) -> bytes:
    """The JSON of a .gltf, or of the first chunk of a .glb (12 bytes of header, length, type)."""
    if path.suffix.lower() == ".gltf":
        return path.read_bytes()
    with open(path, "rb") as stream:
        magic, _, _, length, kind = struct.unpack("<4sIII4s", stream.read(20))
        if magic != b"glTF" or kind != b"JSON":
            raise ValueError("its header is another one")
        return stream.read(length)


def _gltf_links(path: Path) -> list[str]:
    try:
        content = json.loads(_gltf_json(path))
        entries = [*content.get("buffers", []), *content.get("images", [])]
        uris = [str(e["uri"]) for e in entries if "uri" in e]
    except (ValueError, AttributeError, TypeError, RecursionError, struct.error) as error:
        raise FormatError(f"{path} is not readable glTF: {error}.") from error
    remote = next((u for u in uris if "://" in u), None)
    if remote:
        raise InputError(f"{path} refers to {remote!r:.120}; nothing is fetched from elsewhere.")
    return [unquote(u) for u in uris if not u.startswith("data:")]

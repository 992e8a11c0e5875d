"""One digest per stage over pixels and values, not file stamps: equal in every clone."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from flows.dag import STAGES
from luxcore.errors import FormatError
from luxcore.files.digests import array_digest, file_digest
from luxcore.units.store import MANIFEST

SKIPPED = frozenset({"report"})
"""The report quotes wall times and the git revision; every other stage must repeat exactly."""


def stage_digests(root: Path) -> dict[str, str]:
    """Stage name → sha256 over the names and contents of its artifacts.

    Raises FormatError naming a picture that cannot be read.
    """
    present = [s for s in STAGES if s.name not in SKIPPED and (root / s.folder).is_dir()]
    return {stage.name: _folder_digest(root / stage.folder) for stage in present}


def _folder_digest(folder: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(f for f in folder.rglob("*") if f.is_file() and f.name != MANIFEST):
        digest.update(str(file.relative_to(folder)).encode() + b"\0")
        digest.update(_content_digest(file).encode())
    return digest.hexdigest()


def _content_digest(file: Path) -> str:
    if file.suffix == ".exr":
        from luxcore.files.exr import read_exr

        layers = read_exr(file)
        return "".join(name + array_digest(layer) for name, layer in sorted(layers.items()))
    if file.suffix == ".png":
        from PIL import Image

        try:
            with Image.open(file) as image:
                return array_digest(np.asarray(image))
        except (OSError, ValueError, SyntaxError) as error:
            raise FormatError(f"{file} is not a readable PNG: {error}.") from error
    return file_digest(file)

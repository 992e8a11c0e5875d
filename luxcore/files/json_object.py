"""Files that hold one JSON object: a description, a list of cameras, a card."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from luxcore.errors import FormatError
from luxcore.files.input import check_input_file


def read_object(path: Path) -> dict[str, Any]:
    """The object in `path`. Raises InputError where there is no such file, FormatError where it
    holds anything else."""
    path = Path(path)
    check_input_file(path)
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not readable JSON: {error}.") from error
    if not isinstance(value, dict):
        raise FormatError(f"{path} must hold a JSON object.")
    return value

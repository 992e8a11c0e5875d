"""The command line that both trainings share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from luxcore.errors import LuxError
from luxcore.models.diffusion.events import FolderListener, Listener
from luxcore.models.diffusion.options import read_settings
from luxcore.settings.base import Settings

Section = TypeVar("Section", bound=Settings)

Train = Callable[[Section, Path, Listener], Path]
"""Settings, output folder and listener to the folder of the trained weights."""


def train_command(
    name: str,
    kind: type[Section],
    train: Train[Section],
    arguments: Sequence[str],
    listen: Callable[[Path], Listener] = FolderListener,
) -> int:
    """`--settings FILE --out DIR`: train, or go on training. Returns the exit status.

    `listen` makes the listener for the output folder.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {name}", description=train.__doc__)
    parser.add_argument("--settings", type=Path, required=True, help="YAML file of the settings")
    parser.add_argument(
        "--out", type=Path, required=True, help="checkpoints, metrics, pictures and weights"
    )
    given = parser.parse_args(arguments)
    try:
        settings = read_settings(kind, given.settings)
        weights = train(settings, given.out, listen(given.out))
    except LuxError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(weights)
    return 0

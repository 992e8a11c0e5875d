"""Decoders that write to the terminal by themselves, beside the one sentence that a user gets."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

_TURN = threading.RLock()
_STDERR = 2


@contextmanager
def quiet() -> Iterator[None]:
    """Drop what C libraries write to standard error, and extensions through `sys.stdout`.

    Both belong to the whole process, so threads take turns; what another thread writes during the
    call is dropped as well. Keep it to the one call that decodes.
    """
    with _TURN, open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        kept = os.dup(_STDERR)
        try:
            os.dup2(nowhere.fileno(), _STDERR)
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)

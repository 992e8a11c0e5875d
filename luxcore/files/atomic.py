"""Write to a temporary name, fsync, rename: a reader sees the old file, the new one, or none."""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_CANNOT_WRITE = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""Failures of a write to an open file, which name no file."""


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it takes the place of `path`.

    An OSError names `path`, not the temporary one.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{path.stem}-"
    with _naming(path, prefix):
        descriptor, name = tempfile.mkstemp(prefix=prefix, suffix=path.suffix, dir=path.parent)
        os.close(descriptor)
        temporary = Path(name)
        try:
            yield temporary
            _fsync(temporary)
            # mkstemp makes the file private; a finished file gets the usual permissions.
            temporary.chmod(0o644)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; on success it replaces `path` whole.

    An OSError names `path`, or what was to lie in it, not the temporary folder.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{path.name}-"
    with _naming(path, prefix):
        temporary = Path(tempfile.mkdtemp(prefix=prefix, dir=path.parent))
        try:
            yield temporary
            for file in temporary.rglob("*"):
                if file.is_file():
                    _fsync(file)
            temporary.chmod(0o755)
            _swap_folder(temporary, path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def write_json(path: Path, value: Any) -> None:
    """Stable JSON (sorted keys, newline at the end), written atomically. NaN is refused."""
    text = json.dumps(value, indent=1, sort_keys=True, allow_nan=False) + "\n"
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def _naming(path: Path, prefix: str) -> Iterator[None]:
    """Let an OSError about the temporary name, which begins with `prefix`, name `path` instead."""
    try:
        yield
    except OSError as error:
        named = error.filename
        if isinstance(named, str) and (inside := _inside(named, path.parent, prefix)) is not None:
            named = str(path / inside)
        elif named is None and error.errno in _CANNOT_WRITE:
            named = str(path)
        if named == error.filename:
            raise
        raise OSError(error.errno, error.strerror, named) from error


def _inside(named: str, folder: Path, prefix: str) -> str | None:
    """What follows `folder`/`prefix`… in a name: "" for the temporary itself; None elsewhere."""
    name, start = os.path.abspath(named), os.path.join(os.path.abspath(folder), prefix)
    return name[len(start) :].partition(os.sep)[2] if name.startswith(start) else None


def _swap_folder(new: Path, path: Path) -> None:
    if not path.exists():
        os.replace(new, path)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}-old-", dir=path.parent))
    os.replace(path, old / "was")
    os.replace(new, path)
    shutil.rmtree(old, ignore_errors=True)


def _fsync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

"""The exceptions a user may see. Each message is one sentence naming the thing and the fact."""

from __future__ import annotations

import errno


class LuxError(Exception):
    """A failure that one sentence explains; `lux` prints it and exits with `exit_code`."""

    exit_code = 1


class InputError(LuxError):
    """What the user gave (a file, a flag, a parameter) cannot be used."""

    exit_code = 2


class FormatError(InputError):
    """A file is not what its name or header says: truncated, damaged, hostile or too new."""


class DeviceError(LuxError):
    """No usable OpenCL platform, a kernel that does not build, or a device that was lost."""


class BusyError(LuxError):
    """Another process is at the same work."""


class DivergedError(LuxError):
    """An optimization or a model produced numbers that are not finite."""


def system_sentence(error: OSError) -> str | None:
    """A failure of the operating system as one sentence; None where it names no file and no disk.

    A full disk is met in the middle of writing, where the system no longer knows the file's name.
    """
    if error.filename is not None:
        return f"{error.filename}: {error.strerror}."
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{error.strerror}: make room and start again."
    return None

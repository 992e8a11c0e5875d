"""The exceptions a user may see. Each message is one sentence naming the thing and the fact."""


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

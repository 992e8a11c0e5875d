"""Finding a port to listen on, and listening on one that may be taken."""

from __future__ import annotations

import socket

from luxcore.errors import InputError


def check_port(host: str, port: int) -> None:
    """Raises InputError, naming the port and the reason, when nothing can listen there now."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        # As servers do: a port whose last connection has just closed is free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise InputError(f"port {port} on {host} cannot be used: {reason}.") from error


def free_port(host: str = "127.0.0.1") -> int:
    """A TCP port that nothing listens on now."""
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])

"""The Blender process as seen from outside: started when first needed, killed on a time-out.

Blender (GPL, 800 MB, its own copies of shared libraries) never enters the caller's process; the
child is a fresh interpreter, since a fork after a render hangs.
"""

from __future__ import annotations

import atexit
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from functools import cache
from typing import Any

from luxcore.errors import LuxError

SERVER = "luxcore.render.blender.server"


class BlenderProcess:
    """A pipe to one child. After a failure of the child itself the next request starts another."""

    def __init__(self, server: str = SERVER) -> None:
        self._server = server
        self._child: subprocess.Popen[bytes] | None = None
        self._log: Any = None

    def request(self, value: dict[str, Any], timeout_s: float) -> dict[str, Any]:
        """Send one job and wait. Raises LuxError with the cause, or that time ran out."""
        child = self._start()
        assert child.stdin is not None
        try:
            child.stdin.write(json.dumps(value).encode() + b"\n")
            child.stdin.flush()
            line = self._read_line(child, timeout_s)
        except (OSError, TimeoutError) as error:
            tail = self._log_tail()
            self.stop()
            raise LuxError(f"Blender gave no image: {error}. {tail}".strip()) from error
        answer = json.loads(line)
        if "error" in answer:
            raise LuxError(f"Blender gave no image: {answer['error']}")
        return answer["ok"]

    def stop(self) -> None:
        """End the child, if there is one."""
        if self._child is not None:
            self._child.kill()
            self._child.wait()
            for stream in (self._child.stdin, self._child.stdout, self._log):
                if stream is not None:
                    stream.close()
        self._child = None

    def _start(self) -> subprocess.Popen[bytes]:
        if self._child is not None and self._child.poll() is None:
            return self._child
        self.stop()
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the child)
        self._child = subprocess.Popen(
            [sys.executable, "-m", self._server],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env=_environment(),
        )
        return self._child

    def _read_line(self, child: subprocess.Popen[bytes], timeout_s: float) -> bytes:
        assert child.stdout is not None
        deadline, line = time.monotonic() + timeout_s, b""
        with selectors.DefaultSelector() as selector:
            selector.register(child.stdout, selectors.EVENT_READ)
            while not line.endswith(b"\n"):
                if not selector.select(max(0.0, deadline - time.monotonic())):
                    raise TimeoutError(f"no answer within {timeout_s:g} s")
                chunk = os.read(child.stdout.fileno(), 65536)
                if not chunk:
                    raise OSError("its process ended")
                line += chunk
        return line

    def _log_tail(self) -> str:
        self._log.seek(0)
        lines = self._log.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""


@cache
def shared_blender() -> BlenderProcess:
    """One child for each process of ours; it ends with us, since its stdin closes."""
    process = BlenderProcess()
    atexit.register(process.stop)
    return process


def _environment() -> dict[str, str]:
    """No user scripts, add-ons or site packages of the user reach Blender."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("BLENDER_")}
    return {**kept, "BLENDER_USER_RESOURCES": os.devnull, "PYTHONNOUSERSITE": "1"}

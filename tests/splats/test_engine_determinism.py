"""Same inputs, same bits: again, on one thread and on two."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from engine_scenes import NAMES, camera_at_origin, random_scene, run_engine

from luxcore.splats.device import open_device
from luxcore.splats.rasterizer import RasterConfig


def digest() -> str:
    """sha256 of a forward and backward pass over a scene of many tiles."""
    camera = camera_at_origin(200, 150, 150.0)
    scene = random_scene(3000, 5, camera=camera)
    out, gradients, _ = run_engine(open_device(), camera, RasterConfig(5), scene)
    sha = hashlib.sha256()
    for name in ("image", "alpha", "depth", "radii"):
        sha.update(getattr(out, name).get().tobytes())
    for name in (*NAMES, "mean2d_norm", "visible"):
        sha.update(getattr(gradients, name).get().tobytes())
    return sha.hexdigest()


def test_two_runs_in_one_process_are_bit_identical():
    assert digest() == digest()


def test_one_and_two_threads_are_bit_identical():
    digests = [
        subprocess.run(
            [sys.executable, __file__],
            env=os.environ | {"POCL_MAX_PTHREAD_COUNT": threads, "OMP_NUM_THREADS": "1"},
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for threads in ("1", "2")
    ]
    assert digests[0] == digests[1]
    assert len(digests[0]) == 64


if __name__ == "__main__":
    print(digest())

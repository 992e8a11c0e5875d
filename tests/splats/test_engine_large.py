"""A million Gaussians at full HD, in a process whose memory is limited."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.slow
def test_a_million_gaussians_at_1080p_fit_in_8_gb(project_root):
    code = "from benchmarks.splat_rows import million_pass; print(million_pass()['peak_gb'])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=project_root, capture_output=True, text=True, check=True
    )
    assert float(done.stdout.splitlines()[-1]) < 8

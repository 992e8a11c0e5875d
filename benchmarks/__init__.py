"""Measurements; each module runs by itself: `python -m benchmarks.splats --json FILE`."""

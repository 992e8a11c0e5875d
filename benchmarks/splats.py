"""The rasterizer's cost, beside a torch reference and published figures, in one run.

    python -m benchmarks.splats --json FILE [--quick] [--figures docs/images] [--opensplat DIR]

Everything is timed in process CPU milliseconds (all threads) and wall milliseconds, at 512x512 and
a fixed seed. A forward pass is projection, binning, sort and blending; a backward pass is
everything from the image's gradient to the gradients of all parameters.
"""

from __future__ import annotations

import argparse
from pathlib import Path


def main() -> None:
    """Runs, prints, writes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the report here")
    parser.add_argument("--quick", action="store_true", help="fewer points on the curves")
    parser.add_argument("--figures", type=Path, help="draw the curves into this folder")
    parser.add_argument("--opensplat", type=Path, help="a checkout of OpenSplat to measure beside")
    options = parser.parse_args()
    import numpy as np

    from benchmarks.splat_figures import draw_curves
    from benchmarks.splat_report import print_report, run_all
    from luxcore.files.atomic import write_json
    from luxcore.splats.device import open_device

    np.seterr(all="raise", under="ignore")
    report = run_all(open_device(), options.quick, options.opensplat)
    print_report(report)
    if options.json:
        write_json(options.json, report)
    if options.figures:
        draw_curves(report["curves"], options.figures)


if __name__ == "__main__":
    main()

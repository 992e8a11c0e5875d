"""The rasterizer in plain torch: the specification, and the oracle of the kernels' tests.

    out = rasterize(camera, config, means, quats, log_scales, opacity_logits, colors)

Any floating dtype (tests use float64); autograd gives the gradients. Slow by design.
"""

from luxcore.splats.twin.blending import TwinOutput, rasterize
from luxcore.splats.twin.harmonics import harmonics_forward
from luxcore.splats.twin.projection import Projected, project_gaussians

__all__ = ["Projected", "TwinOutput", "harmonics_forward", "project_gaussians", "rasterize"]

"""Differentiable Gaussian splatting on OpenCL, any number of channels in one pass.

    device = open_device()
    r = Rasterizer(device, RasterConfig(channels=3))
    out = r.forward(camera, means, quats, log_scales, opacity_logits, colors)
    g = r.backward(out, d_image, d_alpha=None, d_depth=None)

Inputs are float32 `pyopencl.array.Array`s: means [n, 3] (world, metres), quats [n, 4] (w-x-y-z, any
non-zero length), log_scales [n, 3], opacity_logits [n], colors [n, channels] (any real numbers,
never clamped). The camera is a `luxcore.cameras.Camera`.

`out` is a `RasterOutput`: image [h, w, channels] on black, alpha [h, w] = 1 - transmittance, depth
[h, w] = sum of weight times z (divide by alpha for the expected `depth_m`), radii [n] int32 in
pixels, 0 where the Gaussian was not drawn. It holds what `backward` needs; it stays valid as long
as the input arrays are not overwritten.

`g` is a `RasterGradients`: means, quats, log_scales, opacity_logits, colors in the shapes of the
inputs; mean2d_norm [n], the length of the gradient of the projected mean in units of half the image
size (the number that 3DGS compares with 2e-4 to densify); visible [n] uint8, 1 where drawn.

With frozen geometry, `r.recolor(out, colors)` draws other colours through the same sorted lists,
and `r.color_gradients(out, d_image)` gives d_colors [n, channels] alone, at half the cost.
"""

from luxcore.splats.rasterizer.config import RasterConfig
from luxcore.splats.rasterizer.engine import Rasterizer
from luxcore.splats.rasterizer.output import RasterGradients, RasterOutput

__all__ = ["RasterConfig", "RasterGradients", "RasterOutput", "Rasterizer"]

"""All scores of one predicted light against the truth."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from luxcore.light.agx import agx
from luxcore.light.agx_constants import LINEAR_CEILING
from luxcore.metrics.image import psnr, ssim
from luxcore.metrics.lpips import lpips
from luxcore.metrics.rescale import channel_scale

LOG_FLOOR = 1e-3
"""Exposed radiance below this counts as dark in the logarithmic error."""

Image = Float[np.ndarray, "h w 3"]


def score_pair(predicted_linear: Image, truth_linear: Image, exposure: float) -> dict:
    """PSNR, SSIM and LPIPS on AgX display images after the channel-wise rescale, and unscaled.

    `exposure` is the capture's g: images are AgX(g · I), both linear radiance. The scale is fitted
    where the true picture is not white: a glowing bulb of 500 times white, which every picture
    shows as white, would else decide over the whole room. Keys: psnr, ssim,
    lpips (None where unavailable), psnr_picture (the scale fitted to the display images instead),
    psnr_unscaled, ssim_unscaled, log_rmse (stops, rescaled linear HDR). The paper does not say
    whether it scales light or pictures. Values of the prediction that are not finite count as
    black.
    """
    predicted = np.nan_to_num(np.asarray(predicted_linear, np.float32), posinf=0.0, neginf=0.0)
    truth = np.asarray(truth_linear, np.float32)
    scaled = predicted * shown_scale(predicted, truth, exposure)
    picture, plain, target = (_display(i, exposure) for i in (scaled, predicted, truth))
    return {
        "psnr": psnr(picture, target),
        "ssim": ssim(picture, target),
        "lpips": lpips(picture, target),
        "psnr_picture": psnr(np.clip(plain * picture_scale(plain, target), 0, 1), target),
        "psnr_unscaled": psnr(plain, target),
        "ssim_unscaled": ssim(plain, target),
        "log_rmse": log_rmse(scaled * exposure, truth * exposure),
    }


def shown_scale(predicted: Image, truth: Image, exposure: float) -> Float[np.ndarray, " 3"]:
    """The channel-wise scale, fitted where the true picture AgX(exposure · truth) is not white."""
    shown = truth.max(axis=-1) * exposure < LINEAR_CEILING
    scale = channel_scale(predicted[shown], truth[shown]) if shown.any() else np.ones(3)
    return scale.astype(np.float32)


def picture_scale(plain: Image, target: Image) -> Float[np.ndarray, " 3"]:
    """The channel-wise scale between two display images."""
    return channel_scale(plain, target).astype(np.float32)


def score_display(shown: Image, target: Image) -> dict:
    """PSNR, SSIM and LPIPS of two display images in 0..1, without any rescale."""
    return {"psnr": psnr(shown, target), "ssim": ssim(shown, target), "lpips": lpips(shown, target)}


def log_rmse(predicted: Image, truth: Image) -> float:
    """Root mean square difference in stops (log2) of exposed linear images, floored at 1e-3."""
    stops = [np.log2(np.maximum(i, 0.0).astype(np.float64) + LOG_FLOOR) for i in (predicted, truth)]
    return float(np.sqrt(np.mean((stops[0] - stops[1]) ** 2)))


def _display(linear: Image, exposure: float) -> Image:
    return np.asarray(agx(linear * np.float32(exposure)), np.float32)

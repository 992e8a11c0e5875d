"""PSNR and SSIM of display images in 0..1."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

PSNR_CAP_DB = 100.0
"""Equal images score this instead of infinity, which no JSON table can hold."""

Image = Float[np.ndarray, "h w 3"]


def psnr(predicted: Float[np.ndarray, "*places c"], truth: Float[np.ndarray, "*places c"]) -> float:
    """Peak signal to noise ratio in dB for a peak of 1; at most 100."""
    # One array in double precision: three would be a gigabyte for a photo of 12 megapixels.
    error = np.subtract(predicted, truth, dtype=np.float64)
    mean_square = float(np.mean(np.square(error, out=error)))
    if mean_square == 0.0:
        return PSNR_CAP_DB
    return min(PSNR_CAP_DB, -10.0 * float(np.log10(mean_square)))


def ssim(predicted: Image, truth: Image) -> float:
    """Structural similarity (Wang et al. 2004: Gaussian window, sigma 1.5), mean over channels.

    Images smaller than the 11-pixel window are scored with the largest odd window that fits;
    below 3 pixels there is no structure and the score is 1 for equal images, else 0.
    """
    from skimage.metrics import structural_similarity

    side = min(truth.shape[:2])
    if side < 3:
        return float(np.allclose(predicted, truth))
    window = {} if side >= 11 else {"win_size": side - 1 + side % 2}
    return float(
        structural_similarity(
            np.asarray(predicted, np.float64),
            np.asarray(truth, np.float64),
            data_range=1.0,
            channel_axis=2,
            gaussian_weights=side >= 11,
            sigma=1.5,
            use_sample_covariance=False,
            **window,
        )
    )

"""How far poses are from the true ones, after the similarity that fits them best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from luxcore.capture.orientation import Similarity
from luxcore.capture.store import Capture
from luxcore.errors import InputError


@dataclass(frozen=True)
class PoseError:
    """Errors in the true capture's units (metres for rendered rooms) and degrees."""

    views: int
    """Views compared."""
    position_rmse: float
    position_max: float
    rotation_mean_deg: float
    rotation_max_deg: float
    scale: float
    """True units per unit of the estimated world."""


def pose_error(estimated: Capture, true: Capture) -> PoseError:
    """Compare the views of both captures that share a name.

    Raises InputError when fewer than three do: any two fit a similarity.
    """
    by_name = {frame.name: frame.camera for frame in true.frames}
    pairs = [(f.camera, by_name[f.name]) for f in estimated.frames if f.name in by_name]
    if len(pairs) < 3:
        raise InputError(f"{estimated.root} and {true.root} share {len(pairs)} views, not three.")
    ours = np.stack([a.c2w for a, _ in pairs])
    theirs = np.stack([b.c2w for _, b in pairs])
    fit = umeyama(ours[:, :3, 3], theirs[:, :3, 3])
    moved = np.stack([fit.pose(c2w) for c2w in ours])
    distance = np.linalg.norm(moved[:, :3, 3] - theirs[:, :3, 3], axis=1)
    angle = rotation_angle_deg(moved[:, :3, :3], theirs[:, :3, :3])
    return PoseError(
        views=len(pairs),
        position_rmse=float(np.sqrt((distance**2).mean())),
        position_max=float(distance.max()),
        rotation_mean_deg=float(angle.mean()),
        rotation_max_deg=float(angle.max()),
        scale=fit.scale,
    )


def umeyama(source: Float[np.ndarray, "n 3"], target: Float[np.ndarray, "n 3"]) -> Similarity:
    """The similarity that maps `source` to `target` with least squared error.

    Umeyama 1991, "Least-squares estimation of transformation parameters between two point
    patterns", equations 40–42.
    """
    mean_s, mean_t = source.mean(axis=0), target.mean(axis=0)
    covariance = (target - mean_t).T @ (source - mean_s) / len(source)
    u, values, vt = np.linalg.svd(covariance)
    # A reflection would fit mirrored points better but is not a motion.
    sign = np.array([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt)) or 1.0])
    rotation = u @ np.diag(sign) @ vt
    variance = float(((source - mean_s) ** 2).sum() / len(source))
    scale = float((values * sign).sum() / max(variance, 1e-30))
    return Similarity(scale, rotation, mean_t - scale * rotation @ mean_s)


def rotation_angle_deg(
    a: Float[np.ndarray, "n 3 3"], b: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, " n"]:
    """Angle between rotations, degrees; exact for small angles too."""
    difference = a @ np.swapaxes(b, 1, 2)
    skew = difference - np.swapaxes(difference, 1, 2)
    sine = 0.5 * np.sqrt(skew[:, 0, 1] ** 2 + skew[:, 0, 2] ** 2 + skew[:, 1, 2] ** 2)
    cosine = 0.5 * (np.trace(difference, axis1=1, axis2=2) - 1)
    return np.degrees(np.arctan2(sine, cosine))

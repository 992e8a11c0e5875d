"""The curves that `dvc plots show` draws, as data; written into `dvc.yaml`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Plot:
    """One picture: a line per file."""

    title: str
    files: tuple[str, ...]
    x: str
    y: str
    x_label: str
    y_label: str

    def entry(self) -> dict[str, Any]:
        """As DVC wants it."""
        fields = {
            "x": self.x,
            "y": dict.fromkeys(self.files, self.y),
            "title": self.title,
            "x_label": self.x_label,
            "y_label": self.y_label,
        }
        return {self.title: fields}


_CAPTURES = ("demo", "demo_photos")
_PSNR = "PSNR, dB"

PLOTS: tuple[Plot, ...] = (
    Plot(
        "splat: held-out views by iteration",
        tuple(f"artifacts/splat/{name}/curve.json" for name in _CAPTURES),
        "iteration", "psnr_heldout", "iteration", _PSNR,
    ),
    Plot(
        # Seconds are no artifact, since they differ between equal runs; only the last are at hand.
        "splat: held-out views of demo by seconds",
        ("artifacts/timings/splat.json",),
        "seconds", "psnr_heldout", "seconds", _PSNR,
    ),
    Plot(
        "relight: lamps by iteration",
        tuple(f"artifacts/relight/{name}/curve.json" for name in _CAPTURES),
        "iteration", "psnr_lights", "iteration", _PSNR,
    ),
    Plot(
        "training: validation photos by step",
        ("artifacts/train_sv/curve.json", "artifacts/train_mv/curve.json"),
        "step", "psnr_validation", "optimizer step", _PSNR,
    ),
    Plot(
        "training: loss by step",
        ("artifacts/train_sv/curve.json", "artifacts/train_mv/curve.json"),
        "step", "loss", "optimizer step", "loss",
    ),
)  # fmt: skip

"""Learning rates of Gaussian parameters (Kerbl et al. 2023, as in their code)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rates:
    """Adam's step for each parameter; that of the means is in world units and decays."""

    means: float
    means_final: float
    quats: float = 1e-3
    log_scales: float = 5e-3
    opacity_logits: float = 5e-2
    sh_constant: float = 2.5e-3
    sh_higher: float = 2.5e-3 / 20

    @classmethod
    def for_scene(cls, extent: float, scale: float = 1.0) -> Rates:
        """The usual rates in a scene of this extent (world units), all multiplied by `scale`."""
        return cls(
            means=1.6e-4 * extent * scale,
            means_final=1.6e-6 * extent * scale,
            quats=1e-3 * scale,
            log_scales=5e-3 * scale,
            opacity_logits=5e-2 * scale,
            sh_constant=2.5e-3 * scale,
            sh_higher=2.5e-3 / 20 * scale,
        )

    def means_at(self, iteration: int, iterations: int) -> float:
        """Exponential decay from `means` to `means_final`."""
        share = min(iteration / max(iterations, 1), 1.0)
        return self.means * (self.means_final / self.means) ** share

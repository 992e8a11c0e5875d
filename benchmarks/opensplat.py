"""OpenSplat's CPU mode as a peer in the same run, built from the user's own copy of its source.

    git clone https://github.com/pierotofy/OpenSplat
    python -m benchmarks.splats --opensplat OpenSplat --json FILE

OpenSplat is AGPL-3.0; nothing of it is in this project. Its CPU rasterizer is one C++ file on
torch. A compiler and ninja are needed.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.splat_measure import Pass, measure
from benchmarks.splat_scenes import BenchmarkScene
from luxcore.cameras import Camera
from luxcore.splats.device import Device

SOURCE = "rasterizer/gsplat-cpu/gsplat_cpu.cpp"

# The list of Gaussians that each pixel blended stays on the C++ side.
BINDING = """
#include "{source}"

using Images = std::tuple<torch::Tensor, torch::Tensor, int64_t>;

std::vector<torch::Tensor> project(torch::Tensor means, torch::Tensor scales, torch::Tensor quats,
                                   torch::Tensor view, torch::Tensor projection, double fx,
                                   double fy, double cx, double cy, int64_t height,
                                   int64_t width) {{
  auto [xys, radii, conics, cov2d, depths] = project_gaussians_forward_tensor_cpu(
      means.size(0), means, scales, 1.0f, quats, view, projection, fx, fy, cx, cy, height, width,
      0.01f);
  return {{xys, conics, cov2d, depths.contiguous()}};
}}

Images blend(int64_t width, int64_t height, torch::Tensor xys, torch::Tensor conics,
             torch::Tensor colors, torch::Tensor opacities, torch::Tensor background,
             torch::Tensor cov2d, torch::Tensor depths) {{
  auto [image, final_ts, blended] = rasterize_forward_tensor_cpu(
      width, height, xys, conics, colors, opacities, background, cov2d, depths);
  return {{image, final_ts, reinterpret_cast<int64_t>(blended)}};
}}

std::vector<torch::Tensor> blend_backward(
    int64_t height, int64_t width, torch::Tensor xys, torch::Tensor conics, torch::Tensor colors,
    torch::Tensor opacities, torch::Tensor background, torch::Tensor cov2d, torch::Tensor depths,
    torch::Tensor final_ts, int64_t blended, torch::Tensor v_image, torch::Tensor v_alpha) {{
  auto [v_xy, v_conic, v_colors, v_opacity] = rasterize_backward_tensor_cpu(
      height, width, xys, conics, colors, opacities, background, cov2d, depths, final_ts,
      reinterpret_cast<std::vector<int32_t> *>(blended), v_image, v_alpha);
  return {{v_xy, v_conic, v_colors, v_opacity}};
}}

void release(int64_t blended) {{ delete[] reinterpret_cast<std::vector<int32_t> *>(blended); }}
"""


def opensplat_row(
    device: Device, scene: BenchmarkScene, source: Path, repeats: int = 5
) -> dict[str, Any]:
    """Median milliseconds of both in turn, OpenSplat from the checkout `source`, with the mean
    difference of their images (their alpha ceilings and bounds differ a little)."""
    peer, own = _Peer(_native(source), scene), Pass.prepare(device, scene)
    rounds = [
        {**peer.timed_pass(), "own_forward_cpu_ms": measure(own.forward, 3, 1).cpu_ms,
         "own_backward_cpu_ms": measure(own.backward, 3, 1).cpu_ms}
        for _ in range(repeats + 1)
    ][1:]  # the first one warms up  # fmt: skip
    row = {name: float(np.median([r[name] for r in rounds])) for name in rounds[0]}
    difference = float(np.abs(peer.image - own.out.image.get()).mean())
    return {
        "scene": scene.name,
        **row,
        "forward_ratio": row["forward_cpu_ms"] / row["own_forward_cpu_ms"],
        "backward_ratio": row["backward_cpu_ms"] / row["own_backward_cpu_ms"],
        "mean_difference": difference,
    }


def _native(source: Path) -> Any:
    from torch.utils.cpp_extension import load_inline

    file = (source / SOURCE).resolve()
    if not file.is_file():
        raise SystemExit(f"{source} is no checkout of OpenSplat: it has no {SOURCE}.")
    return load_inline(
        "opensplat_cpu",
        BINDING.format(source=file),
        functions=["project", "blend", "blend_backward", "release"],
        extra_cflags=["-O3", "-march=native"],
    )


class _Peer:
    """OpenSplat's passes on one scene, as its training calls them."""

    def __init__(self, native: Any, scene: BenchmarkScene) -> None:
        import torch

        def leaf(values: np.ndarray) -> torch.Tensor:
            return torch.tensor(values, dtype=torch.float32, requires_grad=True)

        self.native, self.camera = native, scene.camera
        self.leaves = [leaf(scene.means), leaf(np.exp(scene.log_scales)), leaf(scene.quats)]
        self.opacities = torch.sigmoid(torch.tensor(scene.opacity_logits).float())[:, None]
        self.colors = torch.tensor(scene.colors).float()
        self.view = torch.tensor(scene.camera.viewmat).float()
        self.projection = torch.tensor(_projection(scene.camera)).float() @ self.view
        self.background = torch.zeros(3)
        noise = np.random.default_rng(0).normal(size=(self.camera.height, self.camera.width, 3))
        self.v_image = torch.tensor(noise).float()
        self.v_alpha = torch.zeros(self.v_image.shape[:2])
        self.image = np.empty(0)

    def timed_pass(self) -> dict[str, float]:
        """One forward and one backward pass in milliseconds."""
        import torch

        camera = self.camera
        start = _now()
        xys, conics, cov2d, depths = self.native.project(
            *self.leaves, self.view, self.projection, camera.fx, camera.fy, camera.cx, camera.cy,
            camera.height, camera.width,
        )  # fmt: skip
        seen = (xys, conics, self.colors, self.opacities, self.background, cov2d, depths)
        image, final_ts, blended = self.native.blend(camera.width, camera.height, *seen)
        middle = _now()
        v_xy, v_conic, _, _ = self.native.blend_backward(
            camera.height, camera.width, *seen, final_ts, blended, self.v_image, self.v_alpha
        )
        torch.autograd.grad([xys, conics], self.leaves, [v_xy, v_conic])
        end = _now()
        self.native.release(blended)
        self.image = image.numpy()
        return {
            f"{name}_{clock}_ms": 1e3 * (b - a)
            for name, before, after in (("forward", start, middle), ("backward", middle, end))
            for clock, a, b in zip(("cpu", "wall"), before, after, strict=True)
        }


def _projection(camera: Camera) -> np.ndarray:
    """Camera axes to clip space; the third row only orders by depth."""
    far, near = 1000.0, 0.01
    depth = [0, 0, far / (far - near), -far * near / (far - near)]
    across = [2 * camera.fx / camera.width, 0, 2 * camera.cx / camera.width - 1, 0]
    down = [0, 2 * camera.fy / camera.height, 2 * camera.cy / camera.height - 1, 0]
    return np.array([across, down, depth, [0, 0, 1, 0]], np.float64)


def _now() -> tuple[float, float]:
    return time.process_time(), time.perf_counter()

"""One picture that tells what a scene can do: `python -m luxcore.report.banner SCENE OUT.png`.

Left to right: the room as photographed, each lamp alone, and mixes that no photo shows.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click
import numpy as np
from jaxtyping import Float

from luxcore.cameras import Camera
from luxcore.cli.camera_file import read_camera
from luxcore.errors import LuxError
from luxcore.files.photos import write_png
from luxcore.light.agx import agx
from luxcore.splats.light_views import AMBIENT
from luxcore.splats.relighting import FixedCamera, LampSetting, solo
from luxcore.splats.scene import Scene, load_scene

GAP_PX = 4
DIM = 0.35
"""Intensity at which lamps that only support a mix burn."""
PAINTS = ((1.0, 0.25, 0.05), (0.1, 0.35, 1.0), (0.9, 0.1, 0.6))
"""Linear Rec.709: an ember, a blue hour, a magenta."""

Image = Float[np.ndarray, "h w 3"]


def banner(scene: Scene, camera: Camera) -> Image:
    """Display-referred [2 h, columns · w, 3]: mixes above, lamps alone below."""
    view = FixedCamera(scene, camera)
    names = [lamp.name for lamp in scene.lamps]
    above = [{}, *(_painted(scene, i) for i in range(len(names)))]
    below = [solo(scene, name) for name in (AMBIENT, *names)]
    rows = [[_shown(view, settings) for settings in row] for row in (above, below)]
    return np.concatenate([_joined(row) for row in rows])


def _painted(scene: Scene, chosen: int) -> dict[str, LampSetting]:
    """One lamp recoloured and bright, the others dimmed, the ambient light nearly off."""
    mix = {lamp.name: LampSetting(DIM) for lamp in scene.lamps}
    lamp = scene.lamps[chosen]
    mix[lamp.name] = LampSetting(1.5, PAINTS[chosen % len(PAINTS)])
    return {**mix, AMBIENT: LampSetting(DIM)}


def _shown(view: FixedCamera, settings: dict[str, LampSetting]) -> Image:
    picture = agx(view.scene.tone.exposure * view.render(settings))
    return np.pad(picture, ((0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=1.0)


def _joined(pictures: list[Image]) -> Image:
    return np.concatenate(pictures, axis=1)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("scene", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--view", default=0, show_default=True, help="Which camera of the scene.")
def main(scene: Path, out: Path, view: int) -> None:
    """Write the picture of the relightable scene in folder SCENE to OUT (PNG)."""
    try:
        write_png(out, banner(load_scene(scene), read_camera(scene / "transforms.json", view)))
    except (LuxError, OSError) as error:
        click.echo(f"lux: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()

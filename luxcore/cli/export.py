"""`lux export SCENE --format FORMAT [--set …] [--lamps] [--view N] --out FILE_OR_FOLDER`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from luxcore.cli.camera_file import read_camera
from luxcore.cli.lamp_options import parse_lamp_settings
from luxcore.errors import InputError
from luxcore.files.output import check_out_folder

if TYPE_CHECKING:
    from luxcore.cameras import Camera
    from luxcore.capture.export import Layout
    from luxcore.splats.gaussians import Gaussians
    from luxcore.splats.relighting import LampSetting
    from luxcore.splats.scene import Scene


@dataclass(frozen=True)
class Format:
    """One value of `--format`."""

    suffix: str
    """How the file must end; empty for a folder."""
    about: str


FORMATS = {
    "ply": Format(".ply", "3DGS PLY, for any viewer of Gaussians; lossless"),
    "spz": Format(".spz", "Niantic's compressed Gaussians (SPZ 3), a quarter of the PLY; y up"),
    "glb": Format(".glb", "binary glTF with KHR_gaussian_splatting; y up"),
    "exr": Format(".exr", "one view, linear light, a part for ambient and for each lamp"),
    "nerfstudio": Format("", "folder of transforms.json, images/ and points.ply"),
    "colmap": Format("", "folder of images/ and sparse/0/*.bin"),
    "colmap-text": Format("", "the same with sparse/0/*.txt"),
}
GAUSSIANS = ("ply", "spz", "glb")
LAYOUTS: dict[str, Layout] = {
    "nerfstudio": "nerfstudio",
    "colmap": "colmap",
    "colmap-text": "colmap-text",
}


def _described() -> str:
    # \b keeps click from wrapping the list into one paragraph.
    lines = [f"  {name:<12} {form.about}" for name, form in FORMATS.items()]
    return "\b\nFormats:\n" + "\n".join(lines)


@click.command(name="export", epilog=_described())
@click.argument("scene", type=click.Path(path_type=Path))
@click.option("--format", "form", type=click.Choice(list(FORMATS)), default="ply",
              show_default=True, help="See below.")  # fmt: skip
@click.option(
    "--set", "options", multiple=True, metavar="NAME=INTENSITY[,#rrggbb]",
    help="The light to export; without it, that of the photos.",
)  # fmt: skip
@click.option("--lamps", is_flag=True,
              help="For ply, spz, glb: a folder of a file for ambient and each lamp.")  # fmt: skip
@click.option("--view", type=int, help="For exr: the camera of this photo, from 0.")
@click.option("--out", required=True, type=click.Path(path_type=Path))
def command(
    scene: Path, form: str, options: tuple[str, ...], lamps: bool, view: int | None, out: Path
) -> None:
    """A relightable SCENE as files that other tools open.

    For ply, spz and glb the light is baked into display colours (AgX). Each Gaussian is
    tone-mapped by itself, so the picture differs a little from `lux relight`. nerfstudio and
    colmap hold photos rendered in the light asked for; of a CAPTURE folder, its own photos.
    """
    _check_options(form, options, lamps, view, out)
    if out.is_file() and out.samefile(scene / "splats.ply"):
        raise InputError(f"{out} is a file of the scene itself; name another.")
    if form in LAYOUTS and (scene / "capture.json").is_file():
        if options:
            raise InputError(f"{scene} is a capture, whose photos take no --set.")
        _export_capture(scene, form, out)
        return

    from luxcore.splats.scene_files import check_scene

    # Before the imports that take seconds.
    check_scene(scene)
    from luxcore.splats.relighting import mixing_weights
    from luxcore.splats.scene import load_scene

    settings = parse_lamp_settings(options)
    loaded = load_scene(scene)
    mixing_weights(loaded, settings)
    if form in GAUSSIANS:
        _export_gaussians(loaded, form, settings, lamps, out)
    elif form == "exr":
        _export_layers(loaded, read_camera(scene / "transforms.json", view or 0), settings, out)
    else:
        if not loaded.views:
            raise InputError(f"{scene} has no views to render.")
        cameras = [read_camera(scene / "transforms.json", i) for i in range(loaded.views)]
        _export_relit(loaded, cameras, settings, form, out)


def _check_options(
    form: str, options: tuple[str, ...], lamps: bool, view: int | None, out: Path
) -> None:
    """Raises InputError for options that this format has no use for, before any work."""
    if lamps and form not in GAUSSIANS:
        raise InputError(f"--lamps is for {', '.join(GAUSSIANS)}, not for {form}.")
    if lamps and options:
        raise InputError("--lamps shows each lamp alone and takes no --set.")
    if view is not None and form != "exr":
        raise InputError(f"--view is for exr, not for {form}.")
    suffix = FORMATS[form].suffix
    if lamps or not suffix:
        # A folder of photos looks like one that was exported, so that must be a new one.
        names = (f"[0-9][0-9]_*{suffix}",) if lamps else ()
        check_out_folder(out, names, mark=f"00_ambient{suffix}" if lamps else None)
    elif out.suffix.lower() != suffix:
        raise InputError(f"{out} must end in {suffix}.")


def _writer(form: str) -> Callable[[Path, Gaussians], None]:
    from luxcore.exports.gltf import write_glb
    from luxcore.exports.spz import write_spz
    from luxcore.splats.ply import write_ply

    return {"ply": write_ply, "spz": write_spz, "glb": write_glb}[form]


def _export_gaussians(
    scene: Scene, form: str, settings: dict[str, LampSetting], lamps: bool, out: Path
) -> None:
    from luxcore.files.atomic import atomic_folder
    from luxcore.splats.light_views import AMBIENT
    from luxcore.splats.relighting import baked_gaussians, solo

    write, count = _writer(form), f"{len(scene.gaussians)} Gaussians"
    if not lamps:
        write(out, baked_gaussians(scene, settings))
        click.echo(f"{out}: {count}")
        return
    names = [AMBIENT, *(lamp.name for lamp in scene.lamps)]
    with atomic_folder(out) as folder:
        for index, name in enumerate(names):
            # A lamp's name is free text: the number keeps file names apart.
            safe = re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:64]
            write(folder / f"{index:02d}_{safe}.{form}", baked_gaussians(scene, solo(scene, name)))
    click.echo(f"{out}: {len(names)} files of {count}")


def _export_layers(
    scene: Scene, camera: Camera, settings: dict[str, LampSetting], out: Path
) -> None:
    from luxcore.exports.layers import write_layers

    names = write_layers(out, scene, camera, settings)
    click.echo(f"{out}: {camera.width}x{camera.height}, parts {', '.join(names)}")


def _export_relit(
    scene: Scene, cameras: list[Camera], settings: dict[str, LampSetting], form: str, out: Path
) -> None:
    import tempfile

    from luxcore.exports.relit_capture import relit_capture

    with tempfile.TemporaryDirectory() as folder:
        relit_capture(Path(folder) / "relit", scene, cameras, settings)
        _export_capture(Path(folder) / "relit", form, out)


def _export_capture(folder: Path, form: str, out: Path) -> None:
    from luxcore.capture import export_capture, load_capture

    capture = load_capture(folder)
    export_capture(capture, out, LAYOUTS[form])
    click.echo(f"{out}: {len(capture.frames)} views, {len(capture.points.xyz)} points")

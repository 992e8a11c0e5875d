"""`lux hdr merge PHOTO… [--times 1/30,1/60,…] --out x.exr`."""

from __future__ import annotations

from pathlib import Path

import click

from luxcore.errors import InputError
from luxcore.files.input import check_input_file


@click.group(name="hdr")
def command() -> None:
    """A photographer's exposure bracket as linear light."""


@command.command(name="merge")
@click.argument("photos", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--times", help="Exposure times in seconds, 1/30,1/60,…; else EXIF's are taken.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="An .exr file.")
@click.option("--json", "as_json", is_flag=True, help="Print the counts as JSON.")
def merge(photos: tuple[Path, ...], times: str | None, out: Path, as_json: bool) -> None:
    """Merge PHOTOS of one still scene, differently exposed, to a linear HDR image (float32 EXR).

    The camera's response is recovered from the photos themselves.
    """
    if out.suffix.lower() != ".exr":
        raise InputError(f"{out} must end in .exr.")
    for photo in photos:
        check_input_file(photo)

    import json

    from luxcore.files.exr import write_exr
    from luxcore.light.camera_brackets import merge_photos, parse_times

    merged = merge_photos(photos, parse_times(times) if times else None)
    write_exr(out, {"image": merged.radiance}, half=False)
    counts = {
        "photos": len(photos),
        "clipped": merged.clipped,
        "black": merged.black,
        "gaps": merged.gaps,
        "unknown": merged.unknown,
        "disagreeing": merged.disagreeing,
    }
    if as_json:
        click.echo(json.dumps(counts))
        return
    height, width = merged.radiance.shape[:2]
    click.echo(
        f"{out}: {width}x{height} from {len(photos)} photos; pixels white in all {merged.clipped}, "
        f"black in all {merged.black}, between exposures {merged.gaps}, "
        f"not finite {merged.unknown}, contradictory {merged.disagreeing}"
    )

"""Check every artifact and every finished unit against its manifest of sha256."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flows.dag import STAGES
from luxcore.progress import progress
from luxcore.units.store import MANIFEST, damaged_files


@dataclass(frozen=True)
class Damage:
    """One folder whose files are not what its manifest says."""

    folder: Path
    files: tuple[str, ...]


def verify(root: Path) -> tuple[int, list[Damage]]:
    """(folders checked, damaged ones). Folders of stages that never ran are not counted."""
    folders = [root / s.folder for s in STAGES if (root / s.folder / MANIFEST).is_file()]
    folders += sorted(m.parent for m in (root / ".lux" / "units").glob(f"*/*/{MANIFEST}"))
    damage = []
    with progress("verify", len(folders), "folders") as bar:
        for folder in folders:
            files = damaged_files(folder)
            if files:
                damage.append(Damage(folder, tuple(files)))
            bar.advance(damaged=len(damage))
    return len(folders), damage

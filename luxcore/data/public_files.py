"""The files of public scenes where they lie: in folders, or inside of tar shards unread as a whole.

A shard is never unpacked. Its entries are checked by name, kind, size and place before one is read:
paths that leave the scene, links, devices, duplicates and sizes beyond the file are refused.
"""

from __future__ import annotations

import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from luxcore.data.public_names import FILE_NAME, SCENE_ID
from luxcore.errors import FormatError, InputError

MAX_ENTRIES = 20_000
MAX_FILE_BYTES = 512 * 1024 * 1024


@dataclass(frozen=True)
class FolderFiles:
    """A scene unpacked in a folder."""

    folder: Path

    @property
    def scene_id(self) -> str:
        """Six digits."""
        return self.folder.name

    def names(self) -> list[str]:
        """File names of the layout, sorted."""
        return sorted(p.name for p in self.folder.iterdir() if FILE_NAME.fullmatch(p.name))

    @contextmanager
    def open_path(self, name: str) -> Iterator[Path]:
        """A path under which the file can be read while the context lasts."""
        path = self.folder / name
        if not path.is_file():
            raise InputError(f"{path} does not exist.")
        yield path


@dataclass(frozen=True)
class TarFiles:
    """A scene inside an uncompressed shard: where each file's bytes begin and how many they are."""

    shard: Path
    scene_id: str
    places: dict[str, tuple[int, int]] = field(default_factory=dict)

    def names(self) -> list[str]:
        """File names of the layout, sorted."""
        return sorted(self.places)

    @contextmanager
    def open_path(self, name: str) -> Iterator[Path]:
        """A path under which the file can be read while the context lasts."""
        if name not in self.places:
            raise InputError(f"{self.shard} holds no {self.scene_id}/{name}.")
        offset, size = self.places[name]
        with open(self.shard, "rb") as stream, tempfile.TemporaryDirectory() as folder:
            stream.seek(offset)
            data = stream.read(size)
            if len(data) != size:
                raise FormatError(f"{self.shard} is cut short in {self.scene_id}/{name}.")
            path = Path(folder) / name
            path.write_bytes(data)
            yield path


def find_scenes(path: Path) -> list[FolderFiles | TarFiles]:
    """Scenes at `path`: a shard, a scene's folder, or a folder of either, in order of scene id.

    Raises InputError when there is none or one twice, FormatError for a hostile shard.
    """
    path = Path(path)
    if path.is_file():
        found: list[FolderFiles | TarFiles] = list(read_shard(path))
    elif path.is_dir() and SCENE_ID.fullmatch(path.name):
        found = [FolderFiles(path)]
    elif path.is_dir():
        found = [
            FolderFiles(p) for p in path.iterdir() if p.is_dir() and SCENE_ID.fullmatch(p.name)
        ]
        found += [scene for tar in sorted(path.glob("*.tar")) for scene in read_shard(tar)]
    else:
        raise InputError(f"{path} does not exist.")
    if not found:
        raise InputError(f"{path} holds no scenes of the public layout.")
    ids = [scene.scene_id for scene in found]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise InputError(f"{path} holds scene {twice[0]} more than once.")
    return sorted(found, key=lambda scene: scene.scene_id)


def read_shard(path: Path) -> list[TarFiles]:
    """The scenes of a shard, from its headers alone. Raises FormatError for anything unexpected."""
    scenes: dict[str, TarFiles] = {}
    total = path.stat().st_size
    try:
        with tarfile.open(path, mode="r:") as shard:
            for count, entry in enumerate(shard):
                if count >= MAX_ENTRIES:
                    raise FormatError(f"{path} holds more than {MAX_ENTRIES} entries.")
                if not entry.isdir():
                    scene_id, name = _checked(path, entry, total)
                    scene = scenes.setdefault(scene_id, TarFiles(path, scene_id))
                    if name in scene.places:
                        raise FormatError(f"{path} holds {entry.name!r} twice.")
                    scene.places[name] = (entry.offset_data, entry.size)
    except (tarfile.TarError, OSError, ValueError, UnicodeError, OverflowError) as error:
        raise FormatError(f"{path} is not a readable uncompressed tar: {error}.") from error
    return list(scenes.values())


def _checked(path: Path, entry: tarfile.TarInfo, total: int) -> tuple[str, str]:
    if not entry.isreg() or entry.issparse():
        raise FormatError(f"{path} holds {entry.name[:80]!r}, which is not a plain file.")
    scene_id, _, name = entry.name.removeprefix("./").partition("/")
    if not SCENE_ID.fullmatch(scene_id) or not FILE_NAME.fullmatch(name):
        raise FormatError(f"{path} holds {entry.name[:80]!r}, which is no file of a scene.")
    if entry.size > MAX_FILE_BYTES or entry.offset_data + entry.size > total:
        raise FormatError(f"{path}: {entry.name} claims {entry.size} bytes, more than there are.")
    return scene_id, name

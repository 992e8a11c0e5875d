"""Shards from strangers: whatever is not a plain file of a scene is refused before it is read."""

import io
import tarfile
from pathlib import Path

import pytest

from luxcore.data import public_files
from luxcore.data.public_files import find_scenes, read_shard
from luxcore.errors import FormatError, InputError

GOOD = "000001/0000.meta.json"


def make_shard(path: Path, *entries: tarfile.TarInfo, mode: str = "w") -> Path:
    with tarfile.open(path, mode) as shard:
        for entry in (tarfile.TarInfo(GOOD), *entries):
            shard.addfile(entry, io.BytesIO(b"x" * entry.size) if entry.size else None)
    return path


def entry(name: str, kind: bytes = tarfile.REGTYPE, link: str = "", size: int = 0):
    info = tarfile.TarInfo(name)
    info.type, info.linkname, info.size = kind, link, size
    return info


@pytest.mark.parametrize(
    "bad",
    [
        entry("../000001/0000.meta.json"),
        entry("/etc/passwd"),
        entry("000001/../../x"),
        entry("000001/0000.0001.depth.exr/../../../x"),
        entry("000001/x/0000.meta.json"),
        entry("000001/0000.0001.evil.sh"),
        entry("scene/0000.meta.json"),
        entry("000002/0000.meta.json", tarfile.SYMTYPE, "/etc/passwd"),
        entry("000002/0000.meta.json", tarfile.LNKTYPE, GOOD),
        entry("000002/0000.meta.json", tarfile.CHRTYPE),
        entry("000002/0000.meta.json", tarfile.FIFOTYPE),
        entry(GOOD),
        entry("000001/0000.META.JSON"),
    ],
    ids=lambda e: f"{e.name}-{e.type.decode()}",
)
def test_entries_that_are_no_scene_files(tmp_path, bad):
    with pytest.raises(FormatError, match=r"x\.tar"):
        read_shard(make_shard(tmp_path / "x.tar", bad))


def test_a_header_that_claims_more_than_there_is(tmp_path):
    path = make_shard(tmp_path / "x.tar")
    bomb = entry("000001/0000.0001.depth.exr")
    bomb.size = 10**12
    # The header alone: a terabyte that was never written.
    data = path.read_bytes().rstrip(b"\0")
    path.write_bytes(data.ljust(512, b"\0") + bomb.tobuf(tarfile.GNU_FORMAT) + b"\0" * 1024)
    with pytest.raises(FormatError):
        read_shard(path)


def test_too_many_entries(tmp_path, monkeypatch):
    monkeypatch.setattr(public_files, "MAX_ENTRIES", 3)
    extra = [entry(f"{i:06d}/0000.meta.json") for i in range(2, 8)]
    with pytest.raises(FormatError, match="more than 3 entries"):
        read_shard(make_shard(tmp_path / "x.tar", *extra))


@pytest.mark.parametrize("mode", ["w:gz", "w:xz"])
def test_compressed_archives_are_not_opened(tmp_path, mode):
    with pytest.raises(FormatError, match="uncompressed tar"):
        read_shard(make_shard(tmp_path / "x.tar", mode=mode))


@pytest.mark.parametrize("content", [b"", b"not a tar", bytes(range(256)) * 8])
def test_files_that_are_no_archives(tmp_path, content):
    path = tmp_path / "x.tar"
    path.write_bytes(content)
    with pytest.raises((FormatError, InputError)):
        find_scenes(path)


def test_a_shard_cut_short(tmp_path):
    path = make_shard(tmp_path / "x.tar", entry("000001/0000.0001.depth.exr", size=5000))
    path.write_bytes(path.read_bytes()[:2500])
    with pytest.raises(FormatError):
        read_shard(path)


def test_one_scene_in_two_shards(tmp_path):
    make_shard(tmp_path / "a.tar")
    make_shard(tmp_path / "b.tar")
    with pytest.raises(InputError, match="000001 more than once"):
        find_scenes(tmp_path)


def test_nothing_is_written_beside_a_shard(tmp_path):
    path = make_shard(tmp_path / "x.tar")
    [scene] = find_scenes(path)
    with scene.open_path("0000.meta.json") as inside:
        assert inside.is_file()
        assert tmp_path not in inside.parents
    assert not inside.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["x.tar"]

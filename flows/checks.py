"""What DVC and the stages would refuse, said at once: before anything slow is imported or started.

DVC alone needs seconds to start, and Prefect's server up to a minute.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from flows.dag import STAGES
from luxcore.errors import InputError
from luxcore.settings.base import Settings
from luxcore.settings.load import parse_settings, read_yaml

LOCK_COPY = Path(".lux") / "dvc.lock.before"
"""The lock as it was before the last stage, relative to the project root."""
REREAD_S = 0.3


def check_project(root: Path) -> None:
    """Raises InputError naming the file and the fact where no stage of `root` could be run."""
    _check_params(root / "params.yaml")
    _check_dvc_yaml(root / "dvc.yaml")
    locked_stages(root)
    if not (root / ".dvc").is_dir():
        raise InputError(f"{root} has no .dvc folder: `dvc init` makes one.")
    for config in _dvc_configs(root):
        _check_dvc_config(config)
    in_git = any((folder / ".git").exists() for folder in (root, *root.parents))
    if not in_git and not _works_without_git(root):
        raise InputError(f"{root} is not in a git repository, which DVC needs: run `git init`.")


def locked_stages(root: Path) -> set[str]:
    """Stages that `dvc.lock` has a result of. Raises InputError where it is damaged."""
    lock = root / "dvc.lock"
    if not lock.exists():
        return set()
    with suppress(InputError):
        return set(stages_of(lock))
    # DVC writes it in place, and may be doing so for another run at this moment.
    time.sleep(REREAD_S)
    try:
        return set(stages_of(lock))
    except InputError as error:
        copy = root / LOCK_COPY
        remedy = f"copy {copy} over it" if copy.is_file() else "remove it"
        raise InputError(f"{str(error).removesuffix('.')}; {remedy}.") from error


def stages_of(path: Path) -> dict[str, object]:
    """What `dvc.yaml` or `dvc.lock` holds by stage. Raises InputError."""
    document = read_yaml(path)
    stages = document.get("stages", {}) if isinstance(document, dict) else None
    if not isinstance(stages, dict):
        raise InputError(f"{path} is not what DVC writes: it holds no stages by name.")
    return stages


def _check_params(path: Path) -> None:
    values = read_yaml(path)
    settings = parse_settings(values, str(path))
    for name in type(settings).model_fields:
        if name not in values:
            # The stages would take the default, but DVC demands every name that dvc.yaml has.
            default = getattr(settings, name)
            text = "{}" if isinstance(default, Settings) else default
            raise InputError(f"{path} lacks {name}; `{name}: {text}` takes what is usual.")


def _check_dvc_yaml(path: Path) -> None:
    known = stages_of(path)
    for stage in STAGES:
        if stage.name not in known:
            raise InputError(
                f"{path} has no stage {stage.name}; `python -m flows.dvc_file` writes the file."
            )


def _dvc_configs(root: Path) -> list[Path]:
    files = (root / ".dvc" / "config", root / ".dvc" / "config.local")
    return [file for file in files if file.is_file()]


def _check_dvc_config(path: Path) -> None:
    # DVC reads it with the same library, but says so only once it has started.
    from configobj import ConfigObj, ConfigObjError

    try:
        ConfigObj(str(path), interpolation=False, encoding="utf-8")
    except (ConfigObjError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not what DVC writes: {str(error).rstrip('.')}.") from error


def _works_without_git(root: Path) -> bool:
    """Whether DVC was told so, by `dvc config core.no_scm true`."""
    return any(b"no_scm" in file.read_bytes() for file in _dvc_configs(root))

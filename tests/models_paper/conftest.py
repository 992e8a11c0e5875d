"""Tiny bases, written once, and a trainer that stays on the CPU and off the network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.models_paper.bases import write_flux_base, write_sd_base


@pytest.fixture(autouse=True)
def _offline_on_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("ACCELERATE_USE_CPU", "true")


@pytest.fixture
def fresh_accelerator() -> Iterator[None]:
    """accelerate keeps one state per process; each training of a test starts from none."""
    from accelerate.state import AcceleratorState

    AcceleratorState._reset_state(reset_partial_state=True)
    yield
    AcceleratorState._reset_state(reset_partial_state=True)


@pytest.fixture(scope="session")
def flux_base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A random FLUX.1 Kontext of some kilobytes."""
    return write_flux_base(tmp_path_factory.mktemp("flux"))


@pytest.fixture(scope="session")
def sd_base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A random Stable Diffusion 2.1 of some kilobytes."""
    return write_sd_base(tmp_path_factory.mktemp("sd"))

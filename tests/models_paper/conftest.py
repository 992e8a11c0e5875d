"""Tiny bases, written once, and a trainer that stays on the CPU and off the network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.models_paper.bases import write_flux_base, write_sd_base

if TYPE_CHECKING:
    from luxcore.models.flux_kontext.editor import KontextEditor
    from luxcore.models.flux_kontext.embeddings import PromptEmbeddings
    from luxcore.models.multiview_unet.weights_folder import MultiViewModel
    from luxcore.settings.paper_models import MultiViewSettings


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


@pytest.fixture(scope="session")
def embeddings(flux_base: Path) -> PromptEmbeddings:
    """Every instruction through the tiny text encoders."""
    from luxcore.models.flux_kontext.editor import encode_prompts
    from tests.models_paper.edits import settings_of

    return encode_prompts(settings_of(flux_base))


@pytest.fixture
def editor(flux_base: Path) -> KontextEditor:
    """A fresh single-view model."""
    import torch

    from luxcore.models.flux_kontext.editor import load_editor
    from tests.models_paper.edits import settings_of

    return load_editor(settings_of(flux_base), torch.float32, seed=0)


@pytest.fixture
def settings(sd_base: Path) -> MultiViewSettings:
    """Of a multi-view model whose attention spans the views at every resolution."""
    from luxcore.settings.paper_models import MultiViewSettings

    return MultiViewSettings(base=str(sd_base), joint_channels_min=0)


@pytest.fixture
def model(settings: MultiViewSettings) -> MultiViewModel:
    """With the new input channels no longer zero, as after some training."""
    import torch

    from luxcore.models.multiview_unet.weights_folder import load_base

    model = load_base(settings)
    generator = torch.Generator().manual_seed(1)
    torch.nn.init.normal_(model.module.unet.conv_in.weight, std=0.1, generator=generator)
    model.module.eval()
    return model

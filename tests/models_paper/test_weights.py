"""Weights: safetensors only, whole, finite, and matching the model."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from luxcore.errors import FormatError, InputError
from luxcore.models.diffusion.base import base_folder, refuse_pickled_folder
from luxcore.models.diffusion.exported import exported_folder, read_card, write_exported
from luxcore.models.diffusion.options import parse_options, read_settings, training_digest
from luxcore.models.diffusion.weights import assign, read_weights, write_weights
from luxcore.settings.paper_models import KontextSettings, KontextTraining, MultiViewTraining

TENSORS = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.ones(2, dtype=torch.bfloat16)}


def test_written_weights_come_back_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    write_weights(path, TENSORS)
    back = read_weights(path)
    assert back.keys() == TENSORS.keys()
    assert all(torch.equal(back[name], TENSORS[name]) for name in TENSORS)


@pytest.mark.parametrize("suffix", [".pt", ".ckpt", ".bin", ".pkl", ".PTH"])
def test_pickled_file_is_refused_by_name(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"model{suffix}"
    torch.save(TENSORS, path)
    with pytest.raises(InputError, match="pickled"):
        read_weights(path)


def test_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    write_weights(path, TENSORS)
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(FormatError, match=r"w\.safetensors is not a readable"):
        read_weights(path)


def test_absent_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.safetensors does not exist"):
        read_weights(tmp_path / "none.safetensors")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused_both_ways(tmp_path: Path, value: float) -> None:
    from safetensors.torch import save_file

    bad = {"good": torch.ones(2), "bad": torch.tensor([1.0, value])}
    with pytest.raises(FormatError, match="tensor bad"):
        write_weights(tmp_path / "w.safetensors", bad)
    save_file(bad, tmp_path / "w.safetensors")
    with pytest.raises(FormatError, match="tensor bad"):
        read_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize(
    ("given", "fact"),
    [
        ({"other.lora_A": torch.ones(2)}, "1 of 1 tensors match no layer"),
        ({"a": torch.ones(2)}, "lacks 1 tensors, the first is b"),
        ({"a": torch.ones(2), "b": torch.ones(2), "c": torch.ones(1)}, "the first is c"),
        ({"a": torch.ones(2), "b": torch.ones(3)}, r"b must have shape \(2,\), got \(3,\)"),
        ({}, "lacks 2 tensors"),
    ],
)
def test_weights_that_match_only_in_part_change_nothing(
    given: dict[str, torch.Tensor], fact: str
) -> None:
    targets = {"a": torch.zeros(2), "b": torch.zeros(2)}
    with pytest.raises(InputError, match=fact):
        assign(targets, given, "w.safetensors")
    assert not any(target.any() for target in targets.values())


def test_a_base_is_asked_for_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="needs a base"):
        base_folder("", ("vae",))
    with pytest.raises(InputError, match="has no folder vae"):
        base_folder(str(tmp_path), ("vae",))


def test_absent_base_is_not_fetched_when_offline() -> None:
    with pytest.raises(InputError, match=r"nobody/nothing .*hub"):
        base_folder("nobody/nothing", ("vae",))
    with pytest.raises(InputError, match="neither a folder nor a hub id"):
        base_folder("no/such/folder/here", ("vae",))


def test_pickled_base_is_refused_unless_safetensors_lie_beside(tmp_path: Path) -> None:
    (tmp_path / "diffusion_pytorch_model.bin").write_bytes(b"x")
    with pytest.raises(InputError, match=r"diffusion_pytorch_model\.bin is a pickled file"):
        refuse_pickled_folder(tmp_path)
    write_weights(tmp_path / "diffusion_pytorch_model.safetensors", TENSORS)
    refuse_pickled_folder(tmp_path)


def test_exported_folder_says_what_it_holds(tmp_path: Path) -> None:
    settings = KontextSettings(base="somewhere", lora_rank=4)
    write_exported(tmp_path, "flux-kontext", settings, {"w.safetensors": TENSORS})
    assert read_card(tmp_path, "flux-kontext", KontextSettings) == settings
    with pytest.raises(InputError, match="holds weights of flux-kontext, not of multiview-unet"):
        read_card(tmp_path, "multiview-unet", KontextSettings)
    (tmp_path / "model.json").write_text("{")
    with pytest.raises(FormatError, match=r"model\.json"):
        read_card(tmp_path, "flux-kontext", KontextSettings)


def test_models_ship_no_weights() -> None:
    with pytest.raises(InputError, match="ships no weights"):
        exported_folder(None, "flux-kontext")
    with pytest.raises(InputError, match="pickled"):
        exported_folder("weights.ckpt", "flux-kontext")
    with pytest.raises(InputError, match="nowhere is no local folder"):
        exported_folder("nowhere", "flux-kontext")


def test_settings_file_errors_name_file_key_and_fact(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("model: {lora_rnak: 4}\n")
    with pytest.raises(InputError, match=r"s\.yaml: unknown key model\.lora_rnak"):
        read_settings(KontextTraining, path)
    path.write_text("phases: [{steps: 1, batch_size: 1, views: 2}]\n")
    with pytest.raises(InputError, match="1 view"):
        read_settings(KontextTraining, path)
    path.write_text("model: {noise: {prediction: epsilon}}\n")
    with pytest.raises(InputError, match="zero_terminal_snr"):
        read_settings(MultiViewTraining, path)
    path.write_text("- 1\n")
    with pytest.raises(InputError, match="settings by name"):
        read_settings(KontextTraining, path)


def test_defaults_are_the_papers() -> None:
    single, multi = KontextTraining(), MultiViewTraining()
    assert [(p.steps, p.batch_size) for p in single.phases] == [(3000, 192)]
    assert (single.learning_rate, single.model.lora_rank) == (1.0, 32)
    assert [(p.views, p.steps, p.batch_size) for p in multi.phases] == [
        (4, 15_000, 192),
        (8, 10_000, 144),
        (15, 5_000, 96),
    ]
    assert multi.learning_rate == 5e-5


def test_digest_follows_what_is_learned_and_nothing_else() -> None:
    settings = parse_options(KontextTraining, {}, "test")
    same = parse_options(
        KontextTraining,
        {"loop": {"workers": 9, "log_every": 3}, "data": {"root": "x"}, "model": {"base": "y"}},
        "test",
    )
    other = parse_options(KontextTraining, {"loop": {"seed": 1}}, "test")
    assert training_digest(settings) == training_digest(same)
    assert training_digest(settings) != training_digest(other)

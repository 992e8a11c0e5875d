"""Weights files: what fits loads to the same answers, anything else is refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from luxcore.errors import FormatError, InputError
from luxcore.models.backends import open_decomposer, open_harmonizer
from luxcore.models.interface import BackendSettings, Decomposer, Harmonizer
from luxcore.models.small.network import NetworkShape
from luxcore.models.small.weights import CHANNELS, load_network, shipped_weights
from tests.models.sketched import TINY, write_tiny_weights

LIMIT_BYTES = 20_000_000


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    return write_tiny_weights(tmp_path)[0]


def rewritten(path: Path, change: dict[str, torch.Tensor], metadata: dict | None = None) -> Path:
    from safetensors import safe_open

    with safe_open(path, "pt") as file:
        header = file.metadata() if metadata is None else metadata
    save_file({**load_file(path), **change}, str(path), header)
    return path


def test_half_precision_survives_the_file(weights: Path) -> None:
    net, again = load_network(weights, "sv"), load_network(weights, "sv")
    features = torch.rand(1, net.shape.inputs, 16, 16, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        torch.testing.assert_close(net(features), again(features), rtol=0, atol=0)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    torch.save({"stem.weight": torch.zeros(1)}, path)
    with pytest.raises(FormatError, match="not a safetensors file"):
        load_network(path, "sv")


def test_foreign_weights_are_refused(weights: Path) -> None:
    save_file({"unet.conv_in.weight": torch.zeros(3)}, str(weights))
    with pytest.raises(FormatError, match="no weights of the small sv model"):
        load_network(weights, "sv")


def test_weights_of_the_other_model_are_refused(weights: Path) -> None:
    with pytest.raises(FormatError, match="no weights of the small mv model"):
        load_network(weights, "mv")


def test_nan_is_named(weights: Path) -> None:
    bias = load_file(weights)["head.bias"]
    bias[0] = float("nan")
    with pytest.raises(FormatError, match=r"head\.bias has values that are not finite"):
        load_network(rewritten(weights, {"head.bias": bias}), "sv")


def test_a_missing_or_misshapen_tensor_is_named(weights: Path) -> None:
    with pytest.raises(FormatError, match=r"head\.bias is \(3,\)"):
        load_network(rewritten(weights, {"head.bias": torch.zeros(3).half()}), "sv")


@pytest.mark.parametrize("shape", ["[]", "{}", '{"inputs": 27}', '{"inputs": -1, "widths": [8]}'])
def test_a_nonsense_shape_is_refused(weights: Path, shape: str) -> None:
    header = {"format": "lux-small-1", "kind": "sv", "shape": shape}
    with pytest.raises(FormatError):
        load_network(rewritten(weights, {}, header), "sv")


@pytest.mark.parametrize(
    "change", [{"middle": 10**9}, {"widths": [8] * 40}, {"widths": [10**9]}, {"unshuffle": 10**6}]
)
def test_a_network_that_no_memory_holds_is_refused_at_once(weights: Path, change: dict) -> None:
    shape = NetworkShape(*CHANNELS["sv"], TINY).as_metadata() | change
    header = {"format": "lux-small-1", "kind": "sv", "shape": json.dumps(shape)}
    with pytest.raises(FormatError, match="describes no usable network: it is larger than any"):
        load_network(rewritten(weights, {}, header), "sv")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.safetensors does not exist"):
        load_network(tmp_path / "none.safetensors", "sv")


@pytest.mark.parametrize("kind", ["sv", "mv"])
def test_shipped_weights_are_small_half_and_whole(kind: str) -> None:
    path = shipped_weights(kind)
    assert path.stat().st_size <= LIMIT_BYTES
    assert all(tensor.dtype == torch.float16 for tensor in load_file(path).values())
    load_network(path, kind)


def test_backends_are_opened_by_name(tmp_path: Path) -> None:
    sv, mv = write_tiny_weights(tmp_path)
    settings = BackendSettings(str(sv), str(mv), {"long_side_px": 64})
    assert isinstance(open_decomposer("small", settings), Decomposer)
    assert isinstance(open_harmonizer("small", settings), Harmonizer)
    with pytest.raises(InputError, match='no backend "large"; there are small'):
        open_decomposer("large", settings)
    with pytest.raises(InputError, match="no option depth"):
        open_decomposer("small", BackendSettings(str(sv), options={"depth": 3}))
    with pytest.raises(InputError, match="long_side_px must be"):
        open_decomposer("small", BackendSettings(str(sv), options={"long_side_px": 5}))
    with pytest.raises(InputError, match="estimate must be true or false, got maybe"):
        open_decomposer("small", BackendSettings(str(sv), options={"estimate": "maybe"}))


def test_model_cards_name_what_the_weights_came_from() -> None:
    folder = shipped_weights("sv").parent
    for kind in ("sv", "mv", "geometry"):
        card = (folder / f"{kind}.md").read_text(encoding="utf-8")
        for word in ("command", "seed", "parameters", "Limits", "curve"):
            assert word in card, f"{kind}.md says nothing about {word}"
    manifest = json.loads((folder / "data_manifest.json").read_text(encoding="utf-8"))
    splits = np.array([room["split"] for room in manifest["panoramas"]])
    seeds = np.array([room["seed"] for room in manifest["panoramas"]])
    trained = set(seeds[splits == "train"])
    # `make weights` writes a manifest of its rooms alone.
    for part in manifest.get("further", []):
        trained |= {room["seed"] for room in part["panoramas"]}
    assert not trained & set(seeds[splits == "test"])

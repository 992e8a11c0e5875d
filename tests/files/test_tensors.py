"""Equal tensors and metadata are equal bytes, whatever order the library chose."""

from __future__ import annotations

import numpy as np
from safetensors import safe_open
from safetensors.numpy import save_file

from luxcore.files.tensors import settle_header


def test_metadata_has_one_order(tmp_path):
    metadata = {name: name for name in "abcdefgh"}
    tensors = {"weight": np.arange(6, dtype=np.float32)}
    written = set()
    for turn in range(6):
        path = tmp_path / f"{turn}.safetensors"
        save_file(tensors, path, dict(sorted(metadata.items(), reverse=turn % 2 == 0)))
        settle_header(path)
        written.add(path.read_bytes())
        with safe_open(path, "numpy") as file:
            assert file.metadata() == metadata
            assert (file.get_tensor("weight") == tensors["weight"]).all()
    assert len(written) == 1

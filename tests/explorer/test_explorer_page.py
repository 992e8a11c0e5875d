"""The page as a file: self-contained, small, safe with any lamp name, refusing bad input."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from explorer_photo import Photo, make_photo

from luxcore.errors import InputError
from luxcore.explorer import write_explorer


def test_page_asks_nothing_of_any_network(tmp_path: Path, photo: Photo) -> None:
    text = write_explorer(tmp_path / "blend.html", *photo.arguments()).read_text()
    assert not re.search(r"""(src|href|url)\s*[=(]\s*["']?(https?:|//)""", text)
    assert "default-src 'none'" in text


def test_four_lamps_at_full_size_stay_under_four_megabytes(tmp_path: Path) -> None:
    # Grain of 4 % is more than a denoised layer has, and the hardest thing to compress.
    page = write_explorer(tmp_path / "blend.html", *make_photo(683, 1024, 4, 0.04).arguments())
    assert page.stat().st_size <= 4_000_000


def test_a_hostile_lamp_name_stays_text(tmp_path: Path, photo: Photo) -> None:
    hostile = replace(photo, names=["</script><script>alert(1)</script>", "lamp"])
    text = write_explorer(tmp_path / "blend.html", *hostile.arguments()).read_text()
    assert "alert(1)</script>" not in text


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"ambient_linear": np.zeros((4, 4, 3), np.float32)}, "one size"),
        ({"names": ["only one"]}, "must agree"),
        ({"exposure": 0.0}, "positive"),
        ({"scale": np.full((2, 3), np.nan)}, "not finite"),
    ],
)
def test_bad_input_is_one_sentence(
    tmp_path: Path, photo: Photo, change: dict, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        write_explorer(tmp_path / "blend.html", *replace(photo, **change).arguments())
    assert not list(tmp_path.iterdir())

"""The few scores that people ask for first, in words; the tables have all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_COPY, _ALONE = "copying the photo", "each view by itself"
_QUESTIONS = (
    ("lamp on in the photo, photo alone", "single_.+_photo_alone_lamp_on_psnr",
     _COPY, "single_copy_the_input_lamp_on_psnr"),
    ("lamp on in the photo, geometry given", "single_.+_geometry_given_lamp_on_psnr",
     _COPY, "single_copy_the_input_lamp_on_psnr"),
    ("lamp off in the photo, photo alone", "single_.+_photo_alone_lamp_off_psnr",
     _COPY, "single_copy_the_input_lamp_off_psnr"),
    ("lamp in further views, predicted reference", "multi_mv_predicted_reference_psnr",
     _ALONE, "multi_sv_per_view_no_reference_psnr"),
    ("lamp in splats, held-out views", "scene_relit_splats_one_lamp_psnr",
     _COPY, "scene_the_photo_as_it_is_one_lamp_psnr"),
    ("all lamps as photographed in splats, held-out views",
     "scene_relit_splats_as_photographed_psnr", "", ""),
    ("photo put together again from its lamps", "single_lamp_on_recomposition_db", "", ""),
)  # fmt: skip
"""What is asked, the metric that answers it (a pattern, since it holds the backend's name), what it
is held against, and the metric of that."""


@dataclass(frozen=True)
class Answer:
    """One score in dB (PSNR on AgX pictures, light scaled by channel), and a plain way's beside."""

    what: str
    value: float
    beside: str = ""
    """The plain way; empty where there is none."""
    beside_value: float | None = None

    @property
    def row(self) -> tuple[str, str, str, str]:
        """As a row below `COLUMNS`."""
        beside = "" if self.beside_value is None else f"{self.beside_value:.2f}"
        return self.what, f"{self.value:.2f}", beside, self.beside


COLUMNS = ("PSNR of", "this run, dB", "beside it, dB", "which is")


def answers(metrics: Mapping[str, float]) -> list[Answer]:
    """Those of the questions that an evaluation's flat metrics answer."""
    found = []
    for what, pattern, beside, other in _QUESTIONS:
        names = [name for name in sorted(metrics) if re.fullmatch(pattern, name)]
        if names:
            known = other in metrics
            value = metrics[other] if known else None
            found.append(Answer(what, metrics[names[0]], beside if known else "", value))
    return found

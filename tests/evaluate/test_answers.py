"""The scores that people ask for first."""

from __future__ import annotations

from luxcore.evaluate.answers import Answer, answers


def test_the_backends_name_does_not_matter_and_what_is_missing_is_left_out() -> None:
    metrics = {
        "single_flux_kontext_photo_alone_lamp_on_psnr": 24.0,
        "single_flux_kontext_photo_alone_lamp_on_psnr_unscaled": 20.0,
        "single_copy_the_input_lamp_on_psnr": 18.0,
        "scene_relit_splats_one_lamp_psnr": 22.0,
    }
    assert answers(metrics) == [
        Answer("lamp on in the photo, photo alone", 24.0, "copying the photo", 18.0),
        Answer("lamp in splats, held-out views", 22.0),
    ]
    assert answers({}) == []

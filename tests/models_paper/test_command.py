"""The training command: its errors, and what it reports to mlflow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from luxcore.models.diffusion.command import train_command
from luxcore.models.flux_kontext.train import train_kontext
from luxcore.models.multiview_unet.train import train_multiview
from luxcore.settings.paper_models import KontextTraining, MultiViewTraining

pytestmark = pytest.mark.usefixtures("fresh_accelerator")


def run_kontext(tmp_path: Path, text: str) -> int:
    settings = tmp_path / "settings.yaml"
    settings.write_text(text.replace("ROOMS", str(tmp_path / "rooms")))
    arguments = ["--settings", str(settings), "--out", str(tmp_path / "out")]
    return train_command("t", KontextTraining, train_kontext, arguments)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("{}", "needs rendered rooms"),
        ("data: {root: nowhere}", "nowhere does not exist"),
        ("data: {root: ROOMS}", "needs a base"),
        ("{data: {root: ROOMS}, model: {base: nobody/nothing}}", "nobody/nothing"),
        ("model: {variant: unknown}", "model.variant"),
        ("data: {side: 65}", "data.side"),
        ("a: &x 1\nb: *x", "not plain YAML"),
    ],
)
def test_mistakes_are_one_sentence_and_exit_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, fact: str
) -> None:
    """Found before anything heavy is imported: the rooms' files are not even opened."""
    (tmp_path / "rooms").mkdir()
    for name in ("view.json", "view.exr", "view.masks.exr"):
        (tmp_path / "rooms" / name).touch()
    assert run_kontext(tmp_path, text) == 2
    error = capsys.readouterr().err.strip()
    assert fact in error
    assert "\n" not in error
    assert "Traceback" not in error


def test_the_multiview_command_says_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "settings.yaml"
    settings.write_text(f"data: {{root: {tmp_path / 'none'}}}\n")
    arguments = ["--settings", str(settings), "--out", str(tmp_path / "out")]
    assert train_command("t", MultiViewTraining, train_multiview, arguments) == 2
    assert "none does not exist" in capsys.readouterr().err


@pytest.mark.slow
def test_mlflow_gets_curves_and_pictures_in_one_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow import MlflowClient

    from tasks.train_paper import MlflowListener

    uri = f"sqlite:///{tmp_path / 'mlflow.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.chdir(tmp_path)
    MlflowListener(tmp_path).metrics(10, {"loss": 1.0})
    resumed = MlflowListener(tmp_path)
    resumed.metrics(20, {"loss": 0.5})
    resumed.picture(20, "olat", np.zeros((4, 4, 3), np.float32))
    run_id = (tmp_path / "mlflow_run.txt").read_text()
    history = MlflowClient(uri).get_metric_history(run_id, "loss")
    assert [(point.step, point.value) for point in history] == [(10, 1.0), (20, 0.5)]
    assert (tmp_path / "pictures" / "00000020_olat.png").is_file()

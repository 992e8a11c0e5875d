"""The command line: help costs no heavy import, and every mistake is one sentence."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from luxcore.cli import COMMANDS

HEAVY = {"torch", "bpy", "pycolmap", "pyopencl", "cv2", "matplotlib", "viser", "diffusers"}
HEAVY |= {"skimage", "scipy", "prefect", "dvc", "mlflow", "OpenEXR", "transformers"}


def run_lux(*arguments: str, cwd=None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from luxcore.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)


def test_help_of_every_command_imports_nothing_heavy():
    code = (
        "import sys\n"
        "from luxcore.cli import COMMANDS, app\n"
        "for name in [None, *COMMANDS]:\n"
        "    arguments = ['--help'] if name is None else [name, '--help']\n"
        "    app.main(arguments, standalone_mode=False)\n"
        f"print('heavy:', sorted({HEAVY!r} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "heavy: []"


@pytest.mark.parametrize(
    "module",
    [
        "luxcore.models.small.train",
        "luxcore.models.small.ablation",
        "luxcore.models.small.rooms",
        "luxcore.models.flux_kontext.train",
        "luxcore.models.multiview_unet.train",
        "luxcore.evaluate.real_photos",
        "benchmarks.splats",
    ],
)
def test_help_of_tools_run_as_modules_imports_nothing_heavy(module: str) -> None:
    code = (
        "import runpy, sys\n"
        f"sys.argv = [{module!r}, '--help']\n"
        "try:\n"
        f"    runpy.run_module({module!r}, run_name='__main__')\n"
        "except SystemExit as stop:\n"
        "    assert not stop.code\n"
        f"print('heavy:', sorted({HEAVY!r} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "heavy: []"


def test_help_names_every_command():
    listed = run_lux("--help").stdout
    assert all(f"  {name} " in listed for name in COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "fact"),
    [
        (["nope"], "nope"),
        (["run", "rendr"], "did you mean render?"),
        (["schedule"], "--cron"),
        (["remix", "no-such-folder", "--out", "x"], "no-such-folder"),
        (["evaluate", "--dataset", ".", "--sv-weights", "no.st"], "no.st does not exist"),
        (["statistics", ".", "--units", "no-store"], "no-store keeps no seconds"),
        (["relight", "ü \n灯", "--out", "x.png"], "ü  灯/scene.json does not exist"),
        (["relight", "scene", "--ev", "nan", "--out", "x.png"], "'nan' is not a finite number"),
        (["relight", "scene", "--ev", "33", "--out", "x.png"], "range"),
        (["render", "--rooms", "1", "--unit-m", "inf", "--out", "x"], "'inf' is not a finite"),
        (["render", "--rooms", "1", "--unit-m", "nan", "--out", "x"], "'nan' is not a finite"),
    ],
)
def test_a_mistake_is_one_sentence_with_code_2(project_root, arguments, fact):
    done = run_lux(*arguments, cwd=project_root)
    assert done.returncode == 2
    assert fact in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_outside_a_project_says_so(tmp_path):
    done = run_lux("plan", cwd=tmp_path)
    assert done.returncode == 2
    assert "no dvc.yaml" in done.stderr


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path):
    photo, file = tmp_path / "photo.png", tmp_path / "file"
    pixels = np.zeros((32, 32, 3), np.uint8)
    pixels[8:16, 8:16] = 200
    Image.fromarray(pixels).save(photo)
    file.write_text("mine")
    done = run_lux("decompose", str(photo), "--mask", str(photo), "--out", str(file / "out"))
    assert done.returncode == 1
    assert done.stderr == f"lux: {file}: File exists.\n"
    assert file.read_text() == "mine"


def test_a_photo_that_cannot_be_used_is_refused_before_models_are_loaded(tmp_path):
    (tmp_path / "photo.jpg").write_text("no picture")
    code = (
        "import sys\n"
        "from luxcore.cli import app\n"
        "from luxcore.errors import FormatError\n"
        "try:\n"
        "    app.main(sys.argv[1:], standalone_mode=False)\n"
        "except FormatError as error:\n"
        "    print(error, 'torch' in sys.modules)\n"
    )
    arguments = ["decompose", str(tmp_path / "photo.jpg"), "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
    )
    assert done.stdout.endswith("False\n"), done.stdout + done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "fact"),
    [
        (["splat", "render", "no.ply", "--camera", "camera.json", "--out", "x.png"], "no.ply does"),
        (["splat", "render", "folder", "--camera", "camera.json", "--out", "x.png"], "folder is a"),
        (["splat", "render", "no.ply", "--camera", "folder", "--out", "x.png"], "folder is a"),
        (["hdr", "merge", "no.jpg", "no.png", "--out", "x.exr"], "no.jpg does not exist"),
        (
            ["hdr", "merge", "camera.json", "camera.json", "--times", "1,1e400", "--out", "x.exr"],
            "'1e400'",
        ),
        (["evaluate", "--dataset", "none"], "none does not exist"),
        (
            ["evaluate", "--dataset", "folder", "--public-cases", "c", "--public-cameras", "d"],
            "c does not exist",
        ),
        (
            [
                "evaluate",
                "--dataset",
                "folder",
                "--cases",
                "9",
                "--public-cases",
                "c",
                "--public-cameras",
                "d",
            ],
            "--cases does not go with --public-cases",
        ),
        (["decompose", "folder", "--out", "x"], "folder is a folder, not a file"),
    ],
)
def test_what_is_missing_is_said_before_anything_heavy_is_loaded(tmp_path, arguments, fact):
    (tmp_path / "folder").mkdir()
    frame = {"fl_x": 9, "fl_y": 9, "cx": 4, "cy": 4, "w": 8, "h": 8}
    frame["transform_matrix"] = np.eye(4).tolist()
    (tmp_path / "camera.json").write_text(json.dumps(frame))
    code = (
        "import sys\n"
        "from luxcore.cli import app\n"
        "from luxcore.errors import InputError\n"
        "try:\n"
        "    app.main(sys.argv[1:], standalone_mode=False)\n"
        "except InputError as error:\n"
        f"    print(error, sorted({HEAVY - {'OpenEXR'}!r} & set(sys.modules)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert fact in done.stdout, done.stdout + done.stderr
    assert done.stdout.endswith(" []\n")

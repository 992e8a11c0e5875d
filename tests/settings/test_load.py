"""`params.yaml`: every mistake is one sentence that names the key."""

from __future__ import annotations

import pytest

from luxcore.errors import InputError
from luxcore.settings.load import load_settings, parse_settings, read_yaml
from luxcore.settings.project import ProjectSettings


def test_the_shipped_parameters_name_every_section(project_root):
    data = read_yaml(project_root / "params.yaml")
    assert set(data) == set(ProjectSettings.model_fields)
    assert load_settings(project_root / "params.yaml").seed == data["seed"]


def test_an_unknown_key_is_answered_with_the_nearest():
    with pytest.raises(InputError, match=r"unknown key rendr; did you mean render\?"):
        parse_settings({"rendr": {}}, "params.yaml")
    name = next(iter(ProjectSettings().render.model_dump()))
    with pytest.raises(InputError, match=rf"unknown key render\.{name}x; did you mean {name}\?"):
        parse_settings({"render": {f"{name}x": 1}}, "params.yaml")


@pytest.mark.parametrize("seed", [-1, "many", 2**31, None])
def test_a_seed_out_of_range_is_refused(seed):
    with pytest.raises(InputError, match=r"params\.yaml: seed"):
        parse_settings({"seed": seed}, "params.yaml")


def test_seed_zero_is_legal():
    assert parse_settings({"seed": 0}, "params.yaml").seed == 0


@pytest.mark.parametrize(
    "text",
    [
        "seed: !!python/object/apply:os.system ['true']",
        "a: &a [x, x]\nb: [*a, *a]",
        "seed: [1",
        "- just\n- a list",
        "1: {}",
        "seed: " + 5000 * "9",
        "seed: 2024-99-99",
    ],
)
def test_hostile_yaml_is_refused(tmp_path, text):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"params\.yaml"):
        load_settings(path)


@pytest.mark.parametrize(
    ("content", "fact"),
    [
        (b"", "it is empty"),
        (b"seed: \xff", "is not text in UTF-8"),
        (b"seed: 1\nrender: [2", "is not plain YAML: line 2: "),
        (b"seed: 1\nseed: 2", "line 2: the key seed is given twice"),
        (b"render:\n  spp: 1\n  spp: 2", "line 3: the key spp is given twice"),
    ],
)
def test_a_damaged_file_is_one_line_that_names_the_fact(tmp_path, content, fact):
    path = tmp_path / "params.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_settings(path)
    assert str(caught.value).startswith(f"{path} ")
    assert fact in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_huge_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load_settings(tmp_path / "params.yaml")
    with pytest.raises(InputError, match="is a folder"):
        load_settings(tmp_path)
    (tmp_path / "huge.yaml").write_text("#" * 2_000_000)
    with pytest.raises(InputError, match="larger than"):
        load_settings(tmp_path / "huge.yaml")

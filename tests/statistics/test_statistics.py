"""The page of a dataset: its numbers are those of the files, and it opens by itself."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from luxcore.cli.statistics import command
from luxcore.data.compact import RenderedView, save_rendered
from luxcore.data.public_writer import write_scene, write_shards
from luxcore.errors import FormatError, InputError
from luxcore.statistics.charts import histogram, short
from luxcore.statistics.facts import facts_of_files
from luxcore.statistics.page import headline, measures, quantiles, remarks
from luxcore.units import UnitStore
from tests.data.analytic import panorama

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def told(view: RenderedView, **more: object) -> RenderedView:
    """The view with what a render says about itself."""
    noise = {"ambient": 0.5, "light_00": 0.25, "light_01": 2.0}
    energy = {"ambient": 1.0, "light_00": 1.0, "light_01": 1.25}
    lamps = [{"design": "dome", "temperature_k": 3000.0}, {"design": "arc", "temperature_k": 5000}]
    about = {"noise": noise, "energy_factors": energy, "lamps": lamps, "use": "living", "spp": 4}
    return replace(view, metadata={**view.metadata, **about, "topped_up": "light_01", **more})


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    view = told(panorama(height=16, lamps=2))
    save_rendered(view, folder / "train" / "000000")
    bright = view.ambient.copy()
    bright[0, 0] = 1e6
    save_rendered(replace(view, ambient=bright, room="other"), folder / "train" / "000001")
    return folder


def test_facts_are_those_of_the_files(dataset: Path) -> None:
    view = told(panorama(height=16, lamps=2))
    facts = facts_of_files(dataset / "train" / "000001", "b", {"render": 2.0})
    assert facts.clipped_values == 3
    assert facts_of_files(dataset / "train" / "000000", "a").clipped_values == 0
    assert facts.size == (16, 32)
    assert [m.noise for m in facts.lamps] == [0.25, 2.0]
    assert [m.temperature_k for m in facts.lamps] == [3000, 5000]
    assert [m.emitter_px for m in facts.lamps] == [int(m.sum()) for m in view.masks["emitter"]]
    assert facts.window_px == int(view.window.sum())
    assert facts.seconds == {"render": 2.0}


@pytest.mark.parametrize(
    ("damage", "fact"),
    [
        (lambda about: about["lamps"].append(about["lamps"][0]), "emitter_02"),
        (lambda about: about["lamps"][0].pop("kind"), "kind"),
        (lambda about: about["lamps"][0].update(power_w=float("nan")), "power_w is null"),
        (lambda about: about["noise"].update(light_01="loud"), 'light_01 is "loud"'),
        (lambda about: about.update(noise=3), "do not agree"),
        (lambda about: about.update(spp="many"), 'spp is "many"'),
        (lambda about: about.update(effects={"glass": "yes"}), "do not agree"),
    ],
)
def test_a_view_whose_files_differ_is_one_sentence(dataset: Path, damage, fact: str) -> None:
    path = dataset / "train" / "000001.json"
    about = json.loads(path.read_text())
    damage(about)
    path.write_text(json.dumps(about))
    result = CliRunner().invoke(command, [str(dataset)])
    assert isinstance(result.exception, FormatError)
    assert "000001.json" in str(result.exception)
    assert fact in str(result.exception)
    assert not (dataset / "statistics.html").exists()


def test_counts_and_remarks(dataset: Path) -> None:
    views = [facts_of_files(dataset / "train" / f"00000{i}", f"v{i}") for i in range(2)]
    assert headline(views)["rooms"] == "2"
    assert headline(views)["lamps"] == "4"
    assert headline(views)["rendered twice"] == "2"
    assert headline(views)["CPU-s a view"] == "not recorded"
    assert sorted(measures(views)["noise of a lamp"]) == [0.25, 0.25, 2.0, 2.0]
    assert remarks(views)["Noisiest lights"][0] == "v0, lamp_1 (arc): 2"
    assert remarks(views)["Most clipped values"] == ["v1: 3"]


def test_quantiles_of_known_numbers() -> None:
    assert quantiles([0.0, 1.0, 2.0, 3.0, 94.0]) == ("5", "0", "0.2", "2", "20", "75.8", "94")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.012345, "0.0123"),
        (4.5, "4.5"),
        (12345.6, "12,346"),
        (-0.5, "-0.5"),
        (100.0, "100"),
    ],
)
def test_numbers_are_short(value: float, text: str) -> None:
    assert short(value) == text


def test_a_histogram_counts_everything_once() -> None:
    svg = histogram([-5.0, 0.1, 0.2, 0.6, 99.0], [0.0, 0.5, 1.0])
    counts = [int(n) for n in re.findall(r"<title>[^<]*: (\d+)</title>", svg)]
    assert counts == [3, 2]


def test_command_writes_the_page_with_the_seconds_of_the_store(dataset: Path) -> None:
    store = UnitStore(dataset.parent / "units")
    store.root.mkdir()
    line = '{"key": "k", "seconds": {"build": 1.0, "render": 3.5}, "unit": "train/000000"}\n'
    (store.root / "seconds.jsonl").write_text(line)
    out = dataset.parent / "page"
    arguments = [str(dataset), "--out", str(out), "--units", str(store.root), "--title", "A & B"]
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {"statistics.html", "contact_sheet.png"}
    page = (out / "statistics.html").read_text()
    assert "A &amp; B" in page
    assert "<dd>4.5</dd>" in page
    assert "mean of 1 views" in page
    # Nothing is fetched: every address is inside of the page.
    assert set(re.findall(r'(?:src|href)="([^:"]+):', page)) == {"data"}


def test_public_shards_have_a_page_too(tmp_path: Path) -> None:
    view = panorama(height=16, lamps=2)
    scene = write_scene(tmp_path / "scenes", "000010", [view])
    (shard,) = write_shards([scene], tmp_path, "training")
    out = tmp_path / "page"
    result = CliRunner().invoke(command, [str(shard), "--out", str(out)])
    assert result.exit_code == 0, result.output
    page = (out / "statistics.html").read_text()
    assert "000010, view 1" not in page
    assert "Kinds of lamps" in page
    assert "Noise of each lamp" not in page


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tmp_path)])
    assert isinstance(result.exception, InputError)
    assert not list(tmp_path.iterdir())


@pytest.mark.browser
def test_the_page_in_a_browser(dataset: Path, chromium: Browser) -> None:
    assert CliRunner().invoke(command, [str(dataset)]).exit_code == 0
    page = chromium.new_page(viewport={"width": 380, "height": 800})
    # Generous for a loaded machine.
    page.set_default_timeout(180_000)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("request", lambda request: said.append(request.url))
    page.goto((dataset / "statistics.html").as_uri())
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 380
    assert page.evaluate("document.querySelector('.sheet').naturalWidth") > 0
    assert page.locator("svg").count() >= 8
    assert all(url.startswith(("file:", "data:")) for url in said), said
    page.close()

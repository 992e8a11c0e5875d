"""The report shows what the stages left, says where it came from, and needs only its folder."""

from __future__ import annotations

import html.parser
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from luxcore.errors import InputError
from luxcore.files.digests import tree_digest
from luxcore.report import write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FACTS = {
    "revision": "abc123",
    "seed": 0,
    "stages": {"fuse": {"digest": "f" * 64, "params": {"method": "debevec"}}},
}


class Page(html.parser.HTMLParser):
    """Collects what the tests ask about."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.files: list[str] = []
        self.alts: list[str] = []
        self.anchors: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        if tag == "img":
            self.files.append(values["src"])
            self.alts.append(values.get("alt", ""))
        if tag == "section":
            self.anchors.append(values["id"])


@pytest.fixture(scope="module")
def report(artifacts: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(artifacts, tmp_path_factory.mktemp("report"), FACTS)


def test_every_chapter_is_there_and_every_picture_exists(report: Path) -> None:
    page = Page(report.read_text())
    assert page.anchors == [
        "summary", "captures", "consistency", "splats", "tables",
        "failures", "dataset", "effects", "training", "provenance",
    ]  # fmt: skip
    assert len(page.files) > 40
    for file in page.files:
        assert not file.startswith(("http", "/"))
        assert (report.parent / file).stat().st_size > 100
    assert all(page.alts)
    assert "script" not in page.tags


def test_names_from_files_are_text_never_markup(report: Path) -> None:
    text = report.read_text()
    assert "desk <b>lamp</b>" not in text
    assert "desk &lt;b&gt;lamp&lt;/b&gt;" in text


def test_figures_carry_their_provenance(report: Path) -> None:
    text = report.read_text()
    assert "f" * 12 in text
    assert "revision <code>abc123</code>" in text
    assert "method debevec" in text


def test_tables_show_missing_scores_and_the_papers_figures(report: Path) -> None:
    text = report.read_text()
    assert "<td>copy</td><td>lamp on</td><td>8</td><td>14.25</td><td>–</td>" in text
    assert "<td>paper: SD</td><td>its own rooms</td><td></td><td>27.13</td><td></td>" in text


def test_both_stages_of_the_splats_have_their_curve_against_seconds(report: Path) -> None:
    splats = report.read_text().split('id="splats"')[1].split("</section>")[0]
    for stage in ("splat", "relight"):
        assert f"pictures/{stage}-curve.svg" in splats
        assert "time, s" in (report.parent / f"pictures/{stage}-curve.svg").read_text()


def test_effects_that_were_measured_both_ways_are_shown(report: Path) -> None:
    effects = report.read_text().split('id="effects"')[1].split("</section>")[0]
    assert "<td>2.00</td><td>-0.25</td><td>-12.5 %</td><td>3.50</td><td>1.25</td>" in effects
    assert "pictures/effects-demo-demo.jpg" in effects


def test_the_worst_case_leads_the_failures(report: Path) -> None:
    failures = report.read_text().split('id="failures"')[1].split("</section>")[0]
    assert "failure-demo-light_01-0003-truth.jpg" in failures
    first_row = failures.split("<tbody>")[1].split("</tr>")[0]
    assert "<td>ceiling</td><td>3</td>" in first_row


def test_same_artifacts_give_the_same_bytes(artifacts: Path, report: Path, tmp_path: Path) -> None:
    again = write_report(artifacts, tmp_path, FACTS)
    assert tree_digest([tmp_path], tmp_path) == tree_digest([report.parent], report.parent)
    assert again.read_bytes() == report.read_bytes()


def test_a_run_that_has_only_begun_is_reported_as_far_as_it_got(
    artifacts: Path, tmp_path: Path
) -> None:
    started = tmp_path / "artifacts"
    (started / "render").mkdir(parents=True)
    (started / "render" / "train").symlink_to(artifacts / "render" / "train")
    page = Page(write_report(started, tmp_path / "out", {}).read_text())
    assert page.anchors == ["dataset", "effects"]


def test_nothing_to_report_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no results of any stage"):
        write_report(tmp_path, tmp_path / "out", FACTS)


@pytest.mark.browser
def test_it_opens_from_disk_and_fits_a_phone_and_paper(chromium: Browser, report: Path) -> None:
    context = chromium.new_context(viewport={"width": 390, "height": 800})
    page = context.new_page()
    page.goto(report.as_uri())
    page.evaluate("document.querySelectorAll('img').forEach(i => { i.loading = 'eager'; })")
    page.wait_for_function("[...document.images].every(i => i.complete)")
    assert page.evaluate("[...document.images].every(i => i.naturalWidth > 0)")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.pdf().startswith(b"%PDF")
    context.close()

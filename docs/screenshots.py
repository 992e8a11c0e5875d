"""Take the pictures of docs/images from a finished run: `python docs/screenshots.py`.

Needs Debian's Chromium and, for the dashboards, `lux dashboards` running over that run.
"""

from __future__ import annotations

import argparse
import json
import urllib.parse
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from playwright.sync_api import sync_playwright

from luxcore.viewer.app import Viewer
from luxcore.viewer.open import open_scene

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

CHROMIUM = "/usr/bin/chromium"
QUALITY = 85
GOTO_MS = 180_000
"""The dashboards' scripts are megabytes, and this machine may be busy."""
OFFLINE = ["--no-sandbox", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
"""Pages that ask for anything elsewhere are told at once that there is nothing."""
ARGUMENTS = [*OFFLINE, "--use-gl=angle", "--use-angle=swiftshader"]
WIDE = (1400, 860)
CLOSE_CHAT = '[data-component-id="mlflow.assistant.chat_panel.close"]'
EVENING = "split=40&l1=0,0,o"
"""The first lamp off, the photo on the left."""


def shoot(
    browser: Browser | BrowserContext,
    address: str,
    out: Path,
    size: tuple[int, int],
    wait_ms: int,
    click: Sequence[str] = (),
) -> None:
    """One page as a picture, after clicks on what the selectors `click` find first, if anything."""
    page = browser.new_page()
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(address, timeout=GOTO_MS)
    page.wait_for_timeout(wait_ms)
    for selector in click:
        if page.locator(selector).count():
            page.locator(selector).first.click()
            page.wait_for_timeout(wait_ms // 2)
    page.screenshot(path=str(out), type="jpeg", quality=QUALITY, timeout=GOTO_MS)
    page.close()
    print(out)


def ask(address: str, body: dict[str, Any]) -> Any:
    """The answer of a server of ours to a POST."""
    request = urllib.request.Request(
        address, json.dumps(body).encode(), {"Content-Type": "application/json"}
    )
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.load(answer)


def newest_run(address: str, stage: str) -> str:
    """The address of the newest run of a stage in mlflow."""
    search = f"{address}/api/2.0/mlflow/runs/search"
    found = ask(search, {"experiment_ids": ["1"], "filter": f"tags.stage = '{stage}'"})
    return f"{address}/#/experiments/1/runs/{found['runs'][0]['info']['run_id']}"


def shoot_mlflow(browser: Browser, address: str, out: Path, wait_ms: int) -> None:
    """The table of runs; curves and use of the machine of stage 1; a stage's pictures."""
    splat, trained = newest_run(address, "splat"), newest_run(address, "train_sv")
    # The row of a flow opens to the runs of its stages.
    opened = '[data-component-id$="cells_runnamecellrenderer.tsx_46"]'
    pages: dict[str, tuple[str, tuple[str, ...]]] = {
        "runs": (f"{address}/#/experiments/1/runs", (opened,)),
        "run": (splat, ()),
        "curves": (f"{splat}/model-metrics", ()),
        "system": (f"{splat}/system-metrics", ()),
        "pictures": (f"{trained}/artifacts", ('text="pictures"', 'text="validation.png"')),
    }
    context = browser.new_context()
    for name, (page, clicks) in pages.items():
        shoot(context, page, out / f"mlflow_{name}.jpg", WIDE, wait_ms, (CLOSE_CHAT, *clicks))


def shoot_prefect(browser: Browser, address: str, out: Path, wait_ms: int) -> None:
    """The newest finished flow with its tasks, what it says of its stages, and the list of runs."""
    query = {
        "flows": {"name": {"any_": ["luxremix"]}},
        "flow_runs": {"state": {"type": {"any_": ["COMPLETED"]}}},
        "sort": "END_TIME_DESC",
        "limit": 1,
    }
    run = f"{address}/runs/flow-run/{ask(f'{address}/api/flow_runs/filter', query)[0]['id']}"
    context = browser.new_context()
    shoot(context, run, out / "prefect_flow.jpg", WIDE, wait_ms)
    shoot(context, run, out / "prefect_artifacts.jpg", WIDE, wait_ms, ("#artifacts",))
    shoot(context, f"{address}/runs", out / "prefect_runs.jpg", WIDE, wait_ms)


def shoot_viewer(browser: Browser, scene: Path, out: Path, port: int) -> None:
    """The viewer at rest, with its exact picture."""
    viewer = Viewer(open_scene(scene), "127.0.0.1", port, out)
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(f"http://127.0.0.1:{port}")
    page.get_by_text("Exact picture").wait_for(timeout=120_000)
    page.wait_for_timeout(2000)
    # Headless Chromium draws in software, which viser remarks on.
    page.locator(".mantine-Notification-closeButton").first.click()
    page.wait_for_timeout(500)
    page.screenshot(path=str(out / "viewer.jpg"), type="jpeg", quality=QUALITY)
    page.get_by_role("checkbox").nth(2).uncheck()
    # The preview between the two exact pictures may be gone before anyone asks for it.
    page.wait_for_timeout(3000)
    page.get_by_text("Exact picture").wait_for(timeout=120_000)
    page.screenshot(path=str(out / "viewer_lamp_off.jpg"), type="jpeg", quality=QUALITY)
    viewer.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reports", type=Path, default=Path("reports"))
    parser.add_argument("--scene", type=Path, default=Path("artifacts/relight/demo"))
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    parser.add_argument("--mlflow", help="address of mlflow's page, if it runs")
    parser.add_argument("--prefect", help="address of Prefect's page, if it runs")
    parser.add_argument("--wait-ms", type=int, default=8000, help="for a dashboard to fill")
    given = parser.parse_args()
    reports, out = given.reports.resolve().as_uri(), given.out
    blend = f"{reports}/blend-demo.html#{urllib.parse.quote(EVENING, safe='=&,')}"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        if given.mlflow:
            shoot_mlflow(browser, given.mlflow, out, given.wait_ms)
        if given.prefect:
            shoot_prefect(browser, given.prefect, out, given.wait_ms)
        if given.reports.is_dir():
            shoot(browser, f"{reports}/index.html", out / "report.jpg", (1200, 1000), 1500)
            shoot(browser, blend, out / "explorer.jpg", (1400, 860), 3000)
            shoot(browser, blend, out / "explorer_phone.jpg", (390, 844), 3000)
        if given.scene.is_dir():
            shoot_viewer(browser, given.scene, out, 8133)
        browser.close()


if __name__ == "__main__":
    main()

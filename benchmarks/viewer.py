"""How long a moved slider takes: `python benchmarks/viewer.py [--gaussians N] [--lamps K]`.

Times the steps from new weights to bytes that a connected browser has received, and the exact
picture. The connected "browser" is a plain websocket client that drops what it gets: what a real
one spends on drawing depends on its graphics card.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from luxcore.cameras import look_at
from luxcore.splats.gaussians import Gaussians, sh_from_color
from luxcore.splats.relighting import mixing_weights
from luxcore.splats.scene import Scene, SceneLamp, SceneTone
from luxcore.viewer.colours import Colours
from luxcore.viewer.exact import ExactRenderer, Shot
from luxcore.viewer.lighting import lamp_settings, light_names, original_lighting
from luxcore.viewer.splat_node import add_splats


def room(count: int, lamps: int) -> Scene:
    """Random splats on the walls of a 4 m cube."""
    random = np.random.Generator(np.random.PCG64(0))
    points = random.uniform(-2, 2, (count, 3)).astype(np.float32)
    points[np.arange(count), random.integers(0, 3, count)] = 2.0
    gaussians = Gaussians(
        points,
        random.standard_normal((count, 4)).astype(np.float32),
        np.full((count, 3), np.log(4 / np.sqrt(count)), np.float32),
        np.full(count, 2.0, np.float32),
        sh_from_color(np.full((count, 3), 0.5, np.float32)),
    )
    radiance = random.exponential(0.3, (count, lamps + 1, 3)).astype(np.float32)
    names = [SceneLamp(i, f"lamp {i}", True, (1.0, 0.8, 0.6)) for i in range(lamps)]
    tone = SceneTone(1.0, 0.0, 2.2)
    return Scene("bench", gaussians, radiance, tuple(names), (1.0, 1.0, 1.0), tone, 1)


def timed(label: str, work: Callable[[], object], repeats: int) -> float:
    """Median wall and CPU time in ms, after one warm-up; the spread is the middle half."""
    work()
    walls, processor = [], []
    for _ in range(repeats):
        start, busy = time.perf_counter(), time.process_time()
        work()
        walls.append(1e3 * (time.perf_counter() - start))
        processor.append(1e3 * (time.process_time() - busy))
    low, middle, high = statistics.quantiles(walls, n=4)
    print(
        f"{label:42} {middle:8.1f} ms   ({low:.1f} to {high:.1f}, n = {repeats})   "
        f"{statistics.median(processor):8.1f} CPU-ms"
    )
    return middle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gaussians", type=int, default=100_000)
    parser.add_argument("--lamps", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--port", type=int, default=8190)
    given = parser.parse_args()

    import viser
    from websockets.sync.client import connect

    scene = room(given.gaussians, given.lamps)
    names, lighting = light_names(scene), original_lighting(scene)
    weights = mixing_weights(scene, lamp_settings(names, lighting)).astype(np.float32)
    colours = Colours(scene.radiance)
    server = viser.ViserServer(host="127.0.0.1", port=given.port, verbose=False)
    node = add_splats(server, scene.gaussians)
    protocol = f"viser-v{viser.__version__}"
    browser = connect(
        f"ws://127.0.0.1:{given.port}", subprotocols=[protocol], max_size=None, compression=None
    )
    step = 0

    def moved() -> None:
        nonlocal step
        step += 1
        node.rgbs = colours.mixed(weights, 1.0 + step / 100, "AgX")
        received = 0
        while received < 16 * given.gaussians:
            received += len(browser.recv(timeout=20))

    print(f"{given.gaussians} Gaussians, {given.lamps} lamps and ambient")
    mix = partial(colours.mixed, weights, 1.0, "AgX")
    timed("mix and tone-map every Gaussian", mix, given.repeats)
    while True:
        try:
            browser.recv(timeout=2)
        except TimeoutError:
            break
    timed("slider moved to new colours in the browser", moved, given.repeats)
    renderer = ExactRenderer(scene)
    camera = look_at(np.array([-1.5, -1.5, 0.0]), np.array([2.0, 2.0, 0.0]), 70.0, 960, 640)
    timed("exact picture, 960x640", lambda: renderer.display(Shot(camera, lighting)), 5)
    browser.close()
    server.stop()


if __name__ == "__main__":
    main()

"""`lux view`: a scene in the browser, relit while a slider moves.

Two pictures take turns. While something moves, the browser draws the splats with one colour per
Gaussian. Once the camera and the sliders rest, the OpenCL engine's exact picture covers them. Both
are asked for through latest-wins queues, so that no stale frame is ever drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from luxcore.cameras import Camera
from luxcore.errors import LuxError
from luxcore.ports import check_port
from luxcore.splats.relighting import mixing_weights
from luxcore.splats.scene import Scene
from luxcore.viewer.cameras import camera_of_browser, place_browser
from luxcore.viewer.colours import Colours
from luxcore.viewer.exact import ExactRenderer, Shot
from luxcore.viewer.files_menu import FilesMenu
from luxcore.viewer.latest import LatestWins
from luxcore.viewer.lighting import Lighting, lamp_settings, light_names
from luxcore.viewer.panel import Panel
from luxcore.viewer.splat_node import add_splats
from luxcore.viewer.tabs import MAX_PIXELS, Tab

REST_S = 0.25
"""Stillness after which the exact picture is rendered."""


@dataclass(frozen=True)
class ViewedScene:
    """A scene and what the viewer shows beside it."""

    scene: Scene
    cameras: tuple[Camera, ...]
    """Those of the photos; the first is where a browser starts."""
    thumbnails: dict[int, Path]
    """Lamp index → picture."""


class Viewer:
    """A running server. Close it to free the port and the threads."""

    def __init__(self, viewed: ViewedScene, host: str, port: int, out: Path) -> None:
        import viser

        check_port(host, port)
        self.viewed = viewed
        self._names = light_names(viewed.scene)
        self._colours = Colours(viewed.scene.radiance)
        self._tabs: dict[int, Tab] = {}
        self.renderer = ExactRenderer(viewed.scene)
        with redirect_stdout(StringIO()):
            # Its banner says where it listens; the command line says that already.
            self.server = viser.ViserServer(host=host, port=port, verbose=False)
        # A page must not be able to publish itself through viser's public tunnel.
        self.server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
        self.server.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=True)
        self.server.gui.set_panel_label(viewed.scene.name)
        self._node = add_splats(self.server, viewed.scene.gaussians)
        self.fast: LatestWins[Lighting] = LatestWins(self._recolour, self._complain)
        self.exact: LatestWins[Callable[[Callable[[], bool]], None]] = LatestWins(
            self._run, self._complain, REST_S
        )
        self.films: LatestWins[Callable[[Callable[[], bool]], None]] = LatestWins(
            self._run, self._complain
        )
        self.panel = Panel(self.server.gui, viewed.scene, viewed.thumbnails, self._lighting_changed)
        self.files = FilesMenu(self, out)
        if viewed.cameras:
            place_browser(self.server.initial_camera, viewed.cameras[0], _depth(viewed))
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._disconnected)
        self._lighting_changed()

    def close(self) -> None:
        """Stop serving; work under way is finished, work waiting is dropped."""
        self.fast.close()
        self.exact.close()
        self.films.close()
        with redirect_stdout(StringIO()):
            self.server.stop()

    def tab(self, client: Any) -> Tab:
        """The tab of a connected browser."""
        return self._tabs[client.client_id]

    def shot(self, client: Any) -> Shot:
        """What a browser is looking at now."""
        return Shot(camera_of_browser(client.camera, MAX_PIXELS), self.panel.read())

    def _lighting_changed(self) -> None:
        self.fast.submit("colours", self.panel.read())
        for tab in list(self._tabs.values()):
            self._moved(tab)

    def _moved(self, tab: Tab) -> None:
        """Something that a tab shows has changed: uncover the splats, ask for a new picture."""
        tab.show_fast()
        self.exact.submit(tab.client.client_id, lambda is_current: self._render(tab, is_current))

    def _recolour(self, key: Hashable, lighting: Lighting, is_current: Callable[[], bool]) -> None:
        settings = lamp_settings(self._names, lighting)
        weights = mixing_weights(self.viewed.scene, settings).astype("float32")
        gain = self.viewed.scene.tone.exposure * 2.0**lighting.exposure_ev
        colours = self._colours.mixed(weights, gain, lighting.tone)
        if is_current():
            self._node.rgbs = colours

    def _run(
        self, key: Hashable, work: Callable[[Callable[[], bool]], None], current: Callable[[], bool]
    ) -> None:
        work(current)

    def _render(self, tab: Tab, is_current: Callable[[], bool]) -> None:
        display = self.renderer.display(self.shot(tab.client))
        if is_current():
            tab.show_exact(display)

    def _connected(self, client: Any) -> None:
        tab = self._tabs[client.client_id] = Tab(client)
        client.camera.on_update(lambda _: self._moved(tab))
        self._moved(tab)

    def _disconnected(self, client: Any) -> None:
        self._tabs.pop(client.client_id, None)
        self.exact.cancel(client.client_id)

    def _complain(self, error: Exception) -> None:
        """Tell every browser; what was shown stays."""
        known = isinstance(error, LuxError)
        body = str(error) if known else f"{type(error).__name__}: {error}"
        for tab in list(self._tabs.values()):
            tab.client.add_notification("That did not work", body, color="red")


def _depth(viewed: ViewedScene) -> float:
    """Distance of the middle of the room in front of the first photo's camera."""
    camera = viewed.cameras[0]
    middle = viewed.scene.gaussians.means.mean(axis=0)
    return max(0.1, float((middle - camera.centre) @ camera.c2w[:3, 2]))

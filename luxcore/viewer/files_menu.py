"""Folders of the panel that read and write files: presets, the camera's path, stills."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luxcore.cameras import Camera
from luxcore.errors import InputError
from luxcore.files.exr import write_exr
from luxcore.viewer.cameras import camera_of_browser, place_browser
from luxcore.viewer.exact import FilmStoppedError, Shot, write_film
from luxcore.viewer.path import camera_path
from luxcore.viewer.presets import load_preset, preset_value
from luxcore.viewer.tabs import MAX_PIXELS

if TYPE_CHECKING:
    from luxcore.viewer.app import Viewer

FILM_KEY = "film"


class FilesMenu:
    """Adds its folders to the viewer's panel. Films and stills are written below `out`."""

    def __init__(self, viewer: Viewer, out: Path) -> None:
        self._viewer, self._out = viewer, out
        gui = viewer.server.gui
        with gui.add_folder("presets", expand_by_default=False):
            gui.add_button("Save lighting").on_click(self._save_preset)
            self._upload = gui.add_upload_button("Load lighting", mime_type="application/json")
            self._upload.on_upload(self._load_preset)
        with gui.add_folder("camera", expand_by_default=False):
            count = len(viewer.viewed.cameras)
            self._view = gui.add_slider("photo", 0, max(count - 1, 1), 1, 0, disabled=count < 2)
            self._view.on_update(self._go_to_photo)
            gui.add_button("Add keyframe").on_click(self._add_keyframe)
            gui.add_button("Clear keyframes").on_click(self._clear_keyframes)
            self.seconds = gui.add_slider("seconds", 1, 30, 1, 4)
            self.fps = gui.add_slider("frames a second", 5, 60, 1, 24)
            self._loop = gui.add_checkbox("loop", False)
            gui.add_button("Render film", hint="PNG pictures and an MP4").on_click(self._film)
            gui.add_button("Stop film").on_click(lambda _: viewer.films.cancel(FILM_KEY))
            gui.add_button("Still (EXR)", hint="linear light").on_click(self._still)

    def _save_preset(self, event: Any) -> None:
        value = preset_value(self._viewer.viewed.scene, self._viewer.panel.read())
        text = json.dumps(value, indent=1, sort_keys=True) + "\n"
        event.client.send_file_download("lighting.json", text.encode(), save_immediately=True)

    def _load_preset(self, event: Any) -> None:
        file = event.target.value
        try:
            text = file.content.decode("utf-8", errors="replace")
            lighting = load_preset(text, file.name, self._viewer.viewed.scene)
        except InputError as error:
            event.client.add_notification("Preset not loaded", str(error), color="red")
            return
        self._viewer.panel.show(lighting)

    def _go_to_photo(self, event: Any) -> None:
        if event.client is not None:
            camera = self._viewer.viewed.cameras[int(self._view.value)]
            place_browser(event.client.camera, camera, distance=2.0)

    def _add_keyframe(self, event: Any) -> None:
        keyframes = self._viewer.tab(event.client).keyframes
        keyframes.append(camera_of_browser(event.client.camera, MAX_PIXELS))
        event.client.add_notification(
            "Keyframe", f"{len(keyframes)} so far.", auto_close_seconds=2.0
        )

    def _clear_keyframes(self, event: Any) -> None:
        self._viewer.tab(event.client).keyframes.clear()

    def _film(self, event: Any) -> None:
        client, fps = event.client, int(self.fps.value)
        keyframes = self._viewer.tab(client).keyframes
        if len(keyframes) < 2:
            body = (
                f"A film leads from keyframe to keyframe: it needs two, there are {len(keyframes)}."
            )
            client.add_notification("No film yet", body, color="red")
            return
        frames = fps * int(self.seconds.value)
        cameras = camera_path(keyframes, frames, loop=bool(self._loop.value))
        self._viewer.films.submit(
            FILM_KEY, lambda is_current: self._write_film(client, cameras, fps, is_current)
        )

    def _write_film(
        self, client: Any, cameras: list[Camera], fps: int, is_current: Callable[[], bool]
    ) -> None:
        lighting = self._viewer.panel.read()
        folder = self._out / f"film-{_stamp()}"
        note = client.add_notification("Film", "", loading=True, with_close_button=False)

        def tell(done: int) -> None:
            note.body = f"{done} of {len(cameras)} pictures"

        try:
            shots = [Shot(camera, lighting) for camera in cameras]
            film = write_film(folder, self._viewer.renderer, shots, fps, is_current, tell)
        except FilmStoppedError:
            body = f"Stopped; the pictures so far are in {folder.resolve()}."
            client.add_notification("Film", body, color="yellow")
            return
        finally:
            note.remove()
        client.add_notification("Film", f"{film.resolve()}", color="green")

    def _still(self, event: Any) -> None:
        client, shot = event.client, self._viewer.shot(event.client)

        def write(is_current: Callable[[], bool]) -> None:
            path = self._out / f"still-{_stamp()}.exr"
            write_exr(path, {"image": self._viewer.renderer.linear(shot)}, half=False)
            client.add_notification("Still", f"{path.resolve()}", color="green")

        self._viewer.exact.submit(("still", client.client_id), write)


def _stamp() -> str:
    return datetime.now().strftime("%Y%m%d-%H%M%S")

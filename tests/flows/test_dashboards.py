"""Servers that start, answer and end together. Small stand-ins take the place of the real."""

from __future__ import annotations

import json
import socket
import sys
from pathlib import Path

import pytest

from flows.dashboards import dashboards, serve_dashboards
from flows.prefect_settings import prefect_environment
from flows.servers import Server, prefect_server
from flows.shared_server import name_server
from luxcore.errors import InputError, LuxError
from luxcore.ports import free_port

SERVER = """
import http.server, sys
handler = http.server.SimpleHTTPRequestHandler
http.server.test(handler, port=int(sys.argv[1]), bind="127.0.0.1")
"""


def stand_in(port: int, program: str = SERVER) -> Server:
    return Server(f"page {port}", port, "/", (sys.executable, "-c", program, str(port)), {})


def test_all_listen_on_loopback_only_and_know_their_records(tmp_path: Path) -> None:
    runs, flows = dashboards(tmp_path, 5001, 4201, 4301)
    assert runs.command[runs.command.index("--host") + 1] == "127.0.0.1"
    assert flows.command[flows.command.index("--host") + 1] == "127.0.0.1"
    assert f"sqlite:///{tmp_path / 'mlflow.db'}" in runs.command
    assert flows.address == "http://127.0.0.1:4201"
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "index.html").write_text("")
    report = dashboards(tmp_path, 5001, 4201, 4301)[2]
    assert report.command[report.command.index("--bind") + 1] == "127.0.0.1"


def test_runs_schedules_and_dashboards_share_one_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PREFECT_HOME", raising=False)
    monkeypatch.delenv("PREFECT_SERVER_DATABASE_CONNECTION_URL", raising=False)
    here = prefect_environment(tmp_path)
    assert here["PREFECT_HOME"] == str(tmp_path / ".lux" / "prefect")
    for schedules in (True, False):
        assert (
            here.items() <= prefect_server(tmp_path, 4201, schedules=schedules).environment.items()
        )


def test_addresses_are_said_once_they_answer_and_all_ends_with_the_command(
    tmp_path: Path,
) -> None:
    pages = (stand_in(free_port()), stand_in(free_port()))
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        if "Ctrl-C" in line:
            raise KeyboardInterrupt
        socket.create_connection(("127.0.0.1", int(line.split(":")[-1]))).close()

    with pytest.raises(KeyboardInterrupt):
        serve_dashboards(tmp_path, pages, say)
    assert [line.split(": ")[0] for line in said[:2]] == [page.title for page in pages]
    for page in pages:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", page.port))


def test_a_server_that_dies_names_its_log(tmp_path: Path) -> None:
    pages = (stand_in(free_port()), stand_in(free_port(), "raise SystemExit('no database')"))
    with pytest.raises(LuxError, match="did not start; its log is") as caught:
        serve_dashboards(tmp_path, pages, lambda _: None)
    log = Path(str(caught.value).split("log is ")[1].rstrip("."))
    assert "no database" in log.read_text()


def test_a_port_in_use_is_one_sentence(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = int(taken.getsockname()[1])
        with pytest.raises(InputError, match=f"port {port} on 127.0.0.1"):
            serve_dashboards(tmp_path, dashboards(tmp_path, port, 1, 2), lambda _: None)


def test_a_port_given_twice_is_one_sentence(tmp_path: Path) -> None:
    port = free_port()
    with pytest.raises(InputError, match=f"port {port} is asked for by mlflow and Prefect"):
        serve_dashboards(tmp_path, dashboards(tmp_path, port, port, 1), lambda _: None)


@pytest.mark.parametrize("note", ["", "{", "[]", '{"port": "x"}'])
def test_a_damaged_note_of_the_last_port_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, note: str
) -> None:
    for name, value in {**prefect_environment(tmp_path), "PREFECT_API_URL": ""}.items():
        monkeypatch.setenv(name, value)
    home = tmp_path / "home"
    monkeypatch.setenv("PREFECT_HOME", str(home))
    home.mkdir()
    (home / "server.json").write_text(note)
    server = name_server(tmp_path)
    assert server is not None
    assert json.loads((home / "server.json").read_text()) == {"port": server.port}

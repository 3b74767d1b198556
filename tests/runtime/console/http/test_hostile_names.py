"""Paths, names and tokens that no file has: a 4xx with one line on every route, an error for every command."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

from config.errors import UserError
from runtime.console.commands.command_error import CommandError
from runtime.console.files.jobs import Jobs
from runtime.console.files.recording_files import RecordingFiles
from runtime.recording.folder_files import delete_recording, describe_recordings, pin_recording
from tests.hil.machine import TIMEOUT_S
from tests.runtime.console.console_case import ConsoleCase
from tests.runtime.console.files.files_case import with_files
from tests.runtime.console.sample_messages import ALL

pytestmark = pytest.mark.promise("P22")

NAMES = (
    "a" * 5000, "a" * 300, "a" * 256, "a" * 251 + ".mcap", "%F0%9F%A4%96" * 200, "run.mcap%00", "%00", "%0A%0D",
    "%1B%5B2J", "%FF%FE", "%ED%A0%80", "%ED%A0%80.mcap", "%C0%AE%C0%AE/secret.mcap", "../secret.mcap",
    "..%2Fsecret.mcap", "%2E%2E%2Fsecret.mcap", "..", ".", "", "/", "%2Fetc%2Fpasswd", "%", "%zz", "%u0000",
    "run.mcap/", "run.mcap/..", "con:", "*", "~", "-rf", "%E2%80%AE.mcap",
)  # fmt: skip
ROUTES = (
    "/{name}", "/page/{name}", "/recording?token={token}&file={name}", "/made?token={token}&job=1&file={name}",
    "/made?token={token}&job={name}&file=x", "/log?token={name}", "/recording?token={name}&file=run.mcap",
    "/ws?token={name}", "/ws?token={token}&x={name}", "/recording?{name}", "/recording?token={token}&token={name}",
)  # fmt: skip


async def status_of(case: ConsoleCase, target: str) -> tuple[int, bytes]:
    """Send a request target as it is; return the status and the body, 0 if the connection was closed."""
    reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
    writer.write(f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1:{case.url.port}\r\n\r\n".encode("latin-1"))
    async with asyncio.timeout(TIMEOUT_S):
        answer = await reader.read()
    writer.close()
    case.clock[0] += 1.0
    head, _, body = answer.partition(b"\r\n\r\n")
    return int(head.split()[1]) if head else 0, body


async def test_no_name_on_any_route_is_an_error_of_the_server(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    async with with_files(folder) as case:
        for route in ROUTES:
            for name in NAMES:
                status, body = await status_of(case, route.format(name=name, token=case.token))
                assert status == 0 or 400 <= status < 500 or (status == 200 and name in ("", ".")), (route, name)
                assert b"Traceback" not in body
                assert body != b"elsewhere"
        assert case.run.health.fault() is None
        status, body = await status_of(case, f"/recording?token={case.token}&file={'a' * 5000}")
        assert (status, body) == (400, b"a name that no file can have")


HOSTILE: tuple[str, ...] = (
    "a" * 300, "a" * 255, "ä" * 200, "run.mcap\x00", "\x00", "\n", "\x1b[2J", "\ud800", "\udcff.mcap",
    "../secret.mcap",
    "/etc/passwd",
    "..", ".", "run.mcap/", "~", "%00", "\u202e.mcap", "x" * 251 + ".mcap",
)  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
async def test_no_name_in_a_command_on_recordings_is_an_error_of_the_program(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    for path in (folder / "run.mcap", tmp_path / "secret.mcap"):
        path.write_bytes(b"")
    files = RecordingFiles(folder, lambda: None, Jobs())
    for command in (
        files.find(name), files.pin(name, pinned=True), files.delete(name), files.make("map", name),
        files.rename(name, "x"), files.rename("run.mcap", name),
    ):  # fmt: skip
        with pytest.raises((CommandError, UserError)):
            await command
    assert (folder / "run.mcap").exists()
    assert (tmp_path / "secret.mcap").exists()


async def test_no_text_in_a_command_over_a_websocket_is_left_without_an_answer(tmp_path: Path) -> None:
    """Every text of every command, in escapes too: a lone surrogate is no JSON, and so is answered without an id."""
    folder = tmp_path / "runs"
    folder.mkdir()
    async with with_files(folder) as case:
        page = await case.page()
        for sample in ALL:
            for key in (key for key, value in sample.items() if isinstance(value, str) and key != "type"):
                for text in HOSTILE:
                    message = {"id": 7, **sample, key: text}
                    await page.socket.send_str(json.dumps(message))
                    answer = await page.next("answer")
                    assert answer["id"] in (7, None), (message, answer)
                    assert "Traceback" not in str(answer["error"])
                    case.clock[0] += 1.0
        assert case.run.health.fault() is None


def test_a_recording_whose_name_leaves_no_room_for_a_pin_is_listed_and_deleted(tmp_path: Path) -> None:
    name = "x" * 250 + ".mcap"
    (tmp_path / name).write_bytes(b"")
    assert [each.pinned for each in describe_recordings(tmp_path)] == [False]
    with pytest.raises(UserError, match="cannot be pinned"):
        pin_recording(tmp_path, name, pinned=True)
    delete_recording(tmp_path, name)
    assert not list(tmp_path.iterdir())

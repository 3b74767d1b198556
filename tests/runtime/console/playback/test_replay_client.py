"""Replay workers as processes: opened, moved, closed, and one for each client."""

from __future__ import annotations

import asyncio
import os
import random
import shutil
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import orjson
import pytest

from runtime.console.clients.client import Frame
from runtime.console.frames.frame_encoder import EncodedFrame
from runtime.console.playback.replay_client import WORKERS_MAX, ReplayClient, ReplayError, ReplayProcess
from runtime.console.playback.replay_worker import ANSWER, HEADER
from runtime.recording.storage import find_recording, list_recordings
from runtime.support.child_process import ECHOLOCATE, kill_child, start_child
from tests.hil.machine import TIMEOUT_S
from tests.recorded import hall, record, spoil

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

PROGRAM = "tests.runtime.console.stub_frames"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    record(hall(), folder / "hall.mcap", 5.0)
    (folder / "broken.mcap").write_bytes(b"\x89MCAP0\r\nno recording")
    return folder


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bear a busy machine: only what hangs takes so long to open."""
    monkeypatch.setattr("runtime.console.playback.replay_client.OPEN_MAX_S", TIMEOUT_S)


class Page:
    """A client that keeps what it is sent."""

    def __init__(self) -> None:
        self.is_gone = False
        self.live: list[bool] = []
        self.frames: list[EncodedFrame] = []
        self.messages: list[Mapping[str, Any]] = []

    def switch(self, *, live: bool) -> None:
        self.live.append(live)

    def show(self, frame: Frame) -> None:
        assert isinstance(frame, EncodedFrame)
        self.frames.append(frame)

    def send(self, message: Mapping[str, Any]) -> None:
        self.messages.append(message)

    @property
    def last(self) -> dict[str, Any]:
        return dict(orjson.loads(self.frames[-1].encode(follows=False, dropped=0, controls=True)))


async def until(done: Callable[[], bool]) -> None:
    async with asyncio.timeout(TIMEOUT_S):
        while not done():
            await asyncio.sleep(0.005)


@asynccontextmanager
async def replay_client(folder: Path, current: str | None = None) -> AsyncIterator[ReplayClient]:
    client = ReplayClient(folder, PROGRAM, lambda: current)
    try:
        yield client
    finally:
        await client.close()


async def test_a_recording_is_opened_moved_and_closed(folder: Path) -> None:
    page = Page()
    async with replay_client(folder) as client:
        about = await client.open(page, "hall.mcap")
        recorded: Mapping[str, Any] = about["about"]
        assert recorded == {"sensors": 24, "emulated": True}
        assert (about["file"], about["cycles"], about["duration_s"]) == ("hall.mcap", 100, 4.95)
        assert about["modes"][-1][1] == "DRIVE"
        assert page.live == [False]
        await until(lambda: bool(page.frames))
        assert (page.last["cycle"], page.last["segments"]) == (1, {"whole": True})
        changes = orjson.loads(page.frames[-1].encode(follows=True, dropped=3, controls=False))
        assert (changes["segments"], changes["dropped"], changes["controller"]) == ({"whole": False}, 3, False)
        await client.seek(page, 3.0)
        await until(lambda: page.last["cycle"] == 61)
        await client.step(page, -1)
        await until(lambda: page.last["cycle"] == 60)
        await client.play(page, 50.0)
        await until(lambda: page.last["cycle"] == 100 and not page.last["playing"])
        await client.close_recording(page)
        assert page.live == [False, True]
        with pytest.raises(ReplayError, match="no recording is open"):
            await client.seek(page, 1.0)
        count = len(page.frames)
        await asyncio.sleep(0)
        assert len(page.frames) == count


@pytest.mark.soak
async def test_a_recording_with_refused_keyframes_is_played_and_they_are_named(folder: Path, tmp_path: Path) -> None:
    spoil(folder / "hall.mcap", tmp_path / "spoiled.mcap", range(100))
    page = Page()
    async with replay_client(tmp_path) as client:
        await client.open(page, "spoiled.mcap")
        await client.seek(page, 4.5)
        await until(lambda: bool(page.frames) and page.last["cycle"] == 91)
        (problem,) = (message for message in page.messages if message["type"] == "replay_problem")
        assert "canyon_map.firings is -7" in problem["error"]


async def test_a_process_that_cannot_be_started_is_an_answer(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def full(*_args: object, **_named: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    page = Page()
    async with replay_client(folder) as client:
        with monkeypatch.context() as patch:
            patch.setattr("runtime.console.playback.replay_client.start_child", full)
            for _ in range(WORKERS_MAX + 1):
                with pytest.raises(ReplayError, match="no process can be started to replay it: Resource temporarily"):
                    await client.open(page, "hall.mcap")


async def test_invalid_recordings_positions_and_speeds_are_refused(folder: Path) -> None:
    page = Page()
    async with replay_client(folder) as client:
        for name in ("", "none.mcap", "../runs/hall.mcap", str(folder / "hall.mcap"), "hall", "/etc/passwd"):
            with pytest.raises(ReplayError, match="there is no recording"):
                await client.open(page, name)
        with pytest.raises(ReplayError, match=r"broken\.mcap: holds no readable message"):
            await client.open(page, "broken.mcap")
        assert page.live == []
        with pytest.raises(ReplayError, match="finite"):
            await client.seek(page, float("nan"))
        for speed in (1e9, -1.0, float("nan")):
            with pytest.raises(ReplayError, match="speed"):
                await client.play(page, speed)


async def test_workers_are_limited_their_death_is_reported_and_none_outlives_the_client(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_client.WORKERS_MAX", 2)
    elsewhere, page, other = str(tmp_path / "elsewhere.mcap"), Page(), Page()
    shutil.copy(folder / "hall.mcap", elsewhere)
    async with replay_client(folder, elsewhere) as client:
        found = await client.recordings()
        assert (found[0]["file"], found[0]["live"]) == (elsewhere, True)
        opening = client.open(page, "hall.mcap"), client.open(other, elsewhere)
        assert [about["cycles"] for about in await asyncio.gather(*opening)] == [100, 100]
        processes = [replay._process for replay in client._open.values()]
        pids = [process.pid for process in processes]
        assert len(set(pids)) == 2
        with pytest.raises(ReplayError, match="open already"):
            await client.open(Page(), "hall.mcap")
        replay = client._open[id(page)]
        replay._process.kill()
        await until(lambda: replay.is_over)
        await until(lambda: bool(page.messages))
        assert page.messages[-1]["type"] == "replay_problem"
        assert "has ended: open the recording again" in page.messages[-1]["error"]
        with pytest.raises(ReplayError, match="has ended"):
            await client.seek(page, 1.0)
        await client.open(page, "hall.mcap")
        pids.append(client._open[id(page)]._process.pid)
        client.leave(other)
        await until(lambda: not client._closing)
        assert list(client._open) == [id(page)]
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


async def test_a_worker_that_writes_many_errors_is_not_held_up(tmp_path: Path) -> None:
    """Its errors must be read while it plays: it would wait for ever once their pipe is full."""
    answer = tmp_path / "answer"
    answer.write_bytes(HEADER.pack(ANSWER, 0, 0, 2, 0, 0) + b"{}")
    program = f"cat {answer}; head -c 1000000 /dev/zero >&2; cat {answer}; exec sleep 600"
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        "/bin/sh", "-c", program, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
    )
    answers: list[Mapping[str, Any]] = []
    replay = ReplayProcess(process, lambda _: None, answers.append)
    try:
        await replay.begin()
        await until(lambda: answers == [{}])
    finally:
        await replay.close()


@asynccontextmanager
async def counted_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Callable[[], int]]:
    """Replace the workers by processes that answer and wait; yield the number of those that run."""
    answer = tmp_path / "answer"
    answer.write_bytes(HEADER.pack(ANSWER, 0, 0, 2, 0, 0) + b"{}")
    started: list[asyncio.subprocess.Process] = []

    async def start(*_: object, **__: object) -> asyncio.subprocess.Process:
        program = f"sleep 0.0$$; cat {answer}; exec sleep 600"
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(
            "/bin/sh", "-c", program, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )
        started.append(process)
        return process

    monkeypatch.setattr("runtime.console.playback.replay_client.start_child", start)
    try:
        yield lambda: sum(process.returncode is None for process in started)
    finally:
        for process in started:
            await kill_child(process)


@pytest.mark.promise("P19")
async def test_a_page_that_opens_again_and_again_has_one_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.mcap").touch()
    page = Page()
    async with counted_workers(tmp_path, monkeypatch) as running, replay_client(tmp_path) as client:
        for _ in range(4):
            found = await asyncio.gather(*(client.open(page, "run.mcap") for _ in range(8)), return_exceptions=True)
            assert running() == 1
            assert 1 <= sum(isinstance(one, dict) for one in found) <= WORKERS_MAX
        await client.close_recording(page)
        assert running() == 0


@pytest.mark.promise("P19")
async def test_pages_that_close_while_they_open_leave_no_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    """Cancelled at any moment, twice in a row, and with the page gone or not."""
    (tmp_path / "run.mcap").touch()
    rng, most = random.Random(1), 0
    async with counted_workers(tmp_path, monkeypatch) as running, replay_client(tmp_path) as client:
        for _ in range(6):
            pages = [Page() for _ in range(8)]
            tasks = [asyncio.create_task(client.open(page, "run.mcap")) for page in pages]
            for page, task in zip(pages, tasks, strict=True):
                for _ in range(rng.randrange(40)):
                    await asyncio.sleep(0)
                most = max(most, running())
                page.is_gone = True
                task.cancel()
                await asyncio.sleep(0)
                task.cancel()
                client.leave(page)
            await asyncio.gather(*tasks, return_exceptions=True)
            await until(lambda: not client._closing and running() == 0)
        assert most <= WORKERS_MAX
        page = Page()
        await client.open(page, "run.mcap")
        assert running() == 1, "each has given back its place"
    measured(f"48 pages closed while their recordings open: at most {most} workers at a time, none left")


async def test_a_missing_program_is_reported_in_one_line(folder: Path) -> None:
    client = ReplayClient(folder, "tests.runtime.console.no_such", lambda: None)
    with pytest.raises(ReplayError, match="no_such"):
        await client.open(Page(), "hall.mcap")


async def test_recordings_are_listed_with_the_one_in_progress(folder: Path) -> None:
    async with replay_client(folder, str(folder / "hall.mcap")) as client:
        found = await client.recordings()
        assert {one["file"]: one["live"] for one in found} == {"hall.mcap": True, "broken.mcap": False}


def test_only_files_of_the_folder_are_recordings(folder: Path, tmp_path: Path) -> None:
    assert list_recordings(tmp_path / "none") == []
    (tmp_path / "folder.mcap").mkdir()
    assert list_recordings(tmp_path) == []
    assert [one.file for one in list_recordings(folder)] == ["broken.mcap", "hall.mcap"]
    assert find_recording(folder, "hall.mcap") == folder / "hall.mcap"
    assert find_recording(folder, "../hall.mcap") is None


async def test_a_child_process_is_ended_at_once() -> None:
    process = await start_child(ECHOLOCATE, ["report", "--help"], pipes=False, low_priority=True)
    await kill_child(process)
    assert process.returncode is not None


@pytest.mark.promise("P19")
async def test_a_page_that_closes_while_its_recording_opens_leaves_no_worker(
    folder: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    started: list[asyncio.subprocess.Process] = []

    async def start(*args: Any, **options: Any) -> asyncio.subprocess.Process:
        started.append(await start_child(*args, **options))
        return started[-1]

    monkeypatch.setattr("runtime.console.playback.replay_client.start_child", start)
    client = ReplayClient(folder, "tests.runtime.console.never_opens", lambda: None)
    opening = asyncio.create_task(client.open(Page(), "hall.mcap"))
    await until(lambda: bool(started))
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert started[0].returncode is not None
    assert client._workers == 0
    measured("a page closed while its recording opens: its worker has ended before the command has")

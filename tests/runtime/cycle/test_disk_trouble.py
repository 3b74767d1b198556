"""P12 in virtual time: no cycle waits for a disk, and what is lost is counted and reported.

A disk that confirms nothing is one that waits until the run has ended. A loop that waited for it would never end.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from structlog.typing import FilteringBoundLogger

from config.errors import FAILED, UserError
from config.settings import LogConfig
from drivers.denning.codec import Decoder
from drivers.denning.frames import Drive, Frame, Halt
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cli.commands.run.run_recording import RunRecording, open_run_recording
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import RunSummary
from runtime.support.logs import LogStatus, open_log
from runtime.timing.cycle_stats import CycleStats
from tests.recorded import until
from tests.runtime.virtual_time import in_virtual_time

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P12")]

PAPER = "perception.method=paper"
CYCLES = 100
TROUBLE_AT = 40
"""The cycle that waits for the trouble to begin; the robot drives by then."""
HANGS_S = 300.0
"""A drive takes less, even one that has to compile kernels first."""


@dataclass
class Drive100:
    """A drive of `CYCLES` cycles with a log and a recording, and what became of all three."""

    monkeypatch: pytest.MonkeyPatch
    log: LogConfig
    record: str | None
    sets: tuple[str, ...] = ()
    terminal: bool = False
    at: dict[int, Callable[[RobotProcess], None]] = field(default_factory=dict)
    """What happens in a cycle."""
    frames: list[Frame] = field(default_factory=list)
    log_status: LogStatus = field(default_factory=LogStatus)

    @contextlib.contextmanager
    def driven(self) -> Iterator[tuple[RunSummary, RunRecording]]:
        """Yield the summary and the recording while log and recording are still open."""
        with (
            in_virtual_time(self.monkeypatch, PAPER, *self.sets) as (loop, settings, robot, links),
            open_run_recording(settings, self.record, no_record=False, emulated=True, clock=loop.time) as recording,
            open_log(self.log, terminal=self.terminal, listener=recording.on_log, status=self.log_status) as log,
        ):
            self.recording = recording
            process = RobotProcess(settings, log, self._observers(recording, log), loop.time)
            self.process = process
            summary = loop.run_until_complete(process.run(arm=True, seconds=None))
            links[0].live()
            assert robot.truth.flags & Flags.LATCHED
            recording.on_summary(summary)
            yield summary, recording

    def _observers(self, recording: RunRecording, log: FilteringBoundLogger) -> Observers:
        ears = Decoder("host")

        def on_cycle(record: CycleRecord, _state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
            if record.cycle == TROUBLE_AT:
                assert record.mode.mode is Mode.DRIVE
            if record.cycle in self.at:
                self.at[record.cycle](self.process)
            if record.cycle == CYCLES:
                self.process.stop()

        observers = recording.observers(on_cycle, log)
        record_bytes = observers.on_bytes

        def on_bytes(way: Any, run_s: float, host_s: float, data: bytes) -> None:
            if way == "out":
                self.frames += ears.feed(data)
            if record_bytes is not None:
                record_bytes(way, run_s, host_s, data)

        return Observers(observers.on_cycle, observers.on_firing, on_bytes, observers.on_settings)


def assert_undisturbed(summary: RunSummary) -> None:
    """Assert that the run drove to its end and that no cycle was late."""
    assert (summary["cycles"], summary["late"], summary["missed"]) == (CYCLES, 0, 0)
    assert summary["stop_reasons"] == []


def log_in(folder: Path) -> LogConfig:
    return LogConfig(file=str(folder / "log.jsonl"))


def events(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "log.jsonl").read_text("utf-8").splitlines()]


class SlowDisk:
    """`os.fsync` of a disk that confirms nothing until it is released."""

    def __init__(self) -> None:
        self.asked, self.released, self.gave_up = threading.Event(), threading.Event(), False

    def fsync(self, _fd: int) -> None:
        self.asked.set()
        self.gave_up = not self.released.wait(HANGS_S) or self.gave_up


@pytest.mark.promise("P2")
def test_a_disk_that_confirms_nothing_until_the_run_has_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    """The last request is a HALT: it is on the line at once, with the disk still at a stand."""
    disk = SlowDisk()
    monkeypatch.setattr("runtime.recording.writer.SYNC_S", 0.0)
    monkeypatch.setattr(os, "fsync", disk.fsync)

    def halt(process: RobotProcess) -> None:
        assert not any(isinstance(frame, Halt) for frame in drive.frames)
        process.request(Request.HALT)
        assert isinstance(drive.frames[-1], Halt)

    drive = Drive100(monkeypatch, log_in(tmp_path), str(tmp_path / "run.mcap"))
    drive.at = {TROUBLE_AT: lambda _process: until(disk.asked.is_set, "a disk at a stand"), CYCLES - 10: halt}
    with drive.driven() as (summary, recording):
        assert not disk.released.is_set()
        disk.released.set()
    assert not disk.gave_up, "something waited for the disk"
    assert (summary["cycles"], summary["late"], summary["missed"]) == (CYCLES, 0, 0)
    assert summary["stop_reasons"] == ["halted by the operator; re-arm to continue"]
    first = next(i for i, frame in enumerate(drive.frames) if isinstance(frame, Halt))
    assert not any(isinstance(frame, Drive) for frame in drive.frames[first:])
    row = recording.summary_row
    assert row is not None
    assert (row["dropped"], row["last_error"]) == (0, None)
    assert row["sync_max_s"] > 0.0
    recording.raise_if_incomplete()
    measured(f"nothing confirmed for {CYCLES - TROUBLE_AT} cycles: none late, nothing lost, the HALT sent at once")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, the device that is always full")
def test_a_full_disk_under_the_log_and_the_recording(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], measured: Callable[[str], None]
) -> None:
    drive = Drive100(monkeypatch, LogConfig(file="/dev/full"), "/dev/full", terminal=True)
    drive.at = {TROUBLE_AT: lambda _process: until(lambda: has_error(drive), "trouble")}
    with drive.driven() as (summary, recording):
        pass
    assert_undisturbed(summary)
    row, log = recording.summary_row, drive.log_status
    assert row is not None
    assert row["dropped"] > 0
    assert log.lost >= 3
    assert log.last_error == "No space left on device"
    shown = capfd.readouterr().err
    assert "Log lines are missing in the file" in shown, "where lines still arrive"
    assert "The recording is incomplete" in shown
    with pytest.raises(UserError, match=r"--record: the recording is incomplete: .*No space left") as caught:
        recording.raise_if_incomplete()
    assert caught.value.exit_code == FAILED
    measured(f"full: no cycle late; {log.lost} lines and {row['dropped']} messages lost and reported")


def has_error(drive: Drive100) -> bool:
    row = drive.recording.summary_row
    return row is not None and row["last_error"] is not None


def test_a_folder_where_nothing_can_be_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    """A file in the folder's place refuses everybody, the superuser as well."""
    (tmp_path / "file").touch()
    where = f"recording.folder={json.dumps(str(tmp_path / 'file'))}"
    drive = Drive100(monkeypatch, log_in(tmp_path), None, (where,))
    drive.at = {TROUBLE_AT: lambda _process: until(lambda: has_error(drive), "trouble")}
    with drive.driven() as (summary, recording):
        pass
    assert_undisturbed(summary)
    row = recording.summary_row
    assert row is not None
    assert row["dropped"] > 0
    (warning,) = [event for event in events(tmp_path) if event["event"] == "the recording is incomplete"]
    assert str(tmp_path / "file") in warning["reason"]
    recording.raise_if_incomplete()
    measured(f"no folder to write in: no cycle late; {row['dropped']} messages lost and reported")


def test_a_log_that_is_not_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The log is a pipe that is full and has no reader until the run has ended."""
    fifo = tmp_path / "log"
    os.mkfifo(fifo)
    out = os.open(fifo, os.O_RDWR | os.O_NONBLOCK)
    filler = b"#" * 4096
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(out, filler)
    drive = Drive100(monkeypatch, LogConfig(file=str(fifo)), str(tmp_path / "run.mcap"))
    read = bytearray()
    with drive.driven() as (summary, _recording):
        assert drive.log_status.lost == 0
        reader = threading.Thread(target=read_all, args=(out, read))
        reader.start()
    until(lambda: b'"mode":"SAFE_STOP"' in read or b'"mode":"DRIVE"' in read, "the lines that waited")
    os.write(out, END)
    reader.join()
    os.close(out)
    assert_undisturbed(summary)
    assert drive.log_status.lost == 0, "what waited is written"


END = b"the end of the pipe"


def read_all(fd: int, into: bytearray) -> None:
    """Read until `END` has come."""
    os.set_blocking(fd, True)
    while not into.endswith(END):
        into += os.read(fd, 65536)

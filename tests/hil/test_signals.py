"""A run as a service, on a real pty: signals arm, reload, halt and end it, and its manager receives its state.

One run of the process answers for signals, notifications, the reload of its configuration, the wrap of the robot's
clock, and the recording of it all. Each of these is tested in detail in virtual time.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from runtime.recording.channels import LOG, SERIAL, SETTINGS, decode
from runtime.recording.reader import open_recording
from runtime.recording.schema import LogLine, SerialBytes
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.planted import planted
from tests.hil.running import PATIENT, Running, emulated, running, wait_for
from tests.hil.test_long_runs import WRAP_S
from tests.hil.test_stops_by_itself import Drive
from tests.hil.truth import DRIVING_M_S, Truth
from tests.recorded import entries_of

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

WRAPS_AFTER_S = 2.0
HALTS_MAX = 10
"""A busy machine may have stopped the robot by itself just before a HALT comes; it does not do so ten times."""


@dataclass
class Manager:
    """Service manager that started the process, on its own socket."""

    heard: list[str] = field(default_factory=list)

    def waits_for(self, done: Callable[[list[str]], bool], what: str) -> None:
        wait_for(lambda: done(self.heard), what, lambda: self.heard[-9:])


@contextlib.contextmanager
def manager(address: str) -> Iterator[Manager]:
    """Listen on the socket of a service manager."""
    hears, done = Manager(), threading.Event()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
        ears.bind(address)
        ears.settimeout(0.05)

        def listen() -> None:
            while not done.is_set():
                with contextlib.suppress(TimeoutError):
                    hears.heard.append(ears.recv(4096).decode())

        listener = threading.Thread(target=listen)
        listener.start()
        try:
            yield hears
        finally:
            done.set()
            listener.join()


def reloads(run: Running) -> list[dict[str, object]]:
    """Return the lines of the log about the configuration."""
    lines = (run.folder / f"{run.name}.jsonl").read_text("utf-8").split("\n")[:-1]
    return [event for event in map(json.loads, lines) if "configuration" in str(event["event"])]


def reloaded(run: Running, config: Path, text: str) -> dict[str, object]:
    """Write the file, ask for a reload, and return how it ended."""
    times = len(reloads(run)) + 1
    config.write_text(text, encoding="utf-8")
    run.signal(signal.SIGHUP)
    wait_for(lambda: len(reloads(run)) >= times, "the end of a reload")
    return reloads(run)[-1]


def halt(drive: Drive, hears: Manager) -> None:
    """Halt a robot under way by a signal; the reason is reported to its manager."""
    for _ in range(HALTS_MAX):
        drive.get_under_way()
        before = drive.stops()
        drive.run.signal(signal.SIGUSR2)
        wait_for(lambda: drive.stops() > before, "a SAFE_STOP")  # noqa: B023
        hears.waits_for(lambda heard: any("SAFE_STOP: " in line for line in heard), "a reason")
        if any("halted by the operator" in line for line in hears.heard):
            return
    raise AssertionError(hears.heard)


@pytest.mark.promise("P10")
@pytest.mark.promise("P11")
@pytest.mark.promise("P15")
def test_a_service_is_armed_reloaded_halted_and_ended(tmp_path: Path, measured: Callable[[str], None]) -> None:
    address, config, recorded = str(tmp_path / "notify"), tmp_path / "run.toml", tmp_path / "run.mcap"
    good = 'robot = "denning"\n[behaviors]\narbiter.base_velocity_m_s = 0.3\nmove_ahead.distance_m = 1e4\n'
    config.write_text(good, encoding="utf-8")
    command = ["run", str(config), "--record", str(recorded), "--json", str(tmp_path / "summary.json"), *PATIENT]
    env = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "400000"}
    with (
        manager(address) as hears,
        emulated(tmp_path, "--clock", str(WRAP_S - WRAPS_AFTER_S)) as robot,
        planted(tmp_path, "run", "", *command, "--port", robot.port, env=env) as run,
    ):
        hears.waits_for(lambda heard: "STATUS=READY" in heard and heard.count("WATCHDOG=1") > 2, "signs of life")
        drive = Drive(run, Truth(robot.trace))
        assert all(row.still for row in drive.truth.read()), "it comes up without moving"

        drive.get_under_way()
        hears.waits_for(lambda heard: "STATUS=DRIVE" in heard, "the mode")
        bad = reloaded(run, config, good.replace("0.3", '"fast"'))
        assert bad["event"] == "the new configuration is refused"
        assert str(bad["problem"]).startswith(f"{config}: behaviors.arbiter.base_velocity_m_s = ")
        slow = good.replace("0.3", "0.05") + '[ring]\nfiring = "quadrants"\n'
        fixed = reloaded(run, config, slow + "[link]\nbaud = 57600\n")
        assert str(fixed["problem"]).startswith("link.baud: ")
        assert str(fixed["problem"]).endswith("needs a restart")
        drive.get_under_way()  # faster than the settings that were refused would have it
        halt(drive, hears)

        assert reloaded(run, config, slow)["event"] == "the new configuration is in use"
        drive.truth.wait(lambda row: row.still, "a robot that stands")
        drive.get_under_way(at_least_m_s=0.02)
        taken_t_s = drive.truth.read()[-1].t_s
        drive.truth.wait(lambda row: row.t_s > max(taken_t_s, WRAPS_AFTER_S) + 0.5, "the wrap of the robot's clock")
        assert max(row.v for row in drive.truth.since(taken_t_s)) < DRIVING_M_S / 2.0, "driving slowly"

        run.signal(signal.SIGTERM)
        assert run.end() == 0
        assert run.error_lines == []
        hears.waits_for(lambda heard: "STOPPING=1" in heard, "the end")
    assert hears.heard.count("READY=1") == 1
    assert hears.heard.index("READY=1") < hears.heard.index("WATCHDOG=1")
    assert "WATCHDOG=1" not in hears.heard[hears.heard.index("STOPPING=1") :]

    log = (tmp_path / "run.jsonl").read_text("utf-8")
    assert '"level":"error"' not in log
    assert "never retrieved" not in run.err + log
    check_recording(recorded)
    lost = json.loads((tmp_path / "summary.json").read_bytes())["link"]["lost"]
    measured(f"the robot's clock wrapped on the pty during a drive: {lost} frames lost, the drive went on")


def check_recording(recorded: Path) -> None:
    """Check that a recording of the run on the pty holds everything, and replay it."""
    assert run_command(["replay", str(recorded), "--verify"]) == DONE
    with open_recording(recorded) as recording:
        assert recording.world is None, "the world of a real port is unknown"
    entries = entries_of(recorded)
    assert sum(entry.topic == SETTINGS for entry in entries) == 1
    lines = [decode(LogLine, entry.data).event for entry in entries if entry.topic == LOG]
    lines = [line for line in lines if "console.port" not in line]  # another run may have the port
    assert lines[:2] == ["start", "console"]
    assert "robot ready" in lines
    for way in ("in", "out"):
        pieces = [p for e in entries if e.topic == SERIAL[way] for p in decode(SerialBytes, e.data).pieces()]
        assert sum(len(data) for _, data in pieces) > 0
        assert [t for t, _ in pieces] == sorted(t for t, _ in pieces)


@stalls_excused
def test_a_run_that_is_ended_before_its_robot_is_ready_says_so_and_by_which_signal(tmp_path: Path) -> None:
    robot, line = os.openpty()
    tty.setraw(line)
    summary = tmp_path / "summary.json"
    with running(
        tmp_path, "run", "run", "--port", os.ttyname(line), "--json", str(summary), "--no-record", "--no-console"
    ) as run:
        is_called, *_ = select.select([robot], [], [], TIMEOUT_S)
        assert is_called, "it calls the robot, which does not answer"
        run.signal(signal.SIGINT)
        assert run.end() == 128 + signal.SIGINT
    os.close(line)
    os.close(robot)
    (reason,) = json.loads(summary.read_bytes())["stop_reasons"]
    assert reason == "ended by SIGINT before the robot was ready"
    assert run.error_lines == [f"echolocate: {reason}"]

"""The command as a process of its own, and what the emulator's truth trace says it did; shared by the tests here."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from drivers.emulator.trace import HEADER
from drivers.messages import Flags
from tests.hil.machine import PATIENCE_S

ROOT = Path(__file__).parents[2]
DRIVING_M_S = 0.2
DEADMAN_S = 0.5


def wait_for(done: Callable[[], bool], what: str) -> None:
    """Wait until `done`, and fail where it never is."""
    end_s = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < end_s, f"it never came: {what}"
        time.sleep(0.01)


@dataclass(frozen=True)
class Row:
    """A row of the truth trace."""

    t_s: float
    """The robot's own time, which does not go on where the emulator stands still."""
    host_s: float
    v: float
    w: float
    flags: Flags

    @property
    def still(self) -> bool:
        return self.v == 0.0 and self.w == 0.0


def rows(trace: Path) -> list[Row]:
    """Return the complete rows so far."""
    if not trace.exists():
        return []
    names = HEADER.split(",")
    t, host, v, w, flags = (names.index(name) for name in ("t_s", "host_s", "v_m_s", "w_rad_s", "flags"))
    cells = (line.split(",") for line in trace.read_text().split("\n")[1:-1])
    return [Row(float(c[t]), float(c[host]), float(c[v]), float(c[w]), Flags(int(c[flags]))) for c in cells]


def robot_time(trace: Path, host_s: float) -> float:
    """Return the robot's time at a moment of the host's clock that the trace has come to, s."""
    return max(row.t_s for row in rows(trace) if row.host_s <= host_s)


def is_driving(trace: Path) -> bool:
    """Say whether the wheels turn now."""
    now = rows(trace)
    return bool(now) and now[-1].v > DRIVING_M_S


def reaches(trace: Path, host_s: float) -> bool:
    """Say whether the trace has come to a moment of the host's clock."""
    now = rows(trace)
    return bool(now) and now[-1].host_s >= host_s


class Signalled(NamedTuple):
    """A signal was sent between these two moments of the host's clock."""

    before_s: float
    after_s: float


@dataclass
class Running:
    """A command under way."""

    process: subprocess.Popen[bytes]
    folder: Path
    name: str

    @property
    def out(self) -> str:
        return (self.folder / f"{self.name}.out").read_text("utf-8")

    @property
    def err(self) -> str:
        return (self.folder / f"{self.name}.err").read_text("utf-8")

    @property
    def complaints(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("echolocate: ")]

    def signal(self, number: signal.Signals) -> Signalled:
        """Send a signal; a busy machine may let some time pass in between."""
        before_s = time.monotonic()
        self.process.send_signal(number)
        return Signalled(before_s, time.monotonic())

    def end(self) -> int:
        """Wait for its own end and return the exit code."""
        code = self.process.wait(PATIENCE_S)
        assert "Traceback" not in self.err, self.err
        return code

    def modes(self) -> list[str]:
        """Return the modes it has noted in its log so far."""
        log = self.folder / f"{self.name}.jsonl"
        if not log.exists():
            return []
        events = [json.loads(line) for line in log.read_text("utf-8").split("\n")[:-1]]
        return [str(event["mode"]) for event in events if event["event"] == "mode"]

    def comes_to(self, mode: str) -> None:
        """Wait until it says that it is in a mode."""
        wait_for(lambda: self.modes()[-1:] == [mode], f"{mode}, after {self.modes()}")


@contextlib.contextmanager
def running(folder: Path, name: str, *arguments: str) -> Iterator[Running]:
    """Run `echolocate` with `arguments`; whatever is left of it at the end is killed."""
    command = [sys.executable, "-m", "runtime.cli", *arguments]
    if arguments[0] == "run":
        command += ["--headless", "--set", f"log.file={json.dumps(str(folder / f'{name}.jsonl'))}"]
    with (folder / f"{name}.out").open("wb") as out, (folder / f"{name}.err").open("wb") as err:
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=env)
        try:
            yield Running(process, folder, name)
        finally:
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


@dataclass(frozen=True)
class Emulated:
    """An emulated robot that stands ready."""

    port: str
    trace: Path


@contextlib.contextmanager
def emulated(folder: Path, *arguments: str) -> Iterator[Emulated]:
    """Run the emulator by itself."""
    robot = Emulated(str(folder / "robot"), folder / "trace.csv")
    command = ["emulate", "--link", robot.port, "--trace", str(robot.trace), *arguments]
    with running(folder, "emulate", *command) as emulator:
        wait_for(lambda: emulator.out.startswith("ready") or emulator.process.poll() is not None, "ready")
        assert emulator.process.poll() is None, emulator.err
        yield robot
        emulator.signal(signal.SIGTERM)
        assert emulator.end() == 0

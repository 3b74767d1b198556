"""The command as a process of its own; shared by the tests here."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from drivers.messages import Flags
from tests.hil.forked_command import ForkedCommand
from tests.hil.machine import LOOK_S, TIMEOUT_S
from tests.hil.truth import Truth

ROOT = Path(__file__).parents[2]
DEADMAN_S = 0.5
ARM_AGAIN_S = 1.5
"""Time after which a robot that does not drive is armed again, s: longer than an arming takes at most."""

PATIENT = (
    "--set", "link.tries=100", "--set", "link.silence_max_s=60.0", "--set", "cycle.overruns_max=10000",
)  # fmt: skip
"""Settings of a run that gives up neither a robot nor its own cycles because the machine is busy."""


def wait_for(done: Callable[[], bool], what: str, seen: Callable[[], object] = str) -> None:
    """Wait until `done`; on timeout fail with what is `seen`."""
    end_s = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end_s, f"it never came: {what}; {seen()}"
        time.sleep(LOOK_S)


class Signalled(NamedTuple):
    """A signal was sent between these two moments of the host's clock."""

    before_s: float
    after_s: float


@dataclass
class Running:
    """A command under way."""

    process: subprocess.Popen[bytes] | ForkedCommand
    folder: Path
    name: str
    _log: list[dict[str, object]] = field(default_factory=list)
    _offset: int = 0

    @property
    def out(self) -> str:
        return (self.folder / f"{self.name}.out").read_text("utf-8")

    @property
    def err(self) -> str:
        return (self.folder / f"{self.name}.err").read_text("utf-8")

    @property
    def error_lines(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("echolocate: ")]

    def signal(self, number: signal.Signals) -> Signalled:
        """Send a signal; a busy machine may let some time pass in between."""
        before_s = time.monotonic()
        self.process.send_signal(number)
        return Signalled(before_s, time.monotonic())

    def end(self) -> int:
        """Wait for its own end and return the exit code."""
        code = self.process.wait(TIMEOUT_S)
        assert "Traceback" not in self.err, self.err
        return code

    def events(self) -> list[dict[str, object]]:
        """Return the lines of its log so far; each is read once, however often one looks."""
        log = self.folder / f"{self.name}.jsonl"
        if log.exists():
            with log.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
            whole = data[: data.rfind(b"\n") + 1]
            self._offset += len(whole)
            self._log += [json.loads(line) for line in whole.splitlines()]
        return self._log

    def modes(self) -> list[str]:
        """Return the modes it has noted in its log so far."""
        return [str(event["mode"]) for event in self.events() if event["event"] == "mode"]

    def comes_to(self, mode: str) -> None:
        """Wait until it says that it is in a mode."""
        wait_for(lambda: self.modes()[-1:] == [mode], mode, lambda: (self.modes(), self.err))

    def drive(self, truth: Truth) -> None:
        """Arm the robot, as often as needed, until its wheels turn; a busy machine may stop a drive at any time."""
        armed_s = -math.inf

        def drives() -> bool:
            nonlocal armed_s
            modes, host_s = self.modes()[-1:], time.monotonic()
            if modes in (["READY"], ["SAFE_STOP"]) and host_s > armed_s + ARM_AGAIN_S:
                armed_s = host_s
                self.signal(signal.SIGUSR1)
            if modes != ["DRIVE"]:
                return False
            row = truth.read()[-1]
            return row.driving and not row.flags & Flags.LATCHED

        wait_for(drives, "driving", lambda: (self.modes(), self.err))


@contextlib.contextmanager
def running(folder: Path, name: str, *arguments: str, fresh: bool = False) -> Iterator[Running]:
    """Run `echolocate` with `arguments`; whatever is left of it at the end is killed.

    Parameters
    ----------
    folder, name
        Of the files with what it writes.
    arguments
        Of the command.
    fresh
        In a new interpreter, where its start counts.
    """
    command = [*arguments]
    if arguments[0] == "run":
        command += ["--headless", "--set", f"log.file={json.dumps(str(folder / f'{name}.jsonl'))}"]
    env = {"PYTHONPATH": str(ROOT)}
    with contextlib.ExitStack() as files:
        nothing = files.enter_context(Path(os.devnull).open("rb"))
        out, err = (files.enter_context((folder / f"{name}.{kind}").open("wb")) for kind in ("out", "err"))
        if fresh:
            program = [sys.executable, "-m", "runtime.cli", *command]
            yield from ended(
                Running(
                    subprocess.Popen(program, stdin=nothing, stdout=out, stderr=err, env=os.environ | env),
                    folder,
                    name,
                )
            )
        else:
            streams = (nothing.fileno(), out.fileno(), err.fileno())
            yield from ended(Running(ForkedCommand(command, streams, env), folder, name))


def ended(run: Running) -> Iterator[Running]:
    """Yield a command under way, and kill what is left of it at the end."""
    try:
        yield run
    finally:
        run.process.send_signal(signal.SIGCONT)
        run.process.kill()
        run.process.wait()


@dataclass(frozen=True)
class Emulated:
    """An emulated robot that stands ready."""

    port: str
    trace: Path


@contextlib.contextmanager
def emulated(folder: Path, *arguments: str, fresh: bool = False) -> Iterator[Emulated]:
    """Run the emulator by itself; see `running`."""
    robot = Emulated(str(folder / "robot"), folder / "trace.csv")
    command = ["emulate", "--link", robot.port, "--trace", str(robot.trace), "--force", *arguments]
    with running(folder, "emulate", *command, fresh=fresh) as emulator:
        wait_for(lambda: emulator.out.startswith("ready") or emulator.process.poll() is not None, "ready")
        assert emulator.process.poll() is None, emulator.err
        yield robot
        emulator.signal(signal.SIGTERM)
        assert emulator.end() == 0


def start_url(run: Running) -> str:
    """Wait for the line of the log with the console's address, and return the address."""
    found: list[str] = []

    def is_written() -> bool:
        assert run.process.poll() is None, run.err
        found[:] = [str(event["start_url"]) for event in run.events() if event["event"] == "console"]
        return bool(found)

    wait_for(is_written, "the start URL")
    assert found[0] not in run.err, "who reads the journal must not get the token"
    return found[0]

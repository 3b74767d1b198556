"""As a service: the unit that is printed is one, and a manager hears of the process what is true of it just then."""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from config.errors import WRONG_CALL
from runtime.cli.commands.service import quote_for_systemd
from runtime.support.sd_notify import STATUS_MAX, SdNotifier
from tests.hil.planted import SHORT_S, planted
from tests.hil.running import ROOT, emulated, wait_for
from tests.hil.truth import Truth

WATCHDOG_S = 0.4


@dataclass
class Manager:
    """Service manager that started the process, on its own socket."""

    address: str
    heard: list[tuple[float, str]] = field(default_factory=list)

    def words(self) -> list[str]:
        return [line for _, line in self.heard]

    def times(self, line: str) -> list[float]:
        return [at_s for at_s, heard in self.heard if heard == line]


@contextlib.contextmanager
def manager(address: str) -> Iterator[Manager]:
    heard = Manager(address)
    done = threading.Event()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
        ears.bind("\0" + address[1:] if address.startswith("@") else address)
        ears.settimeout(0.05)

        def listen() -> None:
            while not done.is_set():
                with contextlib.suppress(TimeoutError):
                    heard.heard.append((time.monotonic(), ears.recv(4096).decode()))

        listener = threading.Thread(target=listen)
        listener.start()
        try:
            yield heard
        finally:
            done.set()
            listener.join()


@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
@pytest.mark.promise("P10")
@pytest.mark.parametrize("kind", ["path", "abstract"])
def test_what_a_manager_hears(tmp_path: Path, kind: str) -> None:
    address = str(tmp_path / "notify") if kind == "path" else f"@echolocate-test-{os.getpid()}"
    env = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": str(round(1e6 * WATCHDOG_S))}
    with (
        manager(address) as heard,
        emulated(tmp_path) as robot,
        planted(tmp_path, "run", "busy", "run", "--port", robot.port, env=env) as run,
    ):
        wait_for(lambda: "READY=1" in heard.words(), "READY=1")
        wait_for(lambda: "STATUS=READY" in heard.words(), "the mode")
        wait_for(lambda: len(heard.times("WATCHDOG=1")) > 5, "signs of life")
        assert all(row.still for row in Truth(robot.trace).read()), "it comes up without moving"
        run.signal(signal.SIGUSR1)
        wait_for(lambda: "STATUS=DRIVE" in heard.words(), "the mode")
        wait_for(lambda: Truth(robot.trace).read()[-1].driving, "driving")
        before = len(heard.times("WATCHDOG=1")) - 1
        run.signal(signal.SIGWINCH)
        wait_for(lambda: any(line.startswith("STATUS=SAFE_STOP: ") for line in heard.words()), "the reason")
        wait_for(lambda: len(heard.times("WATCHDOG=1")) > before + 8, "signs of life")
        fed_s = heard.times("WATCHDOG=1")[before:]
        # Fed by the cycle: a thread would have fed it on. Half of the time is for the listener here.
        assert max(b - a for a, b in itertools.pairwise(fed_s)) > 0.5 * SHORT_S
        run.signal(signal.SIGUSR1)
        wait_for(lambda: heard.words().count("STATUS=DRIVE") == 2, "the mode")
        run.signal(signal.SIGUSR2)
        wait_for(lambda: "halted by the operator" in str(heard.words()), "the halt")
        run.signal(signal.SIGTERM)
        assert run.end() == 0
        assert heard.words().count("READY=1") == 1
        assert "STOPPING=1" in heard.words()
        assert heard.words().index("READY=1") < heard.words().index("WATCHDOG=1")
        assert heard.times("WATCHDOG=1")[-1] < heard.times("STOPPING=1")[0] + 0.05


def test_no_manager() -> None:
    for notifier in (
        SdNotifier(),
        SdNotifier.from_environment({}),
        SdNotifier.from_environment({"NOTIFY_SOCKET": "host:9"}),
    ):
        with notifier:
            notifier.alive(1.0)
            notifier.status("DRIVE")
            notifier.stopping()
        assert notifier.lost == 0


def test_missing_or_blocked_manager_does_not_block_the_run(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    environment = {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "400000", "WATCHDOG_PID": str(os.getpid())}
    with SdNotifier.from_environment(environment) as notifier:
        notifier.alive(0.0)
        assert notifier.lost == 2, "READY and WATCHDOG"
        assert notifier.last_error is not None
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
            ears.bind(path)
            for k in range(10_000):
                notifier.alive(1.0 + k)
                if notifier.lost > 2:
                    break
            assert notifier.lost == 3, "the socket is full, and the run did not wait"
            assert ears.recv(100) == b"WATCHDOG=1"
            notifier.alive(1e6)
            assert notifier.lost == 3, "and there is room again"


def test_the_watchdog_is_fed_in_time_and_no_more(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
        ears.bind(path)
        ears.settimeout(0.0)
        received: list[str] = []

        def hear() -> None:
            with contextlib.suppress(BlockingIOError):
                while True:
                    received.append(ears.recv(4096).decode())

        with SdNotifier(path, 2.0) as notifier:
            for cycle in range(200):
                notifier.alive(0.05 * cycle)
                hear()
            for _ in range(2):
                notifier.status("SAFE_STOP: " + "x\ny " * STATUS_MAX)
            hear()
    assert received.count("READY=1") == 1
    assert 19 <= received.count("WATCHDOG=1") <= 21
    (status,) = [line for line in received if line.startswith("STATUS=")]
    assert "\n" not in status
    assert len(status) <= STATUS_MAX + len("STATUS=")


def test_watchdog_of_another_process_is_ignored() -> None:
    other = {"NOTIFY_SOCKET": "@absent", "WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getpid() + 1)}
    with SdNotifier.from_environment(other) as notifier:
        notifier.alive(0.0)
        assert notifier.lost == 1, "READY alone"


def service(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "runtime.cli", "service", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)


def test_the_unit_that_is_printed(tmp_path: Path) -> None:
    done = service("hallway", "--port", "/dev/ttyUSB0", "--set", "behaviors.arbiter.base_velocity_m_s=0.2")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    (start,) = [line for line in lines if line.startswith("ExecStart=")]
    assert "run hallway --port /dev/ttyUSB0 --headless --set behaviors.arbiter.base_velocity_m_s=0.2" in start
    assert "--arm" not in done.stdout
    for line in ("Type=notify", "WatchdogSec=2", "Restart=on-failure", "DynamicUser=yes", "KillSignal=SIGTERM"):
        assert line in lines
    if shutil.which("systemd-analyze") is not None:
        unit = tmp_path / "echolocate.service"
        unit.write_text(done.stdout, "utf-8")
        checked = subprocess.run(
            ["systemd-analyze", "verify", "--man=no", str(unit)],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert str(unit.name) not in checked.stderr, checked.stderr


def test_a_service_without_a_port_is_a_wrong_call() -> None:
    done = service("hallway")
    assert done.returncode == WRONG_CALL
    assert "--port" in done.stderr
    assert service("hallway", "--port", "a\nExecStart=b").returncode == WRONG_CALL


@pytest.mark.parametrize(
    ("word", "unit"),
    [("/dev/ttyUSB0", "/dev/ttyUSB0"), ("a b", '"a b"'), ("100%", "100%%"), ("$HOME", "$$HOME"), ('"', '"\\""'),
     ("a\\b", '"a\\\\b"'), ("", '""')],
)  # fmt: skip
def test_words_of_a_command_line(word: str, unit: str) -> None:
    assert quote_for_systemd(word) == unit

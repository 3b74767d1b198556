"""The tutorial's commands run as they are written; the drive itself only in the long form."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
import tomllib
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command

TUTORIAL = (Path(__file__).parents[3] / "docs" / "tutorial.md").read_text("utf-8")
COMMANDS = [line for block in re.findall(r"```console\n(.*?)```", TUTORIAL, re.DOTALL) for line in block.splitlines()]
CHEAP = ("init", "check", "service")
PROGRAM = f"{shlex.quote(sys.executable)} -m runtime.cli "
ROUTE = [tuple(map(float, place)) for place in re.findall(r"x_m = (-?[\d.]+), y_m = (-?[\d.]+)", TUTORIAL)]
LONG_S = 600.0
DRIVEN_BYTES = 400_000
"""Of a recording of half a minute; while kernels are compiled, a minute gives a tenth of it."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory, with the files that the tutorial shows."""
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r'```toml title="([\w.-]+)"\n(.*?)```', TUTORIAL, re.DOTALL):
        (tmp_path / name).write_text(text)
    return tmp_path


def test_the_files_of_the_first_hour_are_written_and_good(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = []
    for line in COMMANDS:
        program, *words = shlex.split(line.partition(" > ")[0])
        if program == "echolocate" and words[0] in CHEAP:
            assert run_command(words) == DONE, (line, capsys.readouterr().err)
            done.append(words[0])
    assert done == ["init", "init", "init", "init", "check", "service"]
    printed = capsys.readouterr().out
    assert "my-run.toml: good" in printed
    assert "ExecReload=/bin/kill -HUP $MAINPID" in printed
    assert "WantedBy=default.target" in printed
    assert "DynamicUser" not in printed
    assert tomllib.loads((here / "my-robot.toml").read_text())["robot"] == {"name": "Ella", "driver": "denning"}
    assert len(tomllib.loads((here / "my-route.toml").read_text())["step"]) == 4


@pytest.mark.soak
@pytest.mark.promise("P31")
def test_the_whole_first_hour(here: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]) -> None:
    """Every command, one after the other, the drive in real time, with what the page downloads of it meanwhile."""
    monkeypatch.setenv("XDG_STATE_HOME", str(here / "state"))
    for line in COMMANDS:
        command = line.replace("echolocate ", PROGRAM, 1) if line.startswith("echolocate ") else line
        with subprocess.Popen(["bash", "-c", command], cwd=here, stderr=subprocess.PIPE, text=True) as process:
            if line.startswith("echolocate run"):
                download(here, process)
            _, said = process.communicate(timeout=LONG_S)
        assert process.returncode == DONE, (line, said)
    assert run_command(["report", str(here / "so-far.mcap"), "--out", str(here / "so-far.html")]) == DONE
    for name in ("first.html", "so-far.html"):
        assert "objects found" in (here / name).read_text("utf-8")
    found = json.loads((here / "found.json").read_text("utf-8"))
    assert {detected["model"] for detected in found["objects"]} == {"my-drum"}
    with (here / "tables" / "odometry.csv").open(encoding="utf-8") as table:
        places = [(float(row["x_m"]), float(row["y_m"])) for row in csv.DictReader(table)]
    misses = [min(math.dist(place, goal) for place in places) for goal in ROUTE]
    assert max(misses) < 0.15
    assert math.dist(places[-1], ROUTE[-1]) < 0.15
    drums = len(found["objects"])
    assert drums >= 3, "the route leads round all four"
    measured(
        f"{len(COMMANDS)} commands; waypoints passed within {max(misses):.2f} m; {drums} drums of 4 in its own CSV"
    )
    check_service(here)


def download(here: Path, run: subprocess.Popen[str]) -> None:
    """Fetch the recording so far, as the page's link does, once the robot has driven a little."""
    address = here / "state" / "echolocate" / "console-address"
    recording, waiting = here / "first.mcap", threading.Event()
    while not (address.exists() and recording.exists() and recording.stat().st_size > DRIVEN_BYTES):
        assert run.poll() is None, "it ended before it drove"
        waiting.wait(0.2)
    url = urllib.parse.urlsplit(address.read_text("utf-8").strip())
    token = urllib.parse.parse_qs(url.query)["token"][0]
    link = f"http://{url.netloc}/recording?token={token}&file={recording.name}"
    with urllib.request.urlopen(link, timeout=LONG_S) as answer:
        (here / "so-far.mcap").write_bytes(answer.read())


def check_service(here: Path) -> None:
    """Start what the unit starts as a user's manager does: with a socket for its reports, reload and stop by signals.

    Where there is a `systemd-analyze`, it checks the unit itself. A manager that is running is left alone.
    """
    unit = here / "echolocate.service"
    lines = dict(
        line.split("=", 1) for line in unit.read_text("utf-8").splitlines() if "=" in line and line[0] != "#"
    )
    assert (lines["Type"], lines["ExecReload"], lines["KillSignal"]) == (
        "notify",
        "/bin/kill -HUP $MAINPID",
        "SIGTERM",
    )
    if shutil.which("systemd-analyze") is not None:
        checked = subprocess.run(
            ["systemd-analyze", "--user", "verify", "--man=no", str(unit)], capture_output=True, text=True,
            check=False, env={**os.environ, "XDG_RUNTIME_DIR": str(here)}, timeout=LONG_S,
        )  # fmt: skip
        assert checked.returncode == DONE, checked.stderr
    robot = [
        *shlex.split(PROGRAM),
        "emulate",
        "--robot",
        "my-robot.toml",
        "--world",
        "my-room.toml",
        "--link",
        "robot",
    ]
    with contextlib.ExitStack() as stack:
        emulated = stack.enter_context(subprocess.Popen(robot, cwd=here, stdout=subprocess.PIPE, text=True))
        stack.callback(emulated.kill)
        assert emulated.stdout is not None
        assert emulated.stdout.readline().startswith("ready")
        notified = stack.enter_context(notifications())
        words = [word.replace("/dev/ttyUSB0", str(here / "robot")) for word in shlex.split(lines["ExecStart"])]
        address = notified.getsockname().decode().replace("\0", "@")
        environment = {**os.environ, "NOTIFY_SOCKET": address, "WATCHDOG_USEC": f"{lines['WatchdogSec']}000000"}
        service = stack.enter_context(subprocess.Popen(words, env=environment, cwd=lines.get("WorkingDirectory")))
        stack.callback(service.kill)
        wait_for(notified, "READY=1")
        service.send_signal(signal.SIGHUP)
        wait_for(notified, "WATCHDOG=1")
        assert service.poll() is None, "it reads its files again and goes on"
        service.terminate()
        wait_for(notified, "STOPPING=1")
        assert service.wait(LONG_S) == DONE


@contextlib.contextmanager
def notifications() -> Iterator[socket.socket]:
    """The socket on which a manager hears of its services; its name has no place in the file system."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(b"\0echolocate-tutorial-%d" % os.getpid())
        listening.settimeout(LONG_S)
        yield listening


def wait_for(notified: socket.socket, state: str) -> None:
    """Read notifications until a state is among them."""
    while state not in notified.recv(4096).decode().splitlines():
        pass

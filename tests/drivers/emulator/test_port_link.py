"""Tests of the link to an emulator's pty: one emulator at a time, whatever a killed one has left."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.emulator.port_link import EmulatorError, PortLink
from tests.hil.machine import TIMEOUT_S

KILLED = """
import os, sys
from drivers.emulator.port_link import PortLink
PortLink(sys.argv[1]).point_at("/dev/pts/123456")
os.kill(os.getpid(), 9)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robot"


def test_what_a_killed_emulator_has_left_is_taken_over(path: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False, timeout=TIMEOUT_S)
    assert {file.name for file in path.parent.iterdir()} == {"robot", ".robot.lock"}
    link = PortLink(str(path))
    link.point_at("/dev/pts/1")
    assert path.readlink() == Path("/dev/pts/1")
    link.remove("/dev/pts/1")
    link.close()
    assert list(path.parent.iterdir()) == []


def test_links_of_different_names_share_a_folder(path: Path) -> None:
    links = [PortLink(str(path)), PortLink(str(path.with_name("other")))]
    for link in links:
        link.close()


@pytest.mark.parametrize("name", ["nowhere/robot", "x" * 254, "a\0b"])
def test_a_path_at_which_nothing_can_be_created(path: Path, name: str) -> None:
    with pytest.raises(EmulatorError, match="cannot make the link"):
        PortLink(str(path.parent / name))


def test_a_lock_that_its_owner_removes_meanwhile_is_taken_anew(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, opened = PortLink(str(path)), list[int]()

    def flock(fd: int, _operation: int) -> None:
        if not opened:
            first.close()
        opened.append(fd)

    monkeypatch.setattr("drivers.emulator.port_link.fcntl.flock", flock)
    second = PortLink(str(path))
    assert len(opened) == 2
    assert path.with_name(".robot.lock").exists()
    second.close()


def test_a_lock_file_is_not_a_link_to_another(path: Path) -> None:
    path.with_name(".robot.lock").symlink_to(path.with_name("precious"))
    with pytest.raises(EmulatorError, match="cannot make the link"):
        PortLink(str(path))
    assert not os.path.lexists(path.with_name("precious"))

"""The emulator's end of a pty: what differs from a serial line, and the link that one emulator at a time has."""

from __future__ import annotations

import os
import select
from pathlib import Path

import pytest

from drivers.emulator.port_link import EmulatorError
from drivers.emulator.pty_transport import PtyPort
from tests.hil.machine import TIMEOUT_S


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "robot"


def test_what_a_host_left_unread_is_not_kept_for_the_next() -> None:
    port = PtyPort(None)
    first = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.read() == b""
    port.write(b"unread")
    # The kernel moves the bytes to the other end in its own time.
    assert select.select([first], [], [], TIMEOUT_S)[0]
    os.close(first)
    assert port.read() is None
    second = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.read() == b""
    with pytest.raises(BlockingIOError):
        os.read(second, 100)
    os.close(second)
    port.close()


def test_host_that_does_not_read_blocks_nothing() -> None:
    port = PtyPort(None)
    host = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    sent = 0
    while port.dropped == 0:
        port.write(bytes(1000))
        sent += 1000
        assert sent < 10_000_000
    os.write(host, b"still heard")
    heard = b""
    while len(heard) < len(b"still heard"):
        heard += port.read() or b""
    assert heard == b"still heard"
    os.close(host)
    port.close()


@pytest.mark.promise("P13")
def test_a_second_emulator_is_refused_and_disturbs_no_host_of_the_first(link: Path) -> None:
    first = PtyPort(str(link))
    host = os.open(first.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    target = link.readlink()
    with pytest.raises(EmulatorError, match=f"another emulator has the link {link}: end it or choose"):
        PtyPort(str(link))
    assert link.readlink() == target
    first.unplug()
    with pytest.raises(EmulatorError, match="another emulator"):
        PtyPort(str(link))
    first.open()
    assert link.exists()
    os.close(host)
    first.close()
    second = PtyPort(str(link))
    assert link.exists()
    second.close()
    assert list(link.parent.iterdir()) == []


def test_stale_link_is_replaced_and_another_is_not(link: Path, tmp_path: Path) -> None:
    link.symlink_to("/dev/pts/123456")
    port = PtyPort(str(link))
    assert link.exists()
    port.close()
    assert not link.is_symlink()
    target = tmp_path / "precious"
    target.touch()
    link.symlink_to(target)
    with pytest.raises(EmulatorError, match="precious"):
        PtyPort(str(link))
    assert link.readlink() == target
    with pytest.raises(EmulatorError, match="cannot make the link"):
        PtyPort(str(tmp_path / "nowhere" / "robot"))


def test_a_link_that_points_elsewhere_by_now_is_left_alone(link: Path) -> None:
    port = PtyPort(str(link))
    link.unlink()
    link.symlink_to("/dev/null")
    port.close()
    assert link.readlink() == Path("/dev/null")

"""Opening a serial port: exclusive, and a failure in one line that names cause and next action."""

from __future__ import annotations

import errno
import termios
from contextlib import closing
from pathlib import Path

import pytest
import serial

from config.errors import FAILED, WRONG_CALL
from config.robot import LinkConfig
from drivers.serial_port import OPENING_ERRORS, explain, is_missing, open_port, opening_error
from tests.drivers.pty_pair import PtyPair


def config_of(path: Path) -> LinkConfig:
    return LinkConfig(port=str(path))


def test_a_port_of_which_nothing_can_be_known_is_not_missing(tmp_path: Path) -> None:
    assert is_missing(config_of(tmp_path / "none"))
    assert not is_missing(config_of(tmp_path / ("n" * 300)))


def test_an_opened_port_never_blocks_and_is_locked(pty: PtyPair) -> None:
    config = config_of(pty.path)
    with closing(open_port(config)) as port:
        assert (port.timeout, port.write_timeout) == (0, 0)
        assert isinstance(port, serial.Serial)
        assert port.read(1) == b""
        with pytest.raises(OPENING_ERRORS) as caught:
            open_port(config)
        error = opening_error(config, caught.value)
    assert error.exit_code == FAILED
    assert f"in use by another program; find it with `fuser {pty.path}`" in str(error)
    open_port(config).close()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("missing", "no such port"),
        ("missing/deeper", "no such port"),
        ("file", "is not a serial port"),
        ("folder", "is not a serial port"),
        ("file/below", "no such port"),
    ],
)
def test_a_path_that_is_no_port(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / "file").write_text("not a port")
    (tmp_path / "folder").mkdir()
    config = config_of(tmp_path / name)
    with pytest.raises(OPENING_ERRORS) as caught:
        open_port(config)
    error = opening_error(config, caught.value)
    assert error.exit_code == WRONG_CALL
    assert text in str(error)
    assert config.port is not None
    assert config.port in str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (serial.SerialException(13, "could not open port"), "no permission to open /dev/robot; likely this user"),
        (OSError(errno.EBUSY, "busy"), "port /dev/robot is in use by another program"),
        (termios.error(5, "Input/output error"), "/dev/robot is not a serial port"),
        (TimeoutError("10 s"), "opening /dev/robot takes too long (10 s); likely its adapter hangs"),
        (
            ValueError("Invalid baud rate: 7"),
            "cannot be set to 115200 baud (Invalid baud rate: 7); correct link.baud",
        ),
        (OverflowError("too large"), "cannot be set to 115200 baud (too large)"),
        (serial.SerialException("something\n  new"), "cannot open /dev/robot (something new); check the cable"),
    ],
)
def test_each_cause_has_its_line(error: Exception, text: str) -> None:
    line = explain(LinkConfig(port="/dev/robot"), error)
    assert text in line
    assert "\n" not in line


def test_an_address_of_another_kind_is_no_missing_device() -> None:
    line = explain(LinkConfig(port="rfc2217://host:4000"), FileNotFoundError(errno.ENOENT, "No such file"))
    assert line.startswith("rfc2217://host:4000: no such kind of port; give a serial device, or socket://host:port")

"""The error base class and the exit code of every error a user can cause."""

from __future__ import annotations

import errno

import pytest

from config.errors import FAILED, WRONG_CALL, UserError, naming_file
from config.files import ConfigError, TomlSyntaxError
from config.layers import PathError
from config.robot import LinkConfig
from drivers.driver import DriverError, DriverPackageError
from drivers.emulator.port_link import EmulatorError
from drivers.firing_pattern import FiringError
from drivers.serial_port import LinkError, opening_error
from runtime.recording.reader import RecordingError
from runtime.recording.ring_log import RingLogError


def test_an_error_exits_with_its_class_code_or_with_its_own() -> None:
    """The argument wins over the class attribute."""
    assert (str(UserError("a")), UserError("a").exit_code) == ("a", FAILED)
    assert UserError("a", WRONG_CALL).exit_code == WRONG_CALL
    assert RingLogError("a", FAILED).exit_code == FAILED
    assert UserError.exit_code == FAILED


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (FiringError("ring.firing: of 9"), "a.toml: ring.firing: of 9"),
        (ConfigError("a.toml: line 3"), "a.toml: line 3"),
        (DriverError("not as in a.toml"), "a.toml: not as in a.toml"),
        (DriverPackageError("no rclpy"), "no rclpy"),
    ],
)
def test_the_file_is_named_once_and_not_for_what_the_machine_lacks(error: UserError, said: str) -> None:
    with pytest.raises(type(error)) as caught, naming_file("a.toml"):
        raise error
    assert (type(caught.value), str(caught.value)) == (type(error), said)


@pytest.mark.parametrize(
    ("kind", "exit_code"),
    [
        (ConfigError, WRONG_CALL),
        (TomlSyntaxError, WRONG_CALL),
        (PathError, WRONG_CALL),
        (FiringError, WRONG_CALL),
        (RecordingError, WRONG_CALL),
        (RingLogError, WRONG_CALL),
        (LinkError, WRONG_CALL),
        (EmulatorError, FAILED),
    ],
)
def test_every_error_for_the_user_has_an_exit_code(kind: type[UserError], exit_code: int) -> None:
    """The command line needs one handler only."""
    error = kind("what happened")
    assert isinstance(error, UserError)
    assert (error.exit_code, str(error)) == (exit_code, "what happened")


def test_a_port_in_use_is_a_failure_and_not_a_wrong_call() -> None:
    """The call is right: it succeeds once the other program has ended."""
    config = LinkConfig(port="/dev/ttyUSB0")
    assert opening_error(config, OSError(errno.EBUSY, "busy")).exit_code == FAILED
    assert opening_error(config, OSError(errno.ENOENT, "none")).exit_code == WRONG_CALL

"""The errors and states of the protocol of drivers; what each driver must do is in tests/drivers/contract/."""

from __future__ import annotations

from config.errors import WRONG_CALL
from drivers.driver import DriverError, LineState, Received
from drivers.messages import Flags


def test_the_states_have_names_for_records_and_views() -> None:
    assert [state.value for state in LineState] == ["closed", "handshake", "ready", "down"]


def test_what_a_driver_has_not_received_is_empty() -> None:
    received = Received((), None, rebooted=False)
    assert (received.notes, received.flags) == ((), Flags.NONE)


def test_a_missing_driver_is_an_error_of_the_call() -> None:
    assert DriverError("no such driver").exit_code == WRONG_CALL

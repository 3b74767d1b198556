"""A command that must be answered: when it is sent again, and when it counts as unanswered."""

from __future__ import annotations

import pytest

from config.robot import LinkConfig
from drivers.denning.frames import Halt, Hello, Pattern, Release
from drivers.denning.pending_command import PendingCommand, pending_command
from drivers.denning.wire_units import WirePattern

LINK = LinkConfig()
PATTERN = WirePattern(50, 255, (1, 2, 4))


def is_due(command: PendingCommand) -> bool:
    return command.due


def command(name: str, *, without_limit: bool = False) -> PendingCommand:
    return pending_command(name, PATTERN, LINK, 2, without_limit=without_limit)


@pytest.mark.parametrize(
    ("name", "frame"),
    [("HALT", Halt(9)), ("RELEASE", Release(9)), ("HELLO", Hello(9, 2)), ("PATTERN", Pattern(9, 50, 255, (1, 2, 4)))],
)
def test_a_name_gives_its_frame(name: str, frame: Halt | Release | Hello | Pattern) -> None:
    assert command(name).frame(9, 0.0) == frame


def test_it_is_sent_again_after_the_reply_timeout_until_the_tries_are_used_up() -> None:
    halt = command("HALT")
    assert is_due(halt)
    assert not halt.tick(100.0), "not sent yet, so not unanswered"
    run_s = 0.0
    for seq in range(LINK.tries):
        assert is_due(halt)
        halt.frame(seq, run_s)
        assert not is_due(halt)
        assert not halt.tick(run_s + 0.99 * LINK.reply_timeout_s)
        assert not is_due(halt)
        run_s += 1.01 * LINK.reply_timeout_s
        assert halt.tick(run_s) is (seq == LINK.tries - 1)
    assert not is_due(halt)
    assert list(halt.seqs) == list(range(LINK.tries))


def test_without_limit_it_never_counts_as_unanswered_and_remembers_the_last_tries() -> None:
    hello = command("HELLO", without_limit=True)
    run_s = 0.0
    for seq in range(50):
        hello.frame(seq, run_s)
        run_s += 0.4
        assert not hello.tick(run_s)
        assert not is_due(hello), "less often than a command to a robot that answers"
        run_s += 0.2
        assert not hello.tick(run_s)
        assert is_due(hello)
    assert list(hello.seqs) == list(range(42, 50))

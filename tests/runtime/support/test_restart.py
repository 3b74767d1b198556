"""Restart in place: the same command without --arm, the console where it was; refused where it could not begin."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from runtime.support.restart import VARIABLE, ConsoleBefore, Restart, console_before, restart_refusal

PROGRAM = """
import os, sys
from runtime.support.restart import ConsoleBefore, Restart, console_before
before = console_before()
print(os.getpid(), sys.argv[1:], before, os.environ.get("ECHOLOCATE_RESTART"))
if before is None:
    restart = Restart(None)
    restart.if_requested()
    restart.request(ConsoleBefore(8765, "secret"))
    restart.if_requested()
"""


def test_the_same_process_begins_again_with_the_console_where_it_was() -> None:
    words = [sys.executable, "-P", "-c", PROGRAM, "run", "--arm", "--arm=true", "--port", "x"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    first, second = done.stdout.splitlines()
    assert first.split()[0] == second.split()[0]
    assert "['run', '--arm', '--arm=true', '--port', 'x'] None None" in first
    assert "['run', '--port', 'x'] ConsoleBefore(port=8765, token='secret') None" in second


@pytest.mark.parametrize("text", ["", "x y", "99999 a", "80", "80 ", "-1 a"])
def test_what_is_not_of_a_restart_is_ignored(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, text)
    assert console_before() is None
    assert VARIABLE not in os.environ


def test_a_command_line_that_cannot_be_carried_out_twice() -> None:
    none = {"--record": None, "--json": None}
    assert restart_refusal(none, force=False, was_chosen=False) is None
    assert "--port" in str(restart_refusal(none, force=False, was_chosen=True))
    assert "--record" in str(restart_refusal(none | {"--record": "x"}, force=False, was_chosen=False))
    assert restart_refusal(none | {"--record": "x"}, force=True, was_chosen=False) is None
    restart = Restart(None)
    restart.if_requested()
    assert ConsoleBefore(1, "a").port == 1

"""Tests of whether a program has its terminal."""

from __future__ import annotations

import os
import pty

import pytest

from runtime.cli.terminal.foreground import in_foreground


def test_a_terminal_belongs_to_the_group_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    group = os.getpgrp()
    monkeypatch.setattr(os, "tcgetpgrp", {3: group, 4: group + 1}.__getitem__)
    assert in_foreground(3)
    assert not in_foreground(4)


def test_a_terminal_that_is_gone_may_be_read() -> None:
    master, slave = pty.openpty()
    os.close(master)
    os.close(slave)
    assert in_foreground(slave)

"""Sentences of the log; those of the page are in `tests/browser/test_signs.py`."""

from __future__ import annotations

import pytest

from runtime.support.log_sentence import sentence


@pytest.mark.parametrize(
    ("event", "fields", "said"),
    [
        ("mode", {"mode": "DRIVE", "cycle": 4, "reason": None}, "Mode DRIVE (cycle 4)"),
        ("mode", {"mode": "SAFE_STOP", "reason": "HALT"}, "Mode SAFE_STOP: HALT."),
        ("console refused", {"reason": "no such object", "client": "client 1 (::1)"},
         "Console refused: no such object (client 1 (::1))"),
        ("recording stopped", {"took_s": 1.5, "complete": True, "pinned": False},
         "Recording stopped (took 1.5 s, complete, not pinned)"),
        ("robot ready", {"port": "/dev/pts/3", "robot": "denning"}, "Robot ready (port /dev/pts/3, robot denning)"),
        ("the file is in use", {"changed": ["a", "b"]}, "The file is in use (changed a, b)"),
        ("what is it?", {}, "What is it?"),
    ],
)  # fmt: skip
def test_a_line_is_a_sentence(event: str, fields: dict[str, object], said: str) -> None:
    assert sentence(event, fields) == said

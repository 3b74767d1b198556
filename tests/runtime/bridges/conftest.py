"""Clients here bear a busy machine: only what hangs takes so long to answer."""

from __future__ import annotations

import pytest

from tests.hil.machine import TIMEOUT_S


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ANSWER_MAX_S", "SILENCE_MAX_S", "CONNECT_MAX_S"):
        monkeypatch.setattr(f"runtime.bridges.console_client.{name}", TIMEOUT_S)

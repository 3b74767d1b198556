"""The other runs of this machine appear on a run's page, without their tokens, and go with them."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from runtime.cli.commands.run import local_runs
from runtime.cli.commands.run.local_runs import other_runs, shown_local_runs
from runtime.support.console_address import announced
from tests.hil.machine import TIMEOUT_S

OWN = "http://127.0.0.1:8765/?token=own"


def test_the_own_run_and_tokens_are_left_out(tmp_path: Path) -> None:
    assert other_runs(OWN, tmp_path) == []
    with announced("http://127.0.0.1:8766/?token=secret", tmp_path):
        (row,) = other_runs(OWN, tmp_path)
        assert row["url"] == "http://127.0.0.1:8766/"
        assert "secret" not in str(row)
        assert other_runs("http://127.0.0.1:8766/?token=secret", tmp_path) == []
    with announced("http://192.168.1.5:8765/?token=secret", tmp_path):
        (row,) = other_runs(OWN, tmp_path)
        assert row["url"] == "http://192.168.1.5:8765/", "another address, though the port is the same"


def test_they_are_shown_when_they_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_runs, "LOOK_S", 0.01)
    shown: list[list[dict[str, Any]]] = []

    async def until(count: int) -> None:
        while len(shown) < count:
            await asyncio.sleep(0.01)

    async def body() -> None:
        async with shown_local_runs(OWN, tmp_path, shown.append):
            with announced("http://127.0.0.1:8766/?token=secret", tmp_path):
                await until(1)
            await until(2)

    asyncio.run(asyncio.wait_for(body(), TIMEOUT_S))
    assert [len(rows) for rows in shown] == [1, 0]

"""`echolocate foxglove` and `run --foxglove`: what a user can get wrong, the layout, the process beside a run."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Mapping, MutableMapping
from typing import Any

import pytest
import structlog

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command
from runtime.cli.commands import foxglove
from runtime.cli.commands.foxglove import foxglove_beside
from runtime.support import child_process
from tests.hil.machine import TIMEOUT_S


def test_the_layout_is_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["foxglove", "--print-layout"]) == DONE
    assert "configById" in json.loads(capsys.readouterr().out)


def test_without_the_package_or_the_console_there_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["run", "--foxglove", "--no-console"]) == WRONG_CALL
    assert "--foxglove needs the console" in capsys.readouterr().err
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert run_command(["foxglove"]) == FAILED
    assert "pip install 'echolocate[export]'" in capsys.readouterr().err


def test_a_port_in_use_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert run_command(["foxglove", "--connect", "http://127.0.0.1:9/?token=x", "--port",
                            str(taken.getsockname()[1])]) == FAILED  # fmt: skip
    assert "cannot listen on 127.0.0.1" in capsys.readouterr().err


async def test_the_process_beside_a_run_gets_the_address_and_its_end_is_logged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lines: list[dict[str, object]] = []
    started: list[dict[str, str]] = []
    start = child_process.start_child

    async def starting(_module: str, _: object, **how: object) -> object:
        started.append(how["environment"])  # type: ignore[arg-type]
        return await start("no_such_module", [], pipes=False)

    def keep(_logger: object, _name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        lines.append(dict(event))
        raise structlog.DropEvent

    monkeypatch.setattr(foxglove, "start_child", starting)
    log = structlog.wrap_logger(None, processors=[keep])

    async with foxglove_beside("http://x:1/?token=t", log), asyncio.timeout(TIMEOUT_S):
        while not any(line["event"] == "the process that serves Foxglove has ended" for line in lines):
            await asyncio.sleep(0.01)
    assert started == [{"ECHOLOCATE_CONSOLE": "http://x:1/?token=t"}]
    assert lines[0]["event"] == "foxglove"

"""The console as a part of the run: hints for the terminal, its health, and its warning when it is reachable."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from tests.runtime.console.console_case import open_console


async def test_hints_name_the_start_url_and_the_tunnel() -> None:
    async with open_console() as case:
        first, second = case.console.hints()
        assert first == f"console: {case.console.url}"
        assert second.startswith("from another machine: ssh -L ")
        assert not [line for line in case.log if line["level"] == "warning"]


async def test_a_port_that_another_program_has_is_replaced_with_a_word() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        busy = other.getsockname()[1]
        async with open_console(f"console.port={busy}") as case:
            assert case.url.port != busy
            assert f"console.port {busy} is in use by another program" in case.console.hints()
            (warning,) = [line for line in case.log if line["level"] == "warning"]
            assert (
                warning["event"] == f"port {busy} of console.port is in use, so the console has port {case.url.port}"
            )


async def test_a_console_open_to_other_machines_warns() -> None:
    async with open_console("console.host=0.0.0.0") as case:
        assert case.console.tunnel is None
        (warning,) = [line for line in case.log if line["level"] == "warning"]
        assert "anyone with the token can drive" in str(warning["event"])


async def test_other_robots_are_shown_to_open_pages_and_new_ones() -> None:
    robots = [{"name": "beta", "mode": "DRIVE", "url": "http://10.0.0.7:8765/", "version": "1"}]
    async with open_console() as case:
        assert case.console.listening == (case.url.host, case.url.port)
        page = await case.connect()
        assert (await page.next("session"))["robots"] == []
        case.console.show_robots(robots)
        assert (await page.next("robots"))["robots"] == robots
        late = await case.connect()
        assert (await late.next("session"))["robots"] == robots


async def test_a_console_that_stops_listening_is_unhealthy() -> None:
    async with open_console() as case:
        assert case.console.probe() is None
        server = case.console._server
        assert server is not None
        assert server._server is not None
        server._server.close()
        assert case.console.probe() == "it does not listen any more"


async def test_a_kept_token_is_that_of_the_run_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    tokens = []
    for sets in (["console.keep_token=true"], ["console.keep_token=true"], []):
        async with open_console(*sets) as case:
            tokens.append(case.token)
            assert not [line for line in case.log if line["level"] == "warning"]
    assert tokens[0] == tokens[1] != tokens[2]
    (tmp_path / "echolocate" / "console-token").chmod(0o644)
    async with open_console("console.keep_token=true") as case:
        assert case.token not in tokens, "others could know it"
        assert [line["event"] for line in case.log if line["level"] == "warning"] == [
            "this run has a token of its own: pages opened before cannot come back"
        ]

"""`echolocate run` in this process: ports that cannot be used, files in use, and addresses."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from config.errors import FAILED, WRONG_CALL
from drivers.link import Link
from runtime.cli.app import run_command
from runtime.cli.commands.run import run
from runtime.cli.commands.run.run import EmulatorOptions
from runtime.cli.commands.run.run_settings import SettingsFiles
from runtime.support.file_lock import file_lock
from tests.drivers.stranger import Stranger

HEADLESS = ("--headless", "--no-record", "--no-console", "--arm", "--seconds", "600")


def error_line(capfd: pytest.CaptureFixture[str]) -> str:
    """Return the only error line of a run that wrote nothing else."""
    captured = capfd.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    (line,) = [line for line in captured.err.splitlines() if line.startswith("echolocate: ")]
    return line


@pytest.mark.parametrize("kind", ["missing", "file", "folder", "fifo", "null", "dangling link"])
def test_what_is_no_serial_port(tmp_path: Path, kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "port"
    match kind:
        case "file":
            path.touch()
        case "folder":
            path.mkdir()
        case "fifo":
            os.mkfifo(path)
        case "null":
            path.symlink_to(os.devnull)
        case "dangling link":
            path.symlink_to(tmp_path / "nowhere")
    assert run_command(["run", "--port", str(path), *HEADLESS]) == WRONG_CALL
    assert str(path) in error_line(capfd)


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> bytearray:
    """What this process has sent; a pty may hear other tests' programs, to which its number belonged before."""
    data, send = bytearray(), Link.send

    def noting(link: Link, frame: bytes) -> bool:
        data.extend(frame)
        return send(link, frame)

    monkeypatch.setattr(Link, "send", noting)
    return data


@pytest.mark.promise("P13")
def test_a_port_in_use(tmp_path: Path, sent: bytearray, capfd: pytest.CaptureFixture[str]) -> None:
    summary = tmp_path / "summary.json"
    with Stranger() as stranger:
        fd = os.open(stranger.path, os.O_RDWR | os.O_NOCTTY)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            assert run_command(["run", "--port", stranger.path, "--json", str(summary), *HEADLESS]) == FAILED
        finally:
            os.close(fd)
        line = error_line(capfd)
        assert line == f"echolocate: {json.loads(summary.read_bytes())['stop_reasons'][0]}"
        assert stranger.path in line
        assert "in use" in line
        assert not sent


def test_the_summary_is_in_its_file_though_the_output_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def whole_run(*_: object) -> tuple[dict[str, object], SimpleNamespace]:
        return {"mode": "READY"}, SimpleNamespace(on_summary=lambda _: None, summary_row=None)

    def print_summary(*_: object) -> None:
        raise SystemExit(1)  # as rich does at a closed pipe

    monkeypatch.setattr(run, "_whole_run", whole_run)
    monkeypatch.setattr(run, "_print_summary", print_summary)
    with contextlib.suppress(SystemExit):
        run_command(["run", "--headless", "--no-record", "--json", str(tmp_path / "summary.json")])
    assert json.loads((tmp_path / "summary.json").read_bytes())["mode"] == "READY"


@pytest.mark.promise("P13")
def test_a_record_that_another_run_writes(
    tmp_path: Path, sent: bytearray, capfd: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    record = tmp_path / "run.csv"
    with Stranger() as stranger, file_lock(record, "--record"):
        command = ["run", "--port", stranger.path, "--headless", "--no-console", "--record", str(record)]
        assert run_command(command) == FAILED
        assert f"--record {record}: another process writes to this file" in error_line(capfd)
        assert not sent, "it is refused before anything is said to a robot"


def test_a_port_that_goes_away_before_the_handshake(sent: bytearray, capfd: pytest.CaptureFixture[str]) -> None:
    with Stranger(hangs_up=True) as stranger:
        assert run_command(["run", "--port", stranger.path, *HEADLESS]) == FAILED
        assert sent, "it was asked"
        assert stranger.heard
        assert stranger.path in error_line(capfd)


@pytest.mark.parametrize(("host", "code"), [("192.0.2.1", FAILED), ("no.such.host.invalid", WRONG_CALL)])
def test_where_there_is_nowhere_to_listen(
    host: str, code: int, sent: bytearray, capfd: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    with Stranger() as stranger:
        command = ["run", "--port", stranger.path, "--headless", "--no-record", "--set", f"console.host={host}"]
        assert run_command(command) == code
        assert host in error_line(capfd)
        assert not sent


@pytest.mark.promise("P24")
def test_a_pattern_with_which_it_could_not_drive_is_refused_at_the_start(
    capfd: pytest.CaptureFixture[str],
) -> None:
    backwards = "ring.firing={sets=[[10, 12, 14]]}"
    assert run_command(["run", "--set", backwards, *HEADLESS]) == WRONG_CALL
    assert "the pattern does not look ahead" in error_line(capfd)


def test_the_robot_named_on_the_command_line_is_that_of_the_emulator(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert run_command(["run", "--robot", "p3xd", *HEADLESS]) == WRONG_CALL
    assert "p3dx" in error_line(capfd)
    arguments = EmulatorOptions(seed=1).arguments(SettingsFiles(robot="p3dx"), force=False)
    assert arguments == ["--robot", "p3dx", "--seed", "1"]


@pytest.mark.parametrize("address", ["127.0.0.1:1", "127.0.0.1", "no.such.host.invalid:8101"])
def test_a_socket_without_a_robot_is_one_line(address: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(["run", "--port", f"socket://{address}", *HEADLESS]) in {FAILED, WRONG_CALL}
    assert f"socket://{address}" in error_line(capfd)

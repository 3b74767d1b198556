"""`echolocate ros2`: the launch file, and one line where ROS is missing."""

from __future__ import annotations

import ast
import asyncio
import os
import signal
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, UserError
from runtime.cli.app import run_command
from runtime.cli.commands import ros2
from runtime.support.console_address import FOLDER, announced
from runtime.support.file_lock import file_lock
from runtime.support.user_folders import state_folder


def test_the_launch_file_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["ros2", "--print-launch"]) == DONE
    tree = ast.parse(capsys.readouterr().out)
    assert "generate_launch_description" in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_without_ros_it_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ros2, "find_spec", lambda _: None)
    assert run_command(["ros2", "--ros-args", "-r", "__ns:=/r1"]) == FAILED
    assert capsys.readouterr().err == f"echolocate: {ros2.NO_ROS}\n"


def test_the_run_is_that_of_the_option_or_the_newest_one_here(
    monkeypatch: pytest.MonkeyPatch, tmp_path: os.PathLike[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert ros2.console_finder("http://h:1/?token=x")() == "http://h:1/?token=x"
    find = ros2.console_finder(None)
    with pytest.raises(UserError, match="start `echolocate run`"):
        find()
    with announced("http://h:2/?token=y", state_folder()):
        assert find() == "http://h:2/?token=y"
        assert ros2.console_finder("http://h:2/")() == "http://h:2/?token=y"
        assert ros2.console_finder("http://h:3/")() == "http://h:3/"


def test_several_runs_are_named_without_their_tokens(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    older = state_folder() / FOLDER / "1"
    older.parent.mkdir(parents=True)
    older.touch(0o600)
    older.write_text("http://127.0.0.1:1/?token=x\n")
    os.utime(older, (1, 1))
    with file_lock(older, "older"), announced("http://h:2/?token=y", state_folder()):
        assert ros2.console_finder(None)() == "http://h:2/?token=y"
        assert capsys.readouterr().err == (
            "echolocate: 2 runs on this machine: http://h:2/, http://127.0.0.1:1/; "
            "the newest is taken, --connect names another\n"
        )
        assert ros2.console_finder("http://127.0.0.1:1")() == "http://127.0.0.1:1/?token=x"


async def test_a_signal_ends_it_in_order() -> None:
    ended = []

    async def work() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        try:
            await asyncio.sleep(60.0)
        finally:
            ended.append(True)

    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    try:
        await ros2.until_interrupted(work())
    finally:
        signal.signal(signal.SIGTERM, before[0])
        signal.signal(signal.SIGINT, before[1])
    assert ended == [True]

"""Every stream that a program can be given: closed, full, without a reader, of another character set."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.standard_streams import is_open
from runtime.support.child_process import child_environment

FULL = Path("/dev/full")
SETTINGS = "-m runtime.cli settings"
WRONG = "-m runtime.cli check nosuch"
DEGREE = "from runtime.cli.standard_streams import *; open_standard_streams(); print('90°', '\\udcff')"
"""Prints what ASCII lacks, and the byte of a file name that is not UTF-8."""

pytestmark = pytest.mark.promise("P28")


def shell(redirection: str, arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run Python with its streams redirected as a shell does it."""
    return subprocess.run(
        ["sh", "-c", f'exec "$0" {arguments} {redirection}', sys.executable],
        env=child_environment() | environment, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip


@pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full, the device that is always full")
@pytest.mark.parametrize("arguments", [pytest.param(SETTINGS, marks=pytest.mark.soak), "-u -m runtime.cli --version"])
def test_full_output_is_one_line_of_error(arguments: str, measured: Callable[[str], None]) -> None:
    done = shell(">/dev/full", arguments)
    assert done.returncode == FAILED
    assert done.stderr == (
        "echolocate: standard output cannot be written: No space left on device; make room or redirect it elsewhere\n"
    )
    measured("standard output full: one line of error; closed streams, full standard error and ASCII: no traceback")


@pytest.mark.parametrize(
    ("redirection", "arguments", "code"),
    [
        ("2>&- >&- <&-", SETTINGS, DONE),
        pytest.param(
            "2>/dev/full", WRONG, WRONG_CALL, marks=pytest.mark.skipif(not FULL.exists(), reason="no device")
        ),
    ],
)
def test_a_stream_that_takes_nothing_changes_no_exit_code(redirection: str, arguments: str, code: int) -> None:
    done = shell(redirection, arguments)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", "")


@pytest.mark.parametrize("arguments", [SETTINGS, pytest.param("-m runtime.cli --help", marks=pytest.mark.soak)])
def test_a_reader_that_has_what_it_wants_is_no_failure(arguments: str) -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, *arguments.split()], env=child_environment(), stdout=write, stderr=subprocess.PIPE,
        timeout=600, check=False,
    )  # fmt: skip
    os.close(write)
    assert (done.returncode, done.stderr) == (DONE, b"")


def test_a_pipe_that_is_never_read_holds_no_end() -> None:
    """The pipe is full before the call, and stays so."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    with contextlib.suppress(BlockingIOError):
        while os.write(write, b" " * 4096):
            pass
    os.set_blocking(write, True)
    try:
        wrong = [sys.executable, *WRONG.split()]
        assert subprocess.call(wrong, env=child_environment(), stderr=write, timeout=600) == WRONG_CALL
    finally:
        os.close(read)
        os.close(write)


def test_what_the_character_set_lacks_is_escaped() -> None:
    for encoding, text in (("ascii", "90\\xb0 \\udcff\n"), ("utf-8", "90° \\udcff\n")):
        done = shell("", f'-c "{DEGREE}"', PYTHONIOENCODING=f"{encoding}:strict", PYTHONUTF8="0")
        assert (done.returncode, done.stdout) == (0, text), done.stderr


def test_no_file_becomes_a_standard_stream() -> None:
    """What is opened after the streams does not get the number of a closed one, into which others write."""
    program = DEGREE.partition("print")[0] + "import os; os._exit(os.open('/dev/null', 0))"
    assert shell("2>&- >&- <&-", f'-c "{program}"').returncode > 2


def test_open_descriptors() -> None:
    read, write = os.pipe()
    assert is_open(read)
    os.close(read)
    assert not is_open(read)
    os.close(write)

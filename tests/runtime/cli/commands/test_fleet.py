"""`echolocate fleet` as a command: it says where its page is, and a wrong call is one line."""

from __future__ import annotations

import subprocess
import sys

from config.errors import WRONG_CALL


def test_a_wrong_address_is_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "runtime.cli", "fleet", "http://host/"], capture_output=True, text=True, check=False
    )
    assert done.returncode == WRONG_CALL
    assert done.stderr.startswith("echolocate: http://host/: give the start URL")
    assert len(done.stderr.splitlines()) == 1

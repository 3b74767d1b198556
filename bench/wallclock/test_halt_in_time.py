"""P2 by the wall clock: thirty HALTs on a real pty, cycles busy and the disk at a stand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hil.test_halt_in_time import halts, report

pytestmark = pytest.mark.usefixtures("warm_kernels")


async def test_thirty_halts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:  # fmt: skip
    report(await halts(tmp_path, monkeypatch, 30), measured)

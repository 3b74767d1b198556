"""P6 by the wall clock: a peer stalled for five seconds opens no gap in the loop. `make soak` stalls it longer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.drivers.test_stalled_peer import HOWS, survive
from tests.hil.machine import stalls_excused


@pytest.mark.parametrize("how", HOWS)
@stalls_excused
async def test_a_stalled_peer_is_harmless(tmp_path: Path, how: str, measured: Callable[[str], None]) -> None:
    measured(await survive(tmp_path / "robot", how, 5.0))

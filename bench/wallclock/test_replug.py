"""P5 by the wall clock: with the settings as shipped, echoes come again within a second of the replug."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from config.robot import LinkConfig
from tests.drivers.test_replug_cycles import CUTS, echo_after_cut
from tests.hil.machine import stalls_excused

ECHO_WITHIN_S = 1.0
OUTAGE_S = 0.2


@stalls_excused
async def test_cut_for_real_within_what_the_robot_says(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """Hung up within IDENT, ACK, ODOM or ECHO, plugged in again 0.2 s later."""
    taken_s = [
        await echo_after_cut(path := tmp_path / f"robot-{cut}", cut, LinkConfig(port=str(path)), OUTAGE_S)
        for cut in CUTS
    ]
    assert max(taken_s) <= ECHO_WITHIN_S, taken_s
    measured(
        f"{len(taken_s)} cuts on a pty, within the robot's frames: an echo ≤ {max(taken_s):.2f} s after the replug"
    )

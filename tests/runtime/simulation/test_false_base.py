"""P25: the base is not believed on its word; motion is judged by what the emulator truly did."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.driver import LineState
from drivers.emulator.faults import Deadman
from drivers.messages import Twist
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import Run, hallway

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P25")]


def is_standing(run: Run) -> bool:
    """Return whether the true base has never moved."""
    return all(truth.twist == Twist(0.0, 0.0) and truth.pose == run.truths[0].pose for truth in run.truths)


@pytest.mark.parametrize("deadman_ms", [0, 1, 65_535])
def test_a_base_with_a_useless_deadman_is_not_driven(deadman_ms: int, measured: Callable[[str], None]) -> None:
    run = hallway(1, Deadman(kind="deadman", at_s=0.0, deadman_ms=deadman_ms), method="paper")
    run.until(3.0)
    assert run.driver.state is LineState.DOWN
    assert run.mode is Mode.CONNECTING
    assert "correct the deadman" in (run.state.mode.reason or "")
    assert is_standing(run)
    measured(f"a deadman of {deadman_ms:,} ms: refused, not driven")

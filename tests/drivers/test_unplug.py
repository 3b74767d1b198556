"""P5 in virtual time: the line is cut before every byte there is, and echoes come again soon after it is mended."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import pytest

from config.robot import LinkConfig
from drivers.driver import LineState
from drivers.messages import LinkCounts
from tests.drivers.cable import STEP_S, Cable, Way

ECHO_WITHIN_S = 1.0 - LinkConfig().reopen_max_s
"""What a second leaves when the plug comes back right after an attempt to open it."""
HANDSHAKE_BYTES = 60
"""Bytes of the longer direction until the robot has accepted the pattern: IDENT, ACK and the first odometry."""
WAYS: tuple[Way, ...] = ("to the robot", "to the host")


def one_pattern() -> dict[Way, int]:
    """Return how many bytes go each way from the first HELLO to the last echo of the first full pattern."""
    cable = Cable()
    cable.plug()
    while len(cable.firings) < 3:
        cable.step()
    return dict(cable.passed)


def cut_before_bytes(way: Way, outages_s: Sequence[float], stride: int = 1) -> str:
    """Cut twice in a row before the same byte, so that the handshake of a replugged line is cut as well.

    Of the bytes after the handshake only each `stride`-th is tried.
    """
    total = one_pattern()[way]
    assert total > 20
    worst, places = 0.0, [byte for byte in range(total) if byte < HANDSHAKE_BYTES or byte % stride == 0]
    for byte in places:
        cable = Cable(cut_after=(way, byte))
        for turn in range(2):
            cable.plug()
            while cable.plugged:
                cable.step()
            cable.run(outages_s[(byte + turn) % len(outages_s)])
            assert cable.driver.state is LineState.CLOSED
        cable.cut_after = None
        cable.plug()
        worst = max(worst, cable.until_echo(ECHO_WITHIN_S))
        assert cable.driver.state is LineState.READY
        assert cable.driver.problem is None
        cable.run(0.1)
        times = [firing.robot_s for firing in cable.firings]
        assert all(b - a >= 0.0499 for a, b in itertools.pairwise(times)), "none twice, none too soon"
    shown = ", ".join(f"{outage_s:g}" for outage_s in outages_s)
    return f"cut before {len(places)} of {total} bytes {way}, for {shown} s: echoes ≤ {worst:.3f} s after reopening"


@pytest.mark.compiled
@pytest.mark.promise("P5")
@pytest.mark.parametrize("way", WAYS)
def test_cut_before_any_byte(way: Way, measured: Callable[[str], None]) -> None:
    measured(cut_before_bytes(way, (STEP_S, 0.2), stride=7))


@pytest.mark.soak
@pytest.mark.promise("P5")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("outage_s", [STEP_S, 0.05, 0.45, 1.1, 12.9])
def test_cut_before_every_byte_for_long_and_short(way: Way, outage_s: float, measured: Callable[[str], None]) -> None:
    measured(cut_before_bytes(way, (outage_s,)))


def test_an_unplugged_line_costs_no_good_frame() -> None:
    """What a cut tears is counted as bad or lost; what comes after is whole."""
    cable = Cable()
    for _ in range(20):
        cable.plug()
        cable.until_echo(ECHO_WITHIN_S)
        cable.unplug()
        cable.run(0.1)
    counts = cable.driver.counts
    assert counts == LinkCounts(counts.frames, bad=0, lost=0)
    assert counts.frames > 100

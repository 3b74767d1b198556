"""The contract of failures: cut at any byte, noise, mute, deaf, a restart: noticed, named, over when they are."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import pytest

from config.robot import LinkConfig
from drivers.contract.cable import CYCLE_STEPS, STEP_S, Way
from drivers.contract.family import ROOM, Family, script
from drivers.driver import LineState
from drivers.messages import LinkCounts, Twist

STILL = Twist(0.0, 0.0)
PHASES = 5
WAYS: tuple[Way, ...] = ("to the robot", "to the host")


def one_pattern(family: Family) -> dict[Way, int]:
    """Return how many bytes go each way until the third firing."""
    cable = family.cable()
    cable.plug()
    cable.until(lambda: len(cable.firings) >= 3, 2.0 * family.connect_s, "three firings")
    return dict(cable.passed)


def cut_before_bytes(family: Family, way: Way, outages_s: Sequence[float], stride: int = 1) -> str:
    """Cut twice in a row before the same byte, so that the handshake of a replugged line is cut as well.

    Of the bytes after the handshake only each `stride`-th is tried.
    """
    total = one_pattern(family)[way]
    worst, tried = 0.0, [byte for byte in range(total) if byte < family.handshake_bytes or byte % stride == 0]
    for byte in tried:
        cable = family.cable()
        cable.cut_after = (way, byte)
        for turn in range(2):
            cable.plug()
            cable.until_cut(2.0 * family.connect_s)
            cable.run(outages_s[(byte + turn) % len(outages_s)])
            assert cable.driver.state is LineState.CLOSED
        cable.cut_after = None
        cable.plug()
        worst = max(worst, cable.until_echo(2.0 * family.connect_s))
        assert cable.driver.state is LineState.READY
        assert cable.driver.problem is None
        cable.run(0.1)
        times = [firing.robot_s for firing in cable.firings]
        assert all(b > a for a, b in itertools.pairwise(times)), "none twice, none too soon"
    shown = ", ".join(f"{outage_s:g}" for outage_s in outages_s)
    cut = f"{family.name} cut before {len(tried)} of {total} bytes {way}, for {shown} s"
    return f"{cut}: echoes ≤ {worst:.3f} s after reopening"


@pytest.mark.compiled
@pytest.mark.promise("P5")
@pytest.mark.parametrize("way", WAYS)
def test_cut_before_any_byte(family: Family, way: Way, measured: Callable[[str], None]) -> None:
    measured(cut_before_bytes(family, way, (STEP_S, 0.2), stride=family.cut_stride))


@pytest.mark.soak
@pytest.mark.promise("P5")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("outage_s", [STEP_S, 0.05, 0.45, 1.1, 12.9])
def test_cut_before_every_byte_for_long_and_short(
    family: Family, way: Way, outage_s: float, measured: Callable[[str], None]
) -> None:
    measured(cut_before_bytes(family, way, (outage_s,)))


@pytest.mark.promise("P5")
def test_an_echo_comes_again_within_a_second_of_the_replug(family: Family) -> None:
    """What a second leaves when the plug comes back right after an attempt to open it; longer handshakes say so."""
    cable = family.connected()
    cable.unplug()
    cable.run(0.1)
    cable.plug()
    assert cable.until_echo(10.0) <= max(family.connect_s, 1.0 - LinkConfig().reopen_max_s)


def test_an_unplugged_line_costs_no_good_frame(family: Family) -> None:
    """What a cut tears is counted as bad or lost; what comes after is whole."""
    cable = family.cable()
    for _ in range(5):
        cable.plug()
        cable.until_echo(2.0 * family.connect_s)
        cable.unplug()
        cable.run(0.1)
    counts = cable.driver.counts
    assert counts == LinkCounts(counts.frames, bad=0, lost=0)
    assert counts.frames >= 5


@pytest.mark.promise("P6")
@pytest.mark.parametrize("kind", ["mute", pytest.param("deaf", marks=pytest.mark.needs("acknowledgement"))])
def test_a_robot_that_falls_silent_is_called_dead_and_comes_back(
    family: Family, kind: str, measured: Callable[[str], None]
) -> None:
    """In virtual time, exactly: at phases of the cycle and of the odometry, noticed at 20 Hz."""
    limit_s, worst_s, cycle_s = family.silent_s if kind == "mute" else family.deaf_s, 0.0, CYCLE_STEPS * STEP_S
    for phase in range(PHASES):
        at_s = family.connect_s + 2.0 + 0.1 / PHASES * phase
        cable = family.driving(None, *script(kind=kind, at_s=at_s, duration_s=4.0))
        cable.until_state(LineState.DOWN, 8.0)
        worst_s = max(worst_s, -(-cable.now_s // cycle_s) * cycle_s - at_s)
        assert cable.driver.problem is not None
        assert "\n" not in cable.driver.problem
    cable.twist = None
    cable.until_state(LineState.READY, 12.0)
    cable.until_echo(2.0)
    assert cable.driver.problem is None
    assert worst_s <= limit_s + 1e-9
    measured(f"{family.name} {kind}, at {PHASES} phases: called dead after ≤ {worst_s:.3f} s")


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        ("garbage", {"bytes_per_s": 500.0}),
        pytest.param("bit_errors", {"rate": 2e-3}, marks=pytest.mark.needs("checksum")),
    ],
)
def test_noise_gives_no_false_range_and_the_line_recovers(family: Family, kind: str, more: dict[str, float]) -> None:
    noise = script(kind=kind, at_s=family.connect_s + 0.5, duration_s=2.0, **more)
    cable = family.connected(*noise)
    quiet = family.connected()
    quiet.run(1.0)
    cable.run(family.connect_s + 2.5 - cable.now_s)
    assert cable.driver.counts.bad > 0 or kind == "garbage", "garbage may look like no frame at all"
    cable.until_state(LineState.READY, family.connect_s + 5.0)
    cable.until_echo(2.0)
    true = {range_m for firing in quiet.firings for range_m in firing.ranges_m if range_m == range_m}
    heard = {range_m for firing in cable.firings for range_m in firing.ranges_m if range_m == range_m}
    assert heard <= true
    times = [firing.robot_s for firing in cable.firings]
    assert all(b > a for a, b in itertools.pairwise(times))


@pytest.mark.needs("restart")
@pytest.mark.promise("P7")
@pytest.mark.parametrize("off_s", [0.0, 0.1, 1.0])
def test_a_restart_is_reported_and_measurements_begin_anew(family: Family, off_s: float) -> None:
    at_s = family.connect_s + 3.0
    cable = family.driving(None, *script(kind="reboot", at_s=at_s, duration_s=off_s), world=ROOM)
    before = cable.driver.identity
    cable.until(lambda: cable.now_s >= at_s - STEP_S, 10.0, "the restart")
    cable.twist = None
    cable.until(lambda: cable.restarts > 0, 6.0 + off_s, "report of the restart")
    cable.odometry.clear()
    cable.firings.clear()
    cable.run(1.0)
    after = cable.driver.identity
    assert before is not None
    assert after is not None
    assert after.boot_id != before.boot_id
    assert cable.restarts == 1
    assert cable.driver.state is LineState.READY
    assert max(abs(sample.pose.x) for sample in cable.odometry) < 0.1, "odometry from zero"
    assert cable.firings
    assert cable.robot.truth.twist == STILL


def test_a_robot_that_is_unplugged_by_its_own_fault_is_the_same_as_a_cut(family: Family) -> None:
    cable = family.driving(None, *script(kind="unplug", at_s=family.connect_s + 2.0, duration_s=0.3))
    cable.until(lambda: not cable.robot.plugged, 10.0, "unplug")
    cable.unplug()
    cable.until(lambda: cable.robot.plugged, 1.0, "replug")
    cable.plug()
    family.until_ready(cable)

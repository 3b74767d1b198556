"""Odometry and firings from SIPs: poses at the time of the firing, sessions, restarts, jumps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.arcos.frames import Sip, SonarReading
from drivers.arcos.pose_stamping import PoseStamper
from drivers.arcos.wire_units import discs_of, polling_of
from drivers.messages import Firing, Flags, Odometry
from tests.drivers.arcos.harness import P3DX_FILE
from tests.drivers.arcos.vectors import TAIL


class Driven:
    """A stamper and a base that moves at 0.4 m/s, 82.5 counts from SIP to SIP."""

    def __init__(self) -> None:
        self.stamper = PoseStamper(P3DX_FILE, discs_of(P3DX_FILE))
        self.now = 50.0
        self.x = 0.0

    def sip(self, *discs: int, speed: int = 400) -> tuple[Odometry, list[Firing]]:
        self.now += 0.1
        self.x += 0.1 * speed / 0.485
        sonar = tuple(SonarReading(disc, 1000) for disc in discs)
        sip = replace(TAIL, x=round(self.x), left=speed, right=speed, sonar=sonar)
        return self.stamper.sip(sip, self.now, Flags.NONE, after_loss=False)

    def begin(self, sip: Sip = TAIL, *, was_reset: bool = False, was_lost: bool = False) -> bool:
        return self.stamper.begin_session(sip, was_reset=was_reset, was_lost=was_lost)


def test_the_clock_begins_with_the_first_sip() -> None:
    driven = Driven()
    assert driven.sip()[0].robot_s == 0.0
    assert driven.sip()[0].robot_s == pytest.approx(0.1)


def test_a_firing_has_the_pose_of_its_time() -> None:
    driven = Driven()
    for _ in range(3):
        driven.sip()
    sample, firings = driven.sip(0, 8, 1, 9)
    assert [sample.robot_s - firing.robot_s for firing in firings] == pytest.approx([0.1, 0.06])
    for firing in firings:
        age_s = sample.robot_s - firing.robot_s
        assert sample.pose.x - firing.pose.x == pytest.approx(0.4 * age_s, abs=1e-3)


def test_the_bytes_of_a_sip_take_their_time_on_the_line() -> None:
    driven = Driven()
    driven.sip()
    sip = replace(TAIL, sonar=tuple(SonarReading(disc, 1000) for disc in range(5)))
    sample, _ = driven.stamper.sip(sip, driven.now + 0.1, Flags.NONE, 9600, after_loss=False)
    assert sample.robot_s == pytest.approx(0.1 - 56 * 10 / 9600)


def test_a_firing_before_the_first_sip_is_dropped() -> None:
    driven = Driven()
    assert driven.sip(0, 8)[1] == []
    assert driven.stamper.late_echoes.count == 1


def test_an_odometry_that_was_set_is_continued_with_a_note() -> None:
    driven = Driven()
    for _ in range(20):
        before, _ = driven.sip()
    driven.x = 0.0
    after, _ = driven.sip()
    assert after.pose.x - before.pose.x == pytest.approx(0.04, abs=1e-3)
    (note,) = driven.stamper.notes()
    assert "the odometry jumped by" in note
    assert driven.stamper.origin.x < -0.5


def test_a_new_session_at_zero_continues_where_the_robot_was() -> None:
    driven = Driven()
    for _ in range(20):
        before, _ = driven.sip()
    driven.stamper.break_off()
    driven.now += 3.0
    driven.x = 0.0
    assert not driven.begin()
    after, _ = driven.sip(speed=0)
    assert after.pose == before.pose
    assert "began at zero again with the new session" in driven.stamper.notes()[0]
    later, _ = driven.sip()
    assert later.pose.x - after.pose.x == pytest.approx(0.04, abs=1e-3)
    assert later.robot_s - before.robot_s == pytest.approx(3.2)


def test_a_new_session_that_counts_on_continues() -> None:
    driven = Driven()
    for _ in range(20):
        before, _ = driven.sip()
    driven.stamper.break_off()
    assert not driven.begin(replace(TAIL, x=round(driven.x)), was_lost=True)
    assert driven.sip(speed=0)[0].pose.x == pytest.approx(before.pose.x)


@pytest.mark.parametrize(
    ("was_reset", "was_lost", "restarted"), [(True, False, True), (False, True, True), (False, False, False)]
)
def test_a_robot_that_lost_its_session_and_its_odometry_has_restarted(
    was_reset: bool, was_lost: bool, restarted: bool
) -> None:
    driven = Driven()
    for _ in range(20):
        driven.sip()
    assert driven.begin(was_reset=was_reset, was_lost=was_lost) == restarted
    driven.x = 0.0
    sample, _ = driven.sip(speed=0)
    assert (sample.robot_s == 0.0) == restarted
    assert (sample.pose.x == 0.0) == restarted


def test_the_first_session_is_no_restart() -> None:
    assert not Driven().begin(was_reset=True, was_lost=True)


def test_a_flood_of_ranges_is_bounded_and_reported() -> None:
    driven = Driven()
    driven.stamper.set_polling(polling_of(P3DX_FILE, discs_of(P3DX_FILE)))
    passed = 0
    for _ in range(1000):
        driven.now -= 0.099  # a hundred times as often
        passed += len(driven.sip(*range(16), speed=0)[1])
    assert passed <= 64 + 4 / 0.041 + 1
    assert passed + driven.stamper.excess_echoes + driven.stamper.late_echoes.count == 1000
    assert sum("many more firings than its pattern has" in note for note in driven.stamper.notes()) == 1

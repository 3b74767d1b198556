"""What all drivers keep of a session: bounded firings, notes said once, and what a restart discards."""

from __future__ import annotations

import numpy as np

from config.load import load_robot
from drivers.driver import LineState, Received
from drivers.messages import Firing, Flags, LinkCounts, Pose
from drivers.session import FIRINGS_MAX, Session
from drivers.stamper import Stamper


class Plain(Session[Stamper]):
    """A session whose line has brought ten frames."""

    def __init__(self) -> None:
        super().__init__(Stamper(load_robot("p3dx").body))
        self._earlier_counts = LinkCounts(5, 2, 1)

    @property
    def _line_counts(self) -> LinkCounts:
        return LinkCounts(10, 1, 1)

    def line_closed(self) -> None:
        self._state = LineState.CLOSED

    def fires(self, count: int) -> None:
        here, ranges = Pose(0.0, 0.0, 0.0), np.zeros(1)
        self._firings += [Firing(0.1 * k, here, 0.0, ranges) for k in range(count)]
        self._flags |= Flags.BUMPER

    def says(self, text: str) -> None:
        self._note_once(text)

    def restarts(self) -> None:
        self._forget_received()


def test_what_it_is_before_anything_comes() -> None:
    session = Plain()
    assert (session.state, session.problem, session.identity) == (LineState.CLOSED, None, None)
    assert (session.battery_v, session.line_baud) == (None, None)
    assert session.odometry_origin == Pose(0.0, 0.0, 0.0)
    assert session.counts == LinkCounts(15, 3, 2)
    assert session.take_received() == Received((), None, rebooted=False)


def test_the_oldest_firings_are_dropped_and_what_was_taken_is_gone() -> None:
    session = Plain()
    session.fires(FIRINGS_MAX + 3)
    assert session.firings_waiting == FIRINGS_MAX
    received = session.take_received()
    assert (len(received.firings), received.flags) == (FIRINGS_MAX, Flags.BUMPER)
    assert received.firings[0].robot_s > 0.25
    assert session.take_received() == Received((), None, rebooted=False)


def test_a_note_is_said_once_and_a_restart_discards_what_came() -> None:
    session = Plain()
    for text in ("a", "b", "a"):
        session.says(text)
    session.fires(3)
    session.restarts()
    assert session.take_received() == Received((), None, rebooted=True, notes=("a", "b"))
    session.says("b")
    assert session.take_received().notes == ()

"""The conversation with a Denning in virtual time, against a scripted device that speaks frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.robot import BodyConfig, FiringConfig, LinkConfig, RingConfig, RobotConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import (
    Ack,
    Drive,
    Echo,
    Frame,
    Halt,
    Hello,
    Ident,
    Nak,
    NakCode,
    Odom,
    Pattern,
    Release,
    RobotFrame,
)
from drivers.denning.robot import DenningRobot
from drivers.driver import LineState, RobotDriver
from drivers.firing import FiringError
from drivers.messages import Flags, LinkCounts, Pose, Twist
from tests.drivers.vectors import OCTETS

CONFIG = RobotConfig(
    ring=RingConfig(
        count=24,
        radius_m=0.381,
        beam_half_angle_deg=12.0,
        resolution_m=0.03048,
        range_min_m=0.1524,
        range_max_m=7.7724,
        firing=FiringConfig(preset="octets"),
    ),
    body=BodyConfig(radius_m=0.4, speed_max_m_s=0.6, turn_max_rad_s=1.0, synchro=True),
    link=LinkConfig(port="/dev/robot"),
)
IDENT = Ident(0, 1, 24, 381, 500, 20, 0xB001, "denning")
ODOM = Odom(0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
PERIOD_US = 20_000


class Bench:
    """A robot driver and, on the other side, a device whose every word the test says."""

    def __init__(self, config: RobotConfig = CONFIG) -> None:
        self.robot = DenningRobot(config)
        self.now = 100.0
        self.ident = IDENT
        self.last_drive = 0
        self._ears = Decoder("host")
        self._seq = 0

    def open(self) -> None:
        self._ears = Decoder("host")
        self.robot.opened(self.now)

    def state(self) -> LineState:
        return self.robot.state

    def heard(self, *, writable: bool = True) -> list[Frame]:
        """What the device hears now."""
        return self._ears.feed(self.robot.outgoing(writable=writable))

    @property
    def device_lost(self) -> int:
        return self._ears.lost + self._ears.bad

    def say(self, *frames: RobotFrame) -> None:
        for frame in frames:
            self.robot.receive(encode(replace(frame, seq=self._seq)), self.now)
            self._seq = (self._seq + 1) % 256

    def pass_time(self, seconds: float) -> None:
        self.now += seconds
        self.robot.tick(self.now)

    def answer(self) -> list[Frame]:
        """Answer as a good device does; return what it heard."""
        heard = self.heard()
        for frame in heard:
            match frame:
                case Hello():
                    self.say(self.ident)
                case Pattern() | Halt() | Release():
                    self.say(Ack(0, frame.seq))
                case _:
                    pass
        return heard

    def greet(self) -> None:
        for _ in range(2):
            self.answer()
        assert self.state() is LineState.READY

    def odom(self, t_us: int, **fields: int) -> None:
        self.say(replace(ODOM, t_us=t_us % 2**32, **fields))

    def run(self, seconds: float, *, t_us: int) -> int:
        """Let a good device drive on, odometry and all; return its clock."""
        for _ in range(round(seconds / 0.02)):
            t_us += PERIOD_US
            self.now += 0.02
            self.odom(t_us)
            self.robot.tick(self.now)
            self.answer()
        return t_us


@pytest.fixture
def bench() -> Bench:
    ready = Bench()
    ready.open()
    ready.greet()
    return ready


def only(frames: list[Frame], kind: type[Frame]) -> list[Frame]:
    return [frame for frame in frames if isinstance(frame, kind)]


def test_it_is_a_robot_driver() -> None:
    driver: RobotDriver = DenningRobot(CONFIG)
    assert driver.state is LineState.CLOSED
    assert driver.outgoing(writable=True) == b""


def test_greeting_then_pattern_then_ready() -> None:
    bench = Bench()
    bench.open()
    assert bench.state() is LineState.GREETING
    first = bench.robot.outgoing(writable=True)
    assert first[0] == 0, "a zero ends what an earlier user left half said"
    assert Decoder("host").feed(first) == [Hello(0, 1)]
    assert bench.heard() == []
    bench.say(IDENT)
    assert bench.state() is LineState.GREETING
    assert bench.heard() == [Pattern(1, 50, 255, OCTETS)]
    bench.say(Ack(0, 1))
    assert bench.state() is LineState.READY
    assert bench.robot.trouble is None
    identity = bench.robot.identity
    assert identity is not None
    assert (identity.name, identity.sensors, identity.boot_id) == ("denning", 24, 0xB001)
    assert (identity.ring_radius_m, identity.deadman_s, identity.odometry_period_s) == pytest.approx(
        (0.381, 0.5, 0.02)
    )
    assert bench.robot.counts == LinkCounts(frames=2)
    assert not bench.robot.take().rebooted


def test_what_comes_before_the_greeting_is_done_is_not_used() -> None:
    bench = Bench()
    bench.open()
    bench.odom(1_000_000)
    assert bench.robot.take().odometry is None, "whose odometry?"
    bench.heard()
    bench.say(IDENT)
    bench.odom(1_020_000)
    bench.say(Echo(0, 1_020_000, 0, 1, (10,)))
    bench.greet()
    bench.odom(1_040_000)
    heard = bench.robot.take()
    assert heard.odometry is not None
    assert heard.firings == (), "a firing of an earlier pattern"


def test_an_unanswered_command_is_sent_three_times_with_numbers_of_their_own() -> None:
    bench = Bench()
    bench.open()
    sent = []
    for _ in range(31):
        sent += bench.heard()
        bench.pass_time(0.01)
    assert sent == [Hello(0), Hello(1), Hello(2)]
    assert bench.device_lost == 0
    assert bench.state() is LineState.DOWN
    assert "left 3 HELLO unanswered and nothing comes from it" in (bench.robot.trouble or "")


def test_a_lost_ack_is_made_good_by_the_next_and_a_late_one_counts() -> None:
    bench = Bench()
    bench.open()
    bench.answer()
    (pattern,) = bench.heard()
    bench.pass_time(0.11)
    (again,) = bench.heard()
    assert isinstance(again, Pattern)
    assert again.masks == OCTETS
    assert again.seq != pattern.seq
    bench.say(Ack(0, pattern.seq))
    assert bench.state() is LineState.READY
    bench.say(Ack(0, again.seq))
    assert bench.state() is LineState.READY
    assert bench.robot.trouble is None


def test_a_robot_that_comes_back_is_taken_up_at_a_modest_pace() -> None:
    bench = Bench()
    bench.open()
    hellos = 0
    for _ in range(1000):
        hellos += len(only(bench.heard(), Hello))
        bench.pass_time(0.01)
    assert bench.state() is LineState.DOWN
    assert 15 <= hellos <= 30
    while not only(heard := bench.heard(), Hello):
        bench.pass_time(0.01)
    assert len(heard) == 1
    bench.say(IDENT)
    assert bench.state() is LineState.GREETING
    assert bench.robot.trouble is not None, "still says why it took so long"
    bench.answer()
    assert bench.state() is LineState.READY
    assert bench.robot.trouble is None


@pytest.mark.parametrize(
    ("ident", "text"),
    [
        (replace(IDENT, version=2), "speaks version 2"),
        (replace(IDENT, sensors=16), "has 16 sensors and the robot file 24"),
        (replace(IDENT, ring_radius_mm=383), r"a radius of 0\.383 m and the robot file says 0\.381 m"),
    ],
)
def test_another_robot_than_expected_is_not_driven(ident: Ident, text: str) -> None:
    bench = Bench()
    bench.ident = ident
    bench.open()
    bench.answer()
    assert bench.state() is LineState.DOWN
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(bench.robot.trouble)
    bench.robot.drive(Twist(0.1, 0.0))
    assert bench.heard() == []
    bench.ident = replace(IDENT, ring_radius_mm=382)
    bench.pass_time(0.6)
    bench.greet()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (NakCode.VALUE_OUT_OF_RANGE, "NAK 3.*: a value is out of its range; make ring.firing.step_period_s longer"),
        (NakCode.UNKNOWN_TYPE, "NAK 1.* does not know this command; check .* same version"),
        (99, "NAK 99.* a reason this program does not know"),
    ],
)
def test_a_refused_pattern_is_trouble(code: int, text: str) -> None:
    bench = Bench()
    bench.open()
    bench.answer()
    (pattern,) = bench.heard()
    bench.say(Nak(0, pattern.seq, code))
    assert bench.state() is LineState.DOWN
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(bench.robot.trouble)


def test_the_newest_drive_wins_and_is_held_to_the_limits_of_the_body(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.2))
    bench.robot.drive(Twist(0.3054, -0.25))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, -250)
    assert bench.heard() == []
    bench.robot.drive(Twist(1e9, -1e9))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (600, -1000)


def test_a_limit_is_not_passed_by_rounding() -> None:
    body = CONFIG.body.model_copy(update={"speed_max_m_s": 0.3057, "turn_max_rad_s": 40.0})
    bench = Bench(CONFIG.model_copy(update={"body": body}))
    bench.open()
    bench.greet()
    bench.robot.drive(Twist(0.3057, 39.0))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, 32767)


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.0, math.inf)])
def test_a_velocity_that_is_none_is_refused(bench: Bench, twist: Twist) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        bench.robot.drive(twist)
    assert bench.heard() == []


def test_a_stalled_line_takes_only_halt(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.0))
    bench.robot.release()
    assert bench.heard(writable=False) == []
    bench.robot.halt()
    (halt,) = bench.heard(writable=False)
    assert isinstance(halt, Halt)


def test_the_drive_that_waited_for_the_line_is_the_newest(bench: Bench) -> None:
    for v in (0.1, 0.2, 0.3):
        bench.robot.drive(Twist(v, 0.0))
        assert bench.heard(writable=False) == []
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert drive.v_mm_s == 300


def test_halt_goes_first_and_drops_what_was_asked_before(bench: Bench) -> None:
    bench.robot.release()
    bench.robot.drive(Twist(0.1, 0.0))
    bench.robot.halt()
    heard = bench.heard()
    assert [type(frame) for frame in heard] == [Halt]
    bench.robot.drive(Twist(0.1, 0.0))
    assert bench.heard() == [], "nothing drives past a HALT that may not have been heard"
    bench.say(Ack(0, heard[0].seq))
    bench.robot.drive(Twist(0.1, 0.0))
    assert [type(frame) for frame in bench.heard()] == [Drive]


def test_halt_goes_before_the_greeting() -> None:
    bench = Bench()
    bench.robot.halt()
    bench.open()
    assert [type(frame) for frame in bench.heard()] == [Halt, Hello]


def test_halt_is_repeated_until_answered_whatever_happens(bench: Bench) -> None:
    bench.robot.halt()
    halts = 0
    for _ in range(100):
        bench.robot.halt()
        halts += len(only(bench.heard(), Halt))
        bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert 15 <= halts <= 25, "and not once a cycle"
    bench.robot.closed()
    bench.open()
    heard = bench.answer()
    assert [type(frame) for frame in heard] == [Halt, Hello]
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    bench.pass_time(0.3)
    assert bench.heard() == []
    assert bench.state() is LineState.READY


def test_a_robot_that_answers_all_but_halt_is_down() -> None:
    bench = Bench()
    bench.robot.halt()
    bench.open()
    bench.heard()
    bench.say(IDENT)
    (pattern,) = only(bench.heard(), Pattern)
    bench.say(Ack(0, pattern.seq))
    assert bench.state() is LineState.READY
    for _ in range(20):
        bench.heard()
        bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert "left 3 HALT unanswered although it can be heard" in (bench.robot.trouble or "")


def test_release_clears_a_pending_halt_and_waits_for_nobody(bench: Bench) -> None:
    bench.robot.halt()
    bench.heard()
    bench.robot.release()
    heard = bench.answer()
    assert [type(frame) for frame in heard] == [Release]
    bench.pass_time(0.2)
    assert bench.heard() == []
    bench.robot.closed()
    bench.robot.release()
    bench.open()
    assert [type(frame) for frame in bench.answer()] == [Hello], "a release is not kept for later"


def test_while_latched_a_refused_drive_is_no_trouble(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.0))
    (drive,) = bench.heard()
    bench.say(Nak(0, drive.seq, NakCode.LATCHED))
    assert (bench.state(), bench.robot.trouble) == (LineState.READY, None)
    bench.robot.drive(Twist(0.1, 0.0))
    (drive,) = bench.heard()
    bench.say(Nak(0, drive.seq, NakCode.VALUE_OUT_OF_RANGE))
    assert bench.state() is LineState.READY
    assert "refuses DRIVE (NAK 3)" in (bench.robot.trouble or "")
    assert "body.speed_max_m_s" in (bench.robot.trouble or "")
    bench.robot.release()
    bench.answer()
    assert bench.robot.trouble is None


def test_a_refused_release_is_told_and_not_repeated(bench: Bench) -> None:
    bench.robot.release()
    (release,) = bench.heard()
    bench.say(Nak(0, release.seq, NakCode.LATCHED))
    assert bench.state() is LineState.READY
    assert "refuses RELEASE (NAK 4): it is latched; remove what holds it" in (bench.robot.trouble or "")
    bench.pass_time(0.2)
    assert bench.heard() == []


def test_odometry_in_si(bench: Bench) -> None:
    bench.odom(
        1_000_000,
        x_0p1mm=12345,
        y_0p1mm=-6789,
        heading_1em4rad=70000,
        ring_yaw_1em4rad=-100,
        v_mm_s=305,
        w_mrad_s=-250,
        flags=0b11001,
        last_drive_seq=9,
    )
    odometry = bench.robot.take().odometry
    assert odometry is not None
    assert odometry.t_s == pytest.approx(1.0)
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.theta) == pytest.approx((1.2345, -0.6789, 7.0))
    assert (odometry.ring_yaw, odometry.twist.v, odometry.twist.w) == pytest.approx((-0.01, 0.305, -0.25))
    assert odometry.flags == Flags.LATCHED | Flags.DEADMAN | Flags.BATTERY_LOW
    assert odometry.last_drive_seq == 9
    assert bench.robot.take().odometry is None


def test_a_firing_has_the_pose_of_its_own_moment(bench: Bench) -> None:
    # A quarter of a circle of radius 0.1 m around (0, 0.1); the ring does something else.
    for t_us, x, y, heading in ((0, 0, 0, 0), (PERIOD_US, 1000, 1000, 15708)):
        bench.odom(t_us, x_0p1mm=x, y_0p1mm=y, heading_1em4rad=heading, ring_yaw_1em4rad=2000 + t_us // 100)
    bench.say(Echo(0, PERIOD_US // 2, 0, 0x800021, (30, 255, 0)))
    (firing,) = bench.robot.take().firings
    assert firing.t_s == pytest.approx(0.01)
    assert (firing.pose.x, firing.pose.y, firing.pose.theta) == pytest.approx(
        (0.1 * math.sqrt(0.5), 0.1 - 0.1 * math.sqrt(0.5), math.pi / 4), abs=1e-4
    )
    assert firing.ring_yaw == pytest.approx(0.21)
    assert firing.ranges_m.shape == (24,)
    assert firing.ranges_m[0] == pytest.approx(0.9144)
    assert math.isinf(firing.ranges_m[5])
    assert np.isnan(np.delete(firing.ranges_m, [0, 5])).all()


def test_an_echo_before_its_odometry_is_held_and_keeps_its_turn(bench: Bench) -> None:
    bench.odom(0)
    bench.say(Echo(0, 10_000, 0, 1, (10,)), Echo(0, 30_000, 1, 1, (20,)))
    assert bench.robot.take().firings == ()
    bench.odom(PERIOD_US, x_0p1mm=100)
    (first,) = bench.robot.take().firings
    assert first.pose.x == pytest.approx(0.005)
    bench.odom(2 * PERIOD_US, x_0p1mm=300)
    (second,) = bench.robot.take().firings
    assert second.pose.x == pytest.approx(0.02)
    assert bench.robot.late_echoes == 0


def test_one_chunk_or_byte_by_byte_is_the_same(bench: Bench) -> None:
    frames: list[RobotFrame] = [
        replace(ODOM, t_us=0),
        Echo(0, 10_000, 0, 1, (10,)),
        replace(ODOM, t_us=PERIOD_US, x_0p1mm=7),
        Echo(0, 15_000, 1, 2, (11,)),
    ]
    data = b"".join(encode(replace(frame, seq=2 + k)) for k, frame in enumerate(frames))
    other = Bench()
    other.open()
    other.greet()
    bench.robot.receive(data, bench.now)
    for i in range(len(data)):
        other.robot.receive(data[i : i + 1], other.now)
    whole, single = bench.robot.take(), other.robot.take()
    assert [(f.t_s, f.pose, f.ring_yaw) for f in whole.firings] == [
        (f.t_s, f.pose, f.ring_yaw) for f in single.firings
    ]
    assert len(whole.firings) == 2
    assert whole.odometry == single.odometry
    assert bench.robot.counts == other.robot.counts == LinkCounts(frames=6)


def test_an_echo_that_nothing_places_is_dropped_and_counted(bench: Bench) -> None:
    bench.odom(1_000_000)
    bench.say(Echo(0, 990_000, 0, 1, (10,)))
    assert bench.robot.late_echoes == 1, "older than the history"
    bench.say(Echo(0, 1_040_000, 0, 1, (10,)))
    bench.odom(1_100_000)
    assert bench.robot.late_echoes == 2, "between two samples too far apart"
    bench.say(Echo(0, 1_100_000, 0, 1, (10,)), Echo(0, 1_090_000, 0, 1, (10,)), Echo(0, 9_000_000, 0, 1, (10,)))
    assert bench.robot.late_echoes == 4, "before the one before it, and from a far future"
    assert [f.t_s for f in bench.robot.take().firings] == pytest.approx([1.1])


@pytest.mark.promise("P8")
def test_late_doubled_and_out_of_window_echoes_go_no_further(measured: Callable[[str], None]) -> None:
    """Every echo once more, once late, and ranges beyond the window in between."""
    window = 50
    near = CONFIG.ring.model_copy(
        update={"firing": FiringConfig(preset="octets", window_m=window * 0.03048, step_period_s=0.02)}
    )
    bench = Bench(CONFIG.model_copy(update={"ring": near}))
    bench.open()
    bench.greet()
    good: list[Echo] = []
    t_us = 0
    bench.odom(t_us)
    for k in range(200):
        t_us += PERIOD_US
        mask = OCTETS[k % 3]
        tenths = tuple(window + 1 + k if (i + k) % 4 == 0 else 255 if i % 3 else window - i for i in range(8))
        echo = Echo(0, t_us - 5_000, k % 3, mask, tuple(min(t, 254) if t != 255 else 255 for t in tenths))
        bench.now += 0.02
        bench.odom(t_us)
        bench.say(echo, echo)
        if good:
            bench.say(good[-1])
        good.append(echo)
    firings = bench.robot.take().firings
    assert [f.t_s for f in firings] == pytest.approx([1e-6 * echo.t_us for echo in good])
    for firing in firings:
        heard = firing.ranges_m[np.isfinite(firing.ranges_m)]
        assert (heard <= window * 0.03048 + 1e-9).all()
        assert heard.size + np.isinf(firing.ranges_m).sum() == 6, "the others are kept"
    assert bench.robot.late_echoes == 200 + 199
    assert bench.robot.out_of_window == (200 + 200 + 199) * 2
    measured(
        f"200 firings, each echo twice and once late, a quarter of the ranges beyond the window: {len(firings)} "
        f"firings and 0 such ranges came through"
    )


def test_a_wider_window_counts_from_the_pattern_on_and_a_narrower_one_after_it(bench: Bench) -> None:
    t_us = bench.run(0.4, t_us=0)
    far = Echo(0, t_us - 5_000, 0, OCTETS[0], (200,) * 8)
    narrow = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="octets", window_m=2.0)})
    bench.robot.set_firing(narrow)
    bench.say(far)
    assert np.isfinite(bench.robot.take().firings[-1].ranges_m).sum() == 8, "an echo of the pattern before"
    t_us = bench.run(0.4, t_us=t_us)
    bench.say(replace(far, t_us=t_us - 5_000))
    assert np.isnan(bench.robot.take().firings[-1].ranges_m).all()


@pytest.mark.promise("P9")
@pytest.mark.parametrize(("x", "heading"), [(3048, 0), (-3048, 0), (50_000, 0), (0, 5000), (3048, -20_000)])
def test_a_leap_of_the_odometry_is_taken_out_and_told(bench: Bench, x: int, heading: int) -> None:
    """Poses go on as the wheels say; the robot's own odometry is `frame` away."""
    t_us = bench.run(0.4, t_us=0)
    bench.robot.take()
    for _ in range(2):  # one that leaps very far is asked who it is, and answers
        t_us += PERIOD_US
        bench.pass_time(0.02)
        bench.odom(t_us, x_0p1mm=x, heading_1em4rad=heading, ring_yaw_1em4rad=heading)
        bench.answer()
        bench.answer()
    heard = bench.robot.take()
    assert heard.odometry is not None
    assert heard.odometry.pose == Pose(0.0, 0.0, 0.0)
    assert heard.odometry.ring_yaw == 0.0
    (note,) = heard.notes
    assert "leapt" in note
    assert "check wheels" in note
    frame = bench.robot.frame
    assert (frame.x, frame.y, frame.theta) == pytest.approx((x * 1e-4, 0.0, heading * 1e-4))
    assert not heard.rebooted


def test_a_base_that_moves_in_leaps_is_believed(bench: Bench) -> None:
    """One whose odometry comes in steps, or that is faster than its file says, does not leap: it moves so."""
    t_us = 0
    for k in range(100):
        t_us += PERIOD_US
        bench.pass_time(0.02)
        bench.odom(t_us, x_0p1mm=2000 * (k // 3))
    heard = bench.robot.take()
    assert heard.odometry is not None
    assert heard.odometry.pose.x == pytest.approx(6.6)
    assert heard.notes == ()


def test_echoes_without_odometry_do_not_pile_up(bench: Bench) -> None:
    bench.odom(0)
    for k in range(200):
        bench.say(Echo(0, 1000 + k, 0, 1, (10,)))
    assert bench.robot.late_echoes == 200 - 64
    bench.odom(PERIOD_US)
    assert len(bench.robot.take().firings) == 64


def test_a_fault_of_the_sensors_beyond_the_ring_is_passed_over() -> None:
    ring = CONFIG.ring.model_copy(update={"count": 16})
    bench = Bench(CONFIG.model_copy(update={"ring": ring}))
    bench.ident = replace(IDENT, sensors=16)
    bench.open()
    bench.greet()
    bench.odom(0)
    bench.say(Echo(0, 0, 0, 0x810000 | 1, (10, 11, 12)))
    (firing,) = bench.robot.take().firings
    assert firing.ranges_m.shape == (16,)
    assert np.nansum(firing.ranges_m) == pytest.approx(0.3048)


def test_the_clock_wraps_and_time_goes_on(bench: Bench) -> None:
    start = 2**32 - 25_000
    bench.odom(start)
    bench.pass_time(0.02)
    bench.odom(start + PERIOD_US, x_0p1mm=100)
    bench.pass_time(0.02)
    bench.odom(start + 2 * PERIOD_US, x_0p1mm=200)
    bench.say(Echo(0, start + 10_000, 0, 1, (10,)), Echo(0, (start + 30_000) % 2**32, 1, 2, (10,)))
    heard = bench.robot.take()
    assert bench.state() is LineState.READY
    assert not heard.rebooted
    assert [f.t_s - start * 1e-6 for f in heard.firings] == pytest.approx([0.01, 0.03], abs=1e-6)
    assert [f.pose.x for f in heard.firings] == pytest.approx([0.005, 0.015])
    assert heard.odometry is not None
    assert heard.odometry.t_s == pytest.approx(start * 1e-6 + 0.04)


def test_a_silence_longer_than_the_wrap_does_not_lose_the_time(bench: Bench) -> None:
    bench.odom(0)
    bench.robot.take()
    bench.robot.closed()
    bench.now += 3 * 3600.0
    bench.open()
    bench.greet()
    bench.odom(3 * 3600 * 1_000_000 + 50_000)
    heard = bench.robot.take()
    assert heard.odometry is not None
    assert heard.odometry.t_s == pytest.approx(3 * 3600.05 - 0.1, abs=0.01)
    assert not heard.rebooted


def test_silence_is_down_and_motion_does_not_resume_by_itself(bench: Bench) -> None:
    t_us = bench.run(1.0, t_us=0)
    assert bench.state() is LineState.READY
    bench.robot.drive(Twist(0.1, 0.0))
    bench.pass_time(0.39)
    assert bench.state() is LineState.READY
    bench.robot.release()
    bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert "nothing heard for 0.41 s" in (bench.robot.trouble or "")
    assert bench.heard() == []
    bench.run(1.0, t_us=t_us + 600_000)
    assert bench.state() is LineState.READY
    assert only(bench.heard(), Drive) == []


def drive_on(bench: Bench, seconds: float, t_us: int, *, deaf: bool = False, flags: int = 0) -> int:
    """Drive at 20 Hz with a robot that names the DRIVE it took last, but for the time that it is deaf."""
    last = bench.last_drive
    for _ in range(round(seconds / 0.05)):
        bench.robot.drive(Twist(0.1, 0.0))
        taken = [frame.seq for frame in bench.answer() if isinstance(frame, Drive)]
        last = last if deaf else taken[-1] if taken else last
        bench.now += 0.05
        t_us += 50_000
        bench.odom(t_us, last_drive_seq=last, flags=flags)
        bench.say(Echo(0, t_us, 0, 1, (10,)))
        bench.robot.tick(bench.now)
    bench.last_drive = last
    return t_us


def test_a_robot_that_talks_on_but_takes_no_drive_is_down(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    assert bench.state() is LineState.READY
    drive_on(bench, 0.3, t_us, deaf=True)
    assert bench.state() is LineState.READY
    drive_on(bench, 0.1, t_us + 300_000, deaf=True)
    assert bench.state() is LineState.DOWN
    assert "can be heard and has not taken a DRIVE for 0.35 s" in (bench.robot.trouble or "")
    assert "check the cable" in (bench.robot.trouble or "")


def test_a_robot_that_never_names_the_drive_it_took_is_not_held_to_it(bench: Bench) -> None:
    drive_on(bench, 30.0, 0, deaf=True)
    assert bench.state() is LineState.READY


def test_a_latched_robot_takes_no_drive_and_that_is_no_trouble(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    drive_on(bench, 2.0, t_us, deaf=True, flags=1)
    assert bench.state() is LineState.READY


def test_lost_frames_are_no_deafness(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    for _ in range(20):
        t_us = drive_on(bench, 0.25, t_us, deaf=True)
        t_us = drive_on(bench, 0.05, t_us)
    assert bench.state() is LineState.READY


@pytest.mark.parametrize("boot_id", [IDENT.boot_id, 0xB002])
def test_a_robot_whose_ring_has_fallen_silent_is_asked_who_it_is(bench: Bench, boot_id: int) -> None:
    """A restart just as the clock wraps shows in nothing but that: the pattern is gone, and the odometry goes on."""
    t_us = bench.run(0.45, t_us=2**32 - 500_000)
    bench.robot.take()
    bench.ident = replace(IDENT, boot_id=boot_id)
    heard: list[Frame] = []
    for _ in range(10):
        t_us += PERIOD_US
        bench.now += 0.02
        bench.odom(t_us)
        bench.robot.tick(bench.now)
        heard += bench.answer()
    heard += bench.answer()
    restarted = boot_id != IDENT.boot_id
    assert [type(frame) for frame in heard] == ([Hello, Pattern] if restarted else [Hello])
    assert bench.robot.take().rebooted == restarted
    assert bench.state() is LineState.READY
    assert bench.robot.trouble is None


def test_a_silent_ring_is_asked_about_at_a_modest_pace(bench: Bench) -> None:
    hellos, t_us = 0, 0
    for _ in range(500):
        t_us += PERIOD_US
        bench.now += 0.02
        bench.odom(t_us)
        bench.robot.tick(bench.now)
        hellos += len(only(bench.heard(), Hello))
    assert bench.state() is LineState.READY, "nobody need answer"
    assert 15 <= hellos <= 20


def test_missing_odometry_alone_is_down_too(bench: Bench) -> None:
    for _ in range(30):
        bench.pass_time(0.02)
        bench.say(Echo(0, 5, 0, 1, (10,)))
    assert bench.state() is LineState.DOWN
    assert "no odometry" in (bench.robot.trouble or "")


def test_an_echo_just_after_the_last_odometry_does_not_make_it_a_robot_that_talks(bench: Bench) -> None:
    t_us = bench.run(0.2, t_us=0)
    bench.pass_time(0.01)
    bench.say(Echo(0, t_us, 0, 1, (10,)))
    bench.pass_time(0.4)
    assert bench.state() is LineState.DOWN
    assert "nothing heard" in (bench.robot.trouble or "")


def test_a_restart_between_two_lines_is_noticed(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.say(Echo(0, 5_000_000, 0, 1, (10,)))
    bench.robot.closed()
    assert bench.state() is LineState.CLOSED
    bench.now += 1.0
    bench.ident = replace(IDENT, boot_id=0xB002)
    bench.open()
    bench.odom(20_000)
    bench.greet()
    heard = bench.robot.take()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    bench.odom(40_000)
    heard = bench.robot.take()
    assert not heard.rebooted
    assert heard.odometry is not None
    assert heard.odometry.t_s == pytest.approx(0.04)


@pytest.mark.parametrize("boot_id", [0xB002, IDENT.boot_id])
def test_a_restart_in_mid_run_is_noticed_by_the_clock(bench: Bench, boot_id: int) -> None:
    bench.run(2.0, t_us=3_000_000)
    bench.say(Echo(0, 5_000_000, 0, 1, (10,)))
    bench.robot.drive(Twist(0.1, 0.0))
    bench.ident = replace(IDENT, boot_id=boot_id)
    bench.pass_time(0.2)
    bench.odom(20_000, x_0p1mm=5)
    assert bench.state() is LineState.GREETING
    bench.odom(40_000, x_0p1mm=6)
    assert [type(frame) for frame in bench.answer()] == [Hello]
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    assert bench.state() is LineState.READY
    heard = bench.robot.take()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    bench.odom(60_000, x_0p1mm=7)
    bench.odom(80_000, x_0p1mm=9)
    bench.say(Echo(0, 70_000, 0, 1, (10,)))
    (firing,) = bench.robot.take().firings
    assert (firing.t_s, firing.pose.x) == pytest.approx((0.07, 0.0008))


def test_a_restart_that_announces_itself_is_noticed(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.robot.drive(Twist(0.1, 0.0))
    bench.say(replace(IDENT, boot_id=0xB002))
    assert bench.state() is LineState.GREETING
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    assert bench.robot.take().rebooted


def test_a_second_answer_to_the_greeting_changes_nothing(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.say(IDENT)
    assert bench.state() is LineState.READY
    assert bench.heard() == []
    assert not bench.robot.take().rebooted


@pytest.mark.parametrize(("t_us", "x"), [(9_000_000, 0), (1_020_000, 50_000)])
def test_a_clock_or_pose_that_leaps_is_asked_about_and_not_joined_to_the_past(
    bench: Bench, t_us: int, x: int
) -> None:
    bench.odom(1_000_000)
    bench.pass_time(0.02)
    bench.odom(t_us, x_0p1mm=x)
    assert bench.state() is LineState.GREETING
    bench.greet()
    assert not bench.robot.take().rebooted
    bench.odom(t_us + PERIOD_US, x_0p1mm=x)
    assert bench.state() is LineState.READY
    bench.say(Echo(0, t_us + 10_000, 0, 1, (10,)))
    heard = bench.robot.take()
    assert heard.firings == (), "nothing tells where that was"
    assert heard.odometry is not None
    assert heard.odometry.pose == Pose(x * 1e-4, 0.0, 0.0)
    assert bench.robot.late_echoes == 1


def test_counts_go_on_over_lines(bench: Bench) -> None:
    bench.say(ODOM)
    bench.robot.receive(b"\x01\x02\x03\0", bench.now)
    bench.robot.receive(encode(replace(ODOM, seq=6)), bench.now)
    assert bench.robot.counts == LinkCounts(frames=4, bad=1, lost=3)
    bench.robot.closed()
    bench.robot.receive(encode(ODOM), bench.now)
    bench.open()
    bench.greet()
    assert bench.robot.counts == LinkCounts(frames=6, bad=1, lost=3)


def test_noise_instead_of_an_answer_points_at_the_baud_rate() -> None:
    bench = Bench()
    bench.open()
    for _ in range(40):
        bench.heard()
        bench.robot.receive(b"\x9f\x33\0", bench.now)
        bench.pass_time(0.01)
    assert "likely the baud rate" in (bench.robot.trouble or "")


@pytest.mark.parametrize(
    ("broken", "told"), [(1, "nothing heard for 0.41 s"), (9, "9 broken frames came in place of it: noise")]
)
def test_noise_in_place_of_odometry_is_named_and_one_broken_frame_is_not(
    bench: Bench, broken: int, told: str
) -> None:
    bench.robot.receive(b"\x9f\x33\0" * broken, bench.now)
    bench.pass_time(0.41)
    assert bench.state() is LineState.DOWN
    assert told in (bench.robot.trouble or "")


def test_noise_in_place_of_echoes_is_named_once_they_are_overdue(bench: Bench) -> None:
    for k in range(30):
        bench.odom(k * PERIOD_US)
        bench.robot.receive(b"\x9f\x33\0" * (k % 2), bench.now)
        bench.pass_time(0.02)
        assert bench.robot.trouble is None or k > 20
    assert "broken frames came in place of its echoes: noise" in (bench.robot.trouble or "")
    bench.say(Echo(0, 29 * PERIOD_US, 0, 1, (10,)))
    assert bench.robot.trouble is None


def test_firings_nobody_takes_do_not_pile_up(bench: Bench) -> None:
    for k in range(1100):
        bench.odom(k * PERIOD_US)
        bench.say(Echo(0, k * PERIOD_US, 0, 1, (10,)))
        bench.now += 0.02
    firings = bench.robot.take().firings
    assert len(firings) == 1024
    assert firings[-1].t_s == pytest.approx(1099 * 0.02)


def test_another_firing_pattern_while_it_drives(bench: Bench) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    bench.robot.set_firing(CONFIG.ring)
    assert bench.heard() == [], "the one under way is not said again"
    bench.robot.set_firing(ring)
    (pattern,) = only(bench.answer(), Pattern)
    assert isinstance(pattern, Pattern)
    assert (len(pattern.masks), pattern.step_period_ms) == (6, 60)
    assert bench.state() is LineState.READY
    bench.robot.closed()
    bench.open()
    (again,) = only([*bench.answer(), *bench.answer()], Pattern)
    assert replace(again, seq=pattern.seq) == pattern, "kept for the next line"


def test_another_firing_pattern_before_the_first_is_taken() -> None:
    """An answer to the first must not pass for one to the second."""
    bench = Bench()
    bench.open()
    bench.answer()
    (first,) = only(bench.heard(), Pattern)
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    bench.robot.set_firing(ring)
    bench.say(Ack(0, first.seq))
    assert bench.state() is LineState.GREETING
    assert len(only(bench.answer(), Pattern)) == 1
    assert bench.state() is LineState.READY


def test_a_firing_pattern_that_cannot_be(bench: Bench) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(sets=((40,),))})
    with pytest.raises(FiringError):
        bench.robot.set_firing(ring)
    assert bench.heard() == []
    assert bench.state() is LineState.READY

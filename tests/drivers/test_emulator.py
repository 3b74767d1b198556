"""The emulated robot keeps the protocol to the letter, in its own time, and the same way every time."""

from __future__ import annotations

import binascii
import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from config.files import ConfigError
from config.robot import BodyConfig, LinkConfig, RingConfig, RobotConfig
from config.world import AcousticsConfig, DrumConfig, OdometryConfig, StartConfig, WallConfig, WorldConfig
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
)
from drivers.driver import Heard, LineState
from drivers.emulator.device import EmulatedRobot
from drivers.emulator.faults import Fault, FaultScript, load_faults
from drivers.emulator.memory import MemoryLine
from drivers.emulator.uart import QUEUE_MAX, Uart
from drivers.messages import Flags, Identity, LinkCounts, Pose, Twist

F = TypeVar("F", bound=Frame)
OCTETS = tuple(0b1_0000_0001_0000_0001 << k for k in range(8))
ALL = (1 << 24) - 1


def robot_config(baud: int = 115200, **body: Any) -> RobotConfig:
    return RobotConfig(
        ring=RingConfig(
            count=24,
            radius_m=0.381,
            beam_half_angle_deg=12.0,
            resolution_m=0.03048,
            range_min_m=0.1524,
            range_max_m=7.7724,
        ),
        body=BodyConfig(**{"radius_m": 0.381, "speed_max_m_s": 0.6, "turn_max_rad_s": 1.5} | body),
        link=LinkConfig(baud=baud),
    )


WORLD = WorldConfig(
    drum=(DrumConfig(x_m=2.0, y_m=1.2, radius_m=0.3048), DrumConfig(x_m=0.0, y_m=-2.0, radius_m=0.3048)),
    wall=(WallConfig(x1_m=4.0, y1_m=-4.0, x2_m=4.0, y2_m=4.0),),
    start=StartConfig(x_m=0.5, y_m=0.0),
    acoustics=AcousticsConfig(noise_m=0.01, dropout=0.05, outliers=0.02, crosstalk=0.3),
    odometry=OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=0.01),
)


class Host:
    """A host's end that writes down everything with the time it came."""

    def __init__(self, robot: EmulatedRobot) -> None:
        self.robot = robot
        self.now = 0.0
        self.decoder = Decoder("robot")
        self.heard: list[tuple[float, Frame]] = []
        self.raw = bytearray()
        self._seq = itertools.count()

    def send(self, make: Any, *fields: Any) -> int:
        seq = next(self._seq) % 256
        self.robot.receive(encode(make(seq, *fields)))
        return seq

    def run(self, seconds: float, step: float = 0.001, drive: tuple[int, int] | None = None) -> None:
        until = self.now + seconds
        last_drive = -math.inf
        while self.now < until - 1e-9:
            if drive is not None and self.now - last_drive >= 0.1:
                self.send(Drive, *drive)
                last_drive = self.now
            self.now = min(until, self.now + step)
            data = self.robot.advance(self.now)
            self.raw += data
            self.heard += [(self.now, frame) for frame in self.decoder.feed(data)]

    def of(self, kind: type[F]) -> list[F]:
        return [frame for _, frame in self.heard if isinstance(frame, kind)]

    def last(self, kind: type[F]) -> F:
        return self.of(kind)[-1]

    def flags(self) -> Flags:
        """As last reported."""
        return Flags(self.last(Odom).flags)

    def flags_now(self) -> Flags:
        return self.robot.flags


def host(world: WorldConfig = WORLD, faults: Sequence[Fault] = (), seed: int = 1, **more: Any) -> Host:
    baud = more.pop("baud", 115200)
    clock_start_us = more.pop("clock_start_us", 0)
    robot = EmulatedRobot(robot_config(baud, **more), world, seed, faults=faults, clock_start_us=clock_start_us)
    return Host(robot)


def script(**fault: Any) -> tuple[Fault, ...]:
    return FaultScript.model_validate({"fault": [fault]}).fault


# Conversation.


def test_hello_is_answered_with_who_it_is() -> None:
    h = host()
    h.send(Hello, 1)
    h.run(0.01)
    assert h.of(Ident) == [Ident(0, 1, 24, 381, 500, 20, h.robot.boot_id, "denning")]


def test_unknown_version_is_refused() -> None:
    h = host()
    seq = h.send(Hello, 2)
    h.run(0.01)
    assert [(n.of, n.code) for n in h.of(Nak)] == [(seq, NakCode.VALUE_OUT_OF_RANGE)]


def test_commands_are_acknowledged_by_their_number_and_drive_is_not() -> None:
    h = host()
    expected = [h.send(Pattern, 50, 255, OCTETS), h.send(Halt), h.send(Release)]
    h.send(Drive, 100, 0)
    h.run(0.02)
    assert [a.of for a in h.of(Ack)] == expected
    assert h.of(Nak) == []


def test_nonsense_is_refused_with_its_reason() -> None:
    h = host()

    def raw(kind: int, seq: int, payload: bytes) -> bytes:
        body = bytes((kind, seq)) + payload
        return bytes(cobs.encode(body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "little"))) + b"\0"

    h.robot.receive(raw(0x55, 7, b"") + raw(0x11, 8, b"x") + raw(0x02, 9, bytes((0, 50, 0, 4))))
    h.run(0.02)
    assert [(n.of, n.code) for n in h.of(Nak)] == [(7, 1), (8, 2), (9, 3)]


@pytest.mark.parametrize(
    ("period_ms", "window", "masks", "good"),
    [
        (46, 255, (1,), True),
        (45, 255, (1,), False),  # 2 · 25.5 ft / 343 m/s = 45.3 ms
        (1, 5, (1,), True),
        (0, 5, (1,), False),
        (0, 5, (), True),
        (50, 255, (1 << 23,), True),
    ],
)
def test_step_shorter_than_the_sound_is_refused(
    period_ms: int, window: int, masks: tuple[int, ...], good: bool
) -> None:
    h = host()
    h.send(Pattern, period_ms, window, masks)
    h.run(0.01)
    assert len(h.of(Ack)) == good
    assert [n.code for n in h.of(Nak)] == ([] if good else [NakCode.VALUE_OUT_OF_RANGE])


def test_mask_beyond_the_ring_is_refused() -> None:
    config = robot_config()
    small = config.model_copy(update={"ring": config.ring.model_copy(update={"count": 8})})
    h = Host(EmulatedRobot(small, WORLD, 1))
    h.send(Pattern, 50, 255, (1 << 8,))
    h.run(0.01)
    assert h.last(Nak).code == NakCode.VALUE_OUT_OF_RANGE


def test_ring_too_large_for_the_protocol_is_an_error() -> None:
    config = robot_config()
    large = config.model_copy(update={"ring": config.ring.model_copy(update={"count": 25})})
    with pytest.raises(ValueError, match="25 sensors"):
        EmulatedRobot(large, WORLD, 1)


def test_sequence_numbers_run_on() -> None:
    h = host()
    h.send(Hello, 1)
    h.run(7.0)
    assert [f.seq for _, f in h.heard] == [k % 256 for k in range(len(h.heard))]
    assert len(h.heard) > 300


# Odometry.


def test_odometry_comes_every_period_also_when_still() -> None:
    h = host()
    h.run(1.0)
    assert [o.t_us for o in h.of(Odom)] == list(range(20_000, 1_000_000, 20_000))
    assert {(o.x_0p1mm, o.y_0p1mm, o.heading_1em4rad) for o in h.of(Odom)} == {(0, 0, 0)}


def test_clock_wraps() -> None:
    h = host(clock_start_us=2**32 - 50_000)
    h.run(0.2)
    times = [o.t_us for o in h.of(Odom)]
    assert times[:4] == [2**32 - 30_000, 2**32 - 10_000, 10_000, 30_000]


def test_odometry_follows_the_truth() -> None:
    h = host(WorldConfig(start=StartConfig(x_m=1.0, y_m=2.0, heading_deg=90.0)), synchro=True)
    h.run(3.0, drive=(300, 200))
    truth, odom = h.robot.truth, h.last(Odom)
    assert odom.x_0p1mm * 1e-4 == pytest.approx(truth.pose.y - 2.0, abs=0.01)
    assert odom.y_0p1mm * 1e-4 == pytest.approx(1.0 - truth.pose.x, abs=0.01)
    assert odom.heading_1em4rad * 1e-4 == pytest.approx(truth.pose.theta - math.pi / 2, abs=0.01)
    assert odom.ring_yaw_1em4rad == 0
    assert truth.ring_yaw == pytest.approx(math.pi / 2)
    assert (odom.v_mm_s, odom.w_mrad_s) == (300, 200)


# Firing.


def test_steps_come_at_their_times_and_after_their_windows() -> None:
    h = host()
    h.send(Pattern, 50, 255, OCTETS)
    h.run(1.0)
    fired = h.of(Echo)
    assert [e.t_us for e in fired] == [50_000 * k for k in range(len(fired))]
    assert [e.step for e in fired] == [k % 8 for k in range(len(fired))]
    assert [e.mask for e in fired] == [OCTETS[k % 8] for k in range(len(fired))]
    for came, frame in h.heard:
        if isinstance(frame, Echo):
            after = came - frame.t_us * 1e-6
            assert 2 * 7.7724 / 343 <= after < 0.055
    assert len(fired) == 20


def test_new_pattern_waits_for_the_step_and_begins_anew() -> None:
    h = host()
    h.send(Pattern, 60, 255, OCTETS)
    h.run(0.13)
    h.send(Pattern, 50, 100, (ALL,))
    h.run(0.3)
    assert [(e.t_us, e.step, e.mask == ALL) for e in h.of(Echo)][:5] == [
        (0, 0, False),
        (60_000, 1, False),
        (120_000, 2, False),
        (180_000, 0, True),
        (230_000, 0, True),
    ]
    assert len(h.last(Echo).tenths_ft) == 24


def test_empty_pattern_stops_the_firing_at_the_step_and_another_starts_it() -> None:
    h = host()
    h.send(Pattern, 50, 255, OCTETS)
    h.run(0.12)
    h.send(Pattern, 0, 255, ())
    h.run(0.5)
    assert [e.t_us for e in h.of(Echo)] == [0, 50_000, 100_000]
    h.send(Pattern, 50, 255, OCTETS)
    h.run(0.2)
    assert [(e.t_us, e.step) for e in h.of(Echo)][3] == (620_000, 0)


def test_pattern_survives_hello_and_halt() -> None:
    h = host()
    h.send(Pattern, 50, 255, OCTETS)
    h.send(Hello, 1)
    h.send(Halt)
    h.run(0.5)
    assert [e.step for e in h.of(Echo)] == [k % 8 for k in range(10)]


def test_echo_bytes_are_tenths_of_a_foot_inside_the_window() -> None:
    world = WorldConfig(wall=(WallConfig(x1_m=3.0, y1_m=-9.0, x2_m=3.0, y2_m=9.0),))
    h = host(world)
    h.send(Pattern, 50, 255, (1 | 1 << 12,))
    h.run(0.1)
    assert h.last(Echo).tenths_ft == (round((3.0 - 0.381) / 0.03048), 255)
    h.send(Pattern, 50, 80, (1,))
    h.run(0.2)
    assert h.last(Echo).tenths_ft == (255,)


def test_near_echo_is_never_below_five() -> None:
    h = host(WorldConfig(wall=(WallConfig(x1_m=0.39, y1_m=-9.0, x2_m=0.39, y2_m=9.0),)))
    h.send(Pattern, 50, 255, (1,))
    h.run(0.1)
    assert h.last(Echo).tenths_ft == (5,)


# Safety.


def test_deadman_ramps_down_and_flags_until_the_next_drive() -> None:
    h = host(WorldConfig(), acceleration_max_m_s2=0.5)
    h.run(2.0, drive=(400, 0))
    assert h.flags() == Flags.NONE
    last = h.now
    while Flags.DEADMAN not in h.flags():
        assert h.robot.truth.twist.v > 0.3
        h.run(0.001)
    assert 0.4 <= h.now - last <= 0.53  # the last DRIVE was up to 0.1 s before, the flag comes with the next ODOM
    h.run(0.1)
    assert 0 < h.robot.truth.twist.v < 0.4, "it ramps, it does not slam"
    h.run(0.1)
    assert h.robot.truth.twist.v == 0.0
    h.run(0.05, drive=(100, 0))
    assert h.flags() == Flags.NONE
    assert h.robot.truth.twist.v > 0.0


def test_deadman_is_measured_from_the_drive() -> None:
    h = host(WorldConfig())
    h.run(0.3)
    h.send(Drive, 200, 0)
    h.run(0.499)
    assert h.flags_now() == Flags.NONE
    h.run(0.002)
    assert h.flags_now() == Flags.DEADMAN


def test_robot_never_spoken_to_has_its_deadman_tripped() -> None:
    h = host()
    h.run(0.6)
    assert h.flags() == Flags.DEADMAN


def test_halt_stops_at_once_latches_and_refuses_to_drive() -> None:
    h = host(WorldConfig(), acceleration_max_m_s2=0.2)
    h.run(4.0, drive=(600, 0))
    assert h.robot.truth.twist.v == pytest.approx(0.6)
    h.send(Halt)
    assert Flags.LATCHED in h.flags_now()
    h.run(0.11)
    assert h.robot.truth.twist == Twist(0.0, 0.0)
    h.run(0.5, drive=(600, 0))
    assert h.robot.truth.twist == Twist(0.0, 0.0)
    assert {n.code for n in h.of(Nak)} == {NakCode.LATCHED}
    assert h.flags() == Flags.LATCHED | Flags.DEADMAN, "a refused DRIVE does not hold the deadman"


def test_release_clears_the_latch_and_moves_nothing() -> None:
    h = host(WorldConfig())
    h.run(1.0, drive=(300, 0))
    h.send(Halt)
    h.send(Halt)
    h.run(0.2)
    h.send(Release)
    h.send(Release)
    h.run(0.15)
    assert h.flags_now() == Flags.NONE
    assert h.robot.truth.twist == Twist(0.0, 0.0)
    h.run(0.3, drive=(300, 0))
    assert h.robot.truth.twist.v > 0.1
    assert len(h.of(Ack)) == 4


def test_contact_latches_with_the_bumper_and_release_lets_it_back_off() -> None:
    world = WorldConfig(wall=(WallConfig(x1_m=1.0, y1_m=-2.0, x2_m=1.0, y2_m=2.0),))
    h = host(world)
    h.run(5.0, drive=(300, 0))
    assert Flags.LATCHED | Flags.BUMPER in h.flags()
    assert h.robot.truth.pose.x == pytest.approx(1.0 - 0.381, abs=1e-6)
    h.send(Release)
    h.run(0.3, drive=(300, 0))
    assert Flags.LATCHED | Flags.BUMPER in h.flags(), "pushing on is a new contact"
    assert h.robot.truth.contacts == 2
    h.send(Release)
    h.run(1.0, drive=(-300, 0))
    assert h.flags() == Flags.NONE
    assert h.robot.truth.pose.x < 0.5
    assert h.robot.truth.contacts == 2


# The line.


def test_bytes_leave_no_faster_than_the_line() -> None:
    for baud in (9600, 19200, 115200):
        h = host(baud=baud)
        h.send(Pattern, 50, 255, (ALL,))
        amounts = []
        for k in range(1, 2001):
            amounts.append(len(h.robot.advance(k * 0.001)))
            if k % 100 == 0:
                for _ in range(10):
                    h.send(Hello, 1)
        sums = [0, *itertools.accumulate(amounts)]
        for window in (1, 3, 10, 100, 1000):
            most = max(b - a for a, b in zip(sums, sums[window:], strict=False))
            assert most <= window * 0.001 * baud / 10 + 1


def test_slow_line_loses_whole_frames_and_its_numbers_tell() -> None:
    h = host(baud=9600)
    h.send(Pattern, 50, 255, (ALL,))
    h.run(10.0)
    assert h.robot.dropped > 50
    assert h.decoder.bad == 0
    assert h.decoder.lost > 0
    assert len(h.raw) == pytest.approx(9600, abs=20), "a full queue keeps the line busy"


@settings(deadline=None)
@given(
    sends=st.lists(st.tuples(st.integers(0, 3000), st.binary(min_size=1, max_size=60)), max_size=40),
    looks=st.lists(st.integers(0, 200_000), max_size=20),
    baud=st.sampled_from([300, 9600, 115200, 4_000_000]),
)
def test_transmitter_gives_the_same_bytes_however_often_one_looks(
    sends: list[tuple[int, bytes]], looks: list[int], baud: int
) -> None:
    def run(moments: list[int]) -> tuple[bytes, bytes]:
        uart, sent, got = Uart(baud), b"", b""
        at = 0
        for gap, data in sends:
            for moment in [m for m in moments if at < m <= at + gap]:
                got += uart.take(moment)
            at += gap
            got += uart.take(at)
            before = uart.dropped
            uart.send(data, at)
            sent += data if uart.dropped == before else b""
        got += uart.take(at + 1000)
        early = got
        return early, got + uart.take(at + 40_000_000) if sent else got

    often, seldom = run(sorted(looks)), run([])
    assert often == seldom


def test_transmitter_byte_times_are_exact() -> None:
    uart = Uart(115200)
    uart.send(bytes(range(10)), 1000)
    assert uart.take(1086) == b""
    assert uart.take(1087) == b"\x00"
    assert uart.empty_us == 1869
    assert uart.take(1868) == bytes(range(1, 9))
    uart.send(b"x", 1868)
    assert uart.take(1869) == b"\x09"
    assert uart.empty_us == 1955
    uart.send(bytes(QUEUE_MAX), 1869)
    assert uart.dropped == 1


# Determinism.


def long_run(seed: int, steps: Sequence[float]) -> bytes:
    h = host(seed=seed, faults=script(kind="bit_errors", at_s=1.0, duration_s=0.5, rate=0.001))
    h.send(Hello, 1)
    h.send(Pattern, 50, 255, OCTETS)
    for command in range(20):
        h.send(Drive, 300, 20 * command - 200)
        begin = h.now
        for share in [*steps, 1.0]:
            h.now = begin + 0.1 * share
            h.raw += h.robot.advance(h.now)
    return bytes(h.raw)


def test_same_seed_same_bytes() -> None:
    assert long_run(3, ()) == long_run(3, ())
    assert long_run(3, ()) != long_run(4, ())


@settings(max_examples=15, deadline=None)
@given(steps=st.lists(st.floats(0, 1), max_size=12).map(sorted))
def test_it_does_not_matter_how_time_is_cut(steps: list[float]) -> None:
    assert long_run(3, steps) == long_run(3, ())


def test_advancing_event_by_event_loses_nothing() -> None:
    h, other = host(), host()
    for each in (h, other):
        each.send(Pattern, 50, 255, OCTETS)
    got = b""
    moments: list[float] = []
    while not moments or moments[-1] < 1.0:
        moments.append(h.robot.next_event_s)
        got += h.robot.advance(moments[-1])
    assert moments == sorted(moments)
    assert got == other.robot.advance(moments[-1])


@settings(deadline=None)
@given(data=st.binary(max_size=300))
def test_any_bytes_leave_it_alive(data: bytes) -> None:
    h = host(WorldConfig())
    h.robot.receive(data + b"\0")
    h.send(Hello, 1)
    h.run(0.1, step=0.05)
    assert len(h.of(Ident)) >= 1
    assert h.decoder.bad == 0


# Faults.


def test_mute_robot_sends_nothing_and_its_numbers_go_on() -> None:
    h = host(faults=script(kind="mute", at_s=0.2, duration_s=0.3))
    h.run(1.0)
    silent = [came for came, _ in h.heard if 0.2 < came < 0.5]
    assert silent == []
    assert h.decoder.lost == 15
    assert h.decoder.bad == 0


def test_deaf_robot_hears_nothing() -> None:
    h = host(faults=script(kind="deaf", at_s=0.1, duration_s=0.1))
    h.run(0.15)
    h.send(Hello, 1)
    h.run(0.1)
    assert h.of(Ident) == []
    h.send(Hello, 1)
    h.run(0.1)
    assert len(h.of(Ident)) == 1


def test_garbage_and_bit_errors_are_noticed_and_got_over() -> None:
    for kind in ("garbage", "bit_errors"):
        h = host(faults=script(kind=kind, at_s=0.2, duration_s=1.0))
        h.run(2.0)
        assert h.decoder.bad > 0
        later = [frame for came, frame in h.heard if came > 1.3]
        assert len(later) == 35
        assert h.decoder.lost > 0


def test_reboot_forgets_everything_but_where_it_stands() -> None:
    faults = script(kind="reboot", at_s=2.0, duration_s=0.5)
    h = host(WorldConfig(), faults=faults)
    first = h.robot.boot_id
    h.send(Pattern, 50, 255, OCTETS)
    h.run(1.9, drive=(300, 0))
    h.send(Halt)
    h.run(0.6)
    assert [came for came, _ in h.heard if came > 2.01] == []
    h.send(Hello, 1)
    h.run(0.5)
    again = [frame for came, frame in h.heard if came > 2.5]
    assert [f.t_us for f in again if isinstance(f, Odom)][:2] == [20_000, 40_000]
    assert [f for f in again if isinstance(f, Echo)] == []
    assert {(f.x_0p1mm, f.flags & Flags.LATCHED) for f in again if isinstance(f, Odom)} == {(0, 0)}
    assert again[0].seq == 0
    assert h.robot.boot_id == h.last(Ident).boot_id != first
    assert h.robot.truth.pose.x > 0.3
    assert h.robot.truth.t_s == pytest.approx(3.0)


def test_moving_robot_that_reboots_stops() -> None:
    h = host(WorldConfig(), faults=script(kind="reboot", at_s=1.0, duration_s=0.3))
    h.run(1.3, drive=(300, 0))
    assert h.robot.truth.twist == Twist(0.0, 0.0)


@pytest.mark.parametrize(("kind", "flag"), [("bumper", Flags.BUMPER), ("motor_fault", Flags.MOTOR_FAULT)])
def test_bumper_and_motor_fault_latch_and_hold_while_they_last(kind: str, flag: Flags) -> None:
    h = host(WorldConfig(), faults=script(kind=kind, at_s=1.0, duration_s=0.5))
    h.run(1.2, drive=(300, 0))
    assert Flags.LATCHED | flag in h.flags()
    assert h.robot.truth.twist.v == 0.0
    h.send(Release)
    h.run(0.05)
    assert Flags.LATCHED | flag in h.flags()
    h.run(0.5)
    assert Flags.LATCHED | flag in h.flags(), "what has passed stays latched until it is released"
    h.send(Release)
    h.run(0.05)
    assert not h.flags() & (Flags.LATCHED | flag)


@pytest.mark.parametrize(("range_m", "byte"), [(None, 0), (1.0, 33), (0.0, 5), (99.0, 255)])
def test_stuck_sensor_reports_its_one_range(range_m: float | None, byte: int) -> None:
    fault: dict[str, Any] = {"kind": "stuck_sensor", "at_s": 0.0, "duration_s": 9.0, "sensor": 3}
    h = host(WorldConfig(), faults=script(**fault | ({} if range_m is None else {"range_m": range_m})))
    h.send(Pattern, 50, 255, (0b11000,))
    h.run(0.3)
    assert {e.tenths_ft for e in h.of(Echo)} == {(byte, 255)}


def test_odometry_jumps_and_the_truth_does_not() -> None:
    h = host(WorldConfig(), faults=script(kind="odometry_jump", at_s=0.1, dx_m=1.0, dy_m=-0.5, dheading_rad=0.2))
    h.run(0.3)
    odom = h.last(Odom)
    assert (odom.x_0p1mm, odom.y_0p1mm, odom.heading_1em4rad) == (10_000, -5_000, 2_000)
    assert h.robot.truth.pose.x == 0.0


def test_unplugged_robot_runs_on_and_its_bytes_are_lost() -> None:
    h = host(WorldConfig(), faults=script(kind="unplug", at_s=1.0, duration_s=1.0))
    h.run(1.5, drive=(300, 0))
    assert [h.robot.plugged] == [False]
    assert max(came for came, _ in h.heard) < 1.01
    h.send(Drive, 300, 0)
    h.run(1.0)
    assert [h.robot.plugged] == [True]
    assert h.flags() == Flags.DEADMAN, "it heard nothing and stopped"
    assert h.robot.truth.twist.v == 0.0
    assert h.decoder.lost >= 49


def test_fault_script_is_read(tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(
        '[[fault]]\nat_s = 1.0\nkind = "mute"\nduration_s = 0.5\n'
        '[[fault]]\nat_s = 2.0\nkind = "stuck_sensor"\nsensor = 3\nrange_m = 1.5\n'
    )
    mute, stuck = load_faults(path)
    assert (mute.kind, mute.at_s, mute.duration_s) == ("mute", 1.0, 0.5)
    assert stuck == script(kind="stuck_sensor", at_s=2.0, sensor=3, range_m=1.5)[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[fault]]\nat_s = 1.0\nkind = "mewt"\n', "mewt"),
        ('[[fault]]\nat_s = -1.0\nkind = "mute"\n', "at_s"),
        ('[[fault]]\nkind = "mute"\n', "at_s"),
        ('[[fault]]\nat_s = 1.0\nkind = "mute"\nlength = 3\n', "length"),
        ("[[fault]\n", "line 1"),
        ("faults = 3\n", "faults"),
    ],
)
def test_bad_fault_script_is_one_clear_line(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=says) as caught:
        load_faults(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_fault_script_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml"):
        load_faults(tmp_path / "none.toml")


# In memory.


class PlainDriver:
    """As little driver as can be: greets, sets a pattern, writes down."""

    def __init__(self) -> None:
        self.decoder = Decoder("robot")
        self.log: list[tuple[float, object]] = []
        self.ticks: list[float] = []
        self._out = b""

    state = LineState.READY
    trouble: str | None = None
    identity: Identity | None = None
    counts = LinkCounts()

    def opened(self, now_s: float) -> None:
        self.log.append((now_s, "opened"))
        self._out += encode(Hello(0)) + encode(Pattern(1, 50, 255, OCTETS))

    def closed(self) -> None:
        self.log.append((math.nan, "closed"))

    def receive(self, data: bytes, now_s: float) -> None:
        self.log += [(now_s, frame) for frame in self.decoder.feed(data)]

    def tick(self, now_s: float) -> None:
        self.ticks.append(now_s)

    def drive(self, twist: Twist) -> None:
        self._out += encode(Drive(2, round(twist.v * 1e3), round(twist.w * 1e3)))

    def halt(self) -> None: ...

    def release(self) -> None: ...

    def set_firing(self, ring: RingConfig) -> None: ...

    def outgoing(self, *, writable: bool) -> bytes:
        assert writable
        out, self._out = self._out, b""
        return out

    @property
    def frame(self) -> Pose:
        return Pose(0.0, 0.0, 0.0)

    @property
    def waiting(self) -> int:
        return 0

    def take(self) -> Heard:
        return Heard((), None, rebooted=False)


def memory_run(faults: Sequence[Fault] = (), cycle_s: float = 0.05) -> PlainDriver:
    driver = PlainDriver()
    line = MemoryLine(driver, EmulatedRobot(robot_config(), WORLD, 1, faults=faults), start_s=100.0)
    for k in range(round(2.0 / cycle_s) + 1):
        driver.drive(Twist(0.3, 0.0))
        line.exchange(100.0 + k * cycle_s)
    return driver


def test_memory_line_joins_a_driver_and_a_robot() -> None:
    driver = memory_run()
    assert driver.log[0] == (100.0, "opened")
    arrival = {type(frame): when for when, frame in reversed(driver.log)}
    assert arrival[Ident] <= 100.0 + 0.01, "answers flow between the host's cycles"
    assert sum(isinstance(frame, Echo) for _, frame in driver.log) == 40
    assert sum(isinstance(frame, Odom) for _, frame in driver.log) >= 98
    assert driver.ticks == sorted(driver.ticks)
    assert all(100.0 <= when <= 102.0 + 1e-9 for when, _ in driver.log)


def test_memory_line_is_deterministic() -> None:
    assert memory_run().log == memory_run().log


def test_memory_line_is_pulled_out_and_put_back() -> None:
    driver = memory_run(script(kind="unplug", at_s=0.5, duration_s=0.5))
    assert [what for _, what in driver.log if isinstance(what, str)] == ["opened", "closed", "opened"]
    assert not [when for when, what in driver.log if 100.51 < when < 100.99]
    assert driver.decoder.bad <= 1

"""The emulated robot keeps the protocol to the letter: conversation, odometry, firing, safety."""

from __future__ import annotations

import binascii
import math

import pytest
from cobs import cobs

from config.world import StartConfig, WallConfig, WorldConfig
from drivers.denning.device import DenningDevice
from drivers.denning.frames import (
    Ack,
    Drive,
    Echo,
    Halt,
    Hello,
    Ident,
    Nak,
    NakCode,
    Odom,
    Pattern,
    Release,
)
from drivers.driver import DriverError
from drivers.messages import Flags, Twist
from tests.drivers.device_host import ALL, WORLD, Host, host, robot_config
from tests.drivers.vectors import THIRDS

# Conversation.


def test_hello_is_answered_with_ident() -> None:
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
    expected = [h.send(Pattern, 50, 255, THIRDS), h.send(Halt), h.send(Release)]
    h.send(Drive, 100, 0)
    h.run(0.02)
    assert [a.of for a in h.of(Ack)] == expected
    assert h.of(Nak) == []


def test_invalid_frames_are_refused_with_a_reason() -> None:
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
    h = Host(DenningDevice(small, WORLD, 1))
    h.send(Pattern, 50, 255, (1 << 8,))
    h.run(0.01)
    assert h.last(Nak).code == NakCode.VALUE_OUT_OF_RANGE


def test_ring_too_large_for_the_protocol_is_an_error() -> None:
    config = robot_config()
    large = config.model_copy(update={"ring": config.ring.model_copy(update={"count": 25})})
    with pytest.raises(DriverError, match="25 sensors"):
        DenningDevice(large, WORLD, 1)


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


def test_firings_are_on_schedule_and_echoes_follow_their_windows() -> None:
    h = host()
    h.send(Pattern, 50, 255, THIRDS)
    h.run(1.0)
    fired = h.of(Echo)
    assert [e.t_us for e in fired] == [50_000 * k for k in range(len(fired))]
    assert [e.step for e in fired] == [k % 8 for k in range(len(fired))]
    assert [e.mask for e in fired] == [THIRDS[k % 8] for k in range(len(fired))]
    for came, frame in h.heard:
        if isinstance(frame, Echo):
            after = came - frame.t_us * 1e-6
            assert 2 * 7.7724 / 343 <= after < 0.055
    assert len(fired) == 20


def test_new_pattern_waits_for_the_step_and_begins_anew() -> None:
    h = host()
    h.send(Pattern, 60, 255, THIRDS)
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
    h.send(Pattern, 50, 255, THIRDS)
    h.run(0.12)
    h.send(Pattern, 0, 255, ())
    h.run(0.5)
    assert [e.t_us for e in h.of(Echo)] == [0, 50_000, 100_000]
    h.send(Pattern, 50, 255, THIRDS)
    h.run(0.2)
    assert [(e.t_us, e.step) for e in h.of(Echo)][3] == (620_000, 0)


def test_pattern_survives_hello_and_halt() -> None:
    h = host()
    h.send(Pattern, 50, 255, THIRDS)
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


def test_without_a_drive_the_deadman_trips() -> None:
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

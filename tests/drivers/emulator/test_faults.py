"""Faults to order: what each does to the emulated robot, how it ends, and what a bad fault script is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.files import ConfigError
from config.world import WorldConfig
from drivers.denning.frames import (
    Ack,
    Drive,
    Echo,
    Halt,
    Hello,
    Ident,
    Odom,
    Pattern,
    Release,
)
from drivers.emulator.faults import load_faults
from drivers.messages import Flags, Twist
from tests.drivers.device_host import host, script
from tests.drivers.vectors import THIRDS

# Faults.


def test_mute_robot_sends_nothing_and_its_numbers_go_on() -> None:
    h = host(faults=script(kind="mute", at_s=0.2, duration_s=0.3))
    h.run(1.0)
    silent = [came for came, _ in h.heard if 0.2 < came < 0.5]
    assert silent == []
    assert h.decoder.lost == 15
    assert h.decoder.bad == 0


def test_a_deaf_robot_receives_nothing() -> None:
    h = host(faults=script(kind="deaf", at_s=0.1, duration_s=0.1))
    h.run(0.15)
    h.send(Hello, 1)
    h.run(0.1)
    assert h.of(Ident) == []
    h.send(Hello, 1)
    h.run(0.1)
    assert len(h.of(Ident)) == 1


def test_garbage_and_bit_errors_are_counted_and_survived() -> None:
    for kind in ("garbage", "bit_errors"):
        h = host(faults=script(kind=kind, at_s=0.2, duration_s=1.0))
        h.run(2.0)
        assert h.decoder.bad > 0
        later = [frame for came, frame in h.heard if came > 1.3]
        assert len(later) == 35
        assert h.decoder.lost > 0


def test_after_a_reboot_only_the_true_pose_is_kept() -> None:
    faults = script(kind="reboot", at_s=2.0, duration_s=0.5)
    h = host(WorldConfig(), faults=faults)
    first = h.robot.boot_id
    h.send(Pattern, 50, 255, THIRDS)
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
    assert h.robot.truth.emulated_s == pytest.approx(3.0)


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


def test_an_ignored_halt_is_acknowledged_and_the_base_drives_on_without_commands() -> None:
    h = host(WorldConfig(), faults=script(kind="ignored_halt", at_s=0.5, duration_s=5.0))
    h.run(1.0, drive=(300, 0))
    seq = h.send(Halt)
    h.run(2.0)
    assert [ack.of for ack in h.of(Ack)] == [seq]
    assert h.flags() == Flags.LATCHED | Flags.DEADMAN
    assert h.robot.truth.twist.v == pytest.approx(0.3)
    h.run(3.0)
    assert h.robot.truth.twist.v == 0.0, "when it is over, the latch holds"


def test_blocked_wheels_do_not_turn_and_report_nothing() -> None:
    h = host(WorldConfig(), faults=script(kind="blocked_wheels", at_s=0.5, duration_s=1.0))
    h.run(1.4, drive=(300, 100))
    assert (h.robot.truth.twist, h.flags()) == (Twist(0.0, 0.0), Flags.NONE)
    h.run(1.0, drive=(300, 0))
    assert h.robot.truth.twist.v == pytest.approx(0.3)


def test_a_runaway_drives_without_a_command_until_it_is_halted() -> None:
    h = host(WorldConfig(), faults=script(kind="runaway", at_s=0.5, duration_s=9.0, v_m_s=0.2, w_rad_s=-0.3))
    h.run(2.0, drive=(0, 0))
    assert (h.robot.truth.twist.v, h.robot.truth.twist.w) == pytest.approx((0.2, -0.3))
    h.send(Halt)
    h.run(0.3)
    assert h.robot.truth.twist == Twist(0.0, 0.0)


@pytest.mark.parametrize("deadman_ms", [0, 1, 65_535])
def test_a_deadman_is_reported_and_kept(deadman_ms: int) -> None:
    h = host(WorldConfig(), faults=script(kind="deadman", at_s=0.0, deadman_ms=deadman_ms))
    h.run(0.1)
    h.send(Hello, 1)
    h.send(Drive, 300, 0)
    h.run(3.0)
    assert h.last(Ident).deadman_ms == deadman_ms
    assert (h.robot.truth.twist.v > 0.0) == (deadman_ms > 3000)


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

"""A session with a Pioneer in virtual time: from the first SYNC0 to CLOSE, and everything that interrupts it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from config.robot import FiringConfig
from drivers.arcos.codec import encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import Other, SipFlags, SonarReading
from drivers.arcos.handshake import STOP
from drivers.driver import LineState
from drivers.firing_pattern import FiringError
from drivers.messages import Flags, Twist
from tests.drivers.arcos.harness import OVER_TCP, P3DX_FILE, Controller, Harness, numbers
from tests.drivers.arcos.vectors import P3DX

N = CommandNumber
FORWARD = Twist(0.2, 0.1)


@pytest.fixture
def harness() -> Harness:
    return Harness()


def driving() -> Harness:
    harness = Harness()
    harness.ready()
    harness.arm()
    harness.run(0.3, lambda: harness.driver.drive(FORWARD))
    assert harness.controller.speed == 200
    return harness


def test_a_session_begins_with_a_sync_and_sets_the_robot_up(harness: Harness) -> None:
    harness.open()
    assert harness.state() is LineState.HANDSHAKE
    sent = harness.run(3.0)
    assert harness.states == [LineState.HANDSHAKE, LineState.READY]
    setup = [
        N.ENABLE,
        N.SETV,
        N.SETA,
        N.SETA,
        N.SETRV,
        N.SETRA,
        N.SETRA,
        N.BUMPSTALL,
        N.SONAR,
        N.SONARCYCLE,
        N.POLLING,
    ]
    start = [N.PULSE, N.OPEN, N.CLOSE, N.OPEN, N.CONFIG, N.HOSTBAUD, N.PULSE]
    assert numbers(sent)[: len(start + setup)] == start + setup
    assert sent[7] == Command(N.ENABLE, 0), "a simulator begins its first session with motors on"
    identity = harness.driver.identity
    assert identity is not None
    assert (identity.name, identity.sensors, identity.deadman_s, identity.odometry_period_s) == ("box", 16, 2.0, 0.1)
    assert identity.ring_radius_m == pytest.approx(0.2564, abs=1e-3)
    assert harness.driver.line_baud == 38400
    assert harness.flags == Flags.LATCHED
    assert any("the base stops by itself only 2 s after" in note for note in harness.notes)


def test_over_tcp_there_is_no_speed_to_change() -> None:
    harness = Harness(OVER_TCP)
    assert harness.driver.line_baud is None
    harness.ready()
    assert N.HOSTBAUD not in numbers(harness.controller.received)


def test_a_robot_that_was_left_open_at_another_speed_is_found_stopped_and_closed(harness: Harness) -> None:
    controller = harness.controller
    controller.session, controller.baud, controller.motors, controller.speed = "open", 38400, True, 300
    harness.ready()
    assert numbers(controller.received)[:2] == [N.STOP, N.ESTOP]
    assert N.CLOSE in numbers(controller.received)[2:6]
    assert controller.speed == 0
    assert not harness.rebooted


def test_whole_frames_are_sent_in_one_write(harness: Harness) -> None:
    """One simulator is deaf for a session after a frame that came in two pieces."""
    harness.open()
    harness.driver.receive(b"\xf3", harness.now)
    harness.driver.tick(harness.now)
    data = harness.driver.outgoing(writable=True)
    assert data == b"".join(map(encode, (Command(N.STOP), Command(N.ESTOP), Command(N.PULSE))))
    assert harness.driver.outgoing(writable=True) == b""


def test_velocities_are_sent_when_the_motors_are_on(harness: Harness) -> None:
    harness.ready()
    assert N.VEL not in numbers(harness.run(0.2, lambda: harness.driver.drive(FORWARD)))
    harness.driver.release()
    assert N.VEL not in numbers(harness.run(0.05, lambda: harness.driver.drive(FORWARD)))
    harness.run(0.3)
    harness.driver.drive(Twist(9.0, -9.0))
    sent = harness.exchange()
    assert sent[:2] == [Command(N.VEL, 500), Command(N.RVEL, -57)]
    assert N.VEL not in numbers(harness.run(0.2)), "each velocity is sent once"
    for wrong in (Twist(math.nan, 0.0), Twist(0.0, math.inf)):
        with pytest.raises(ValueError, match="must be finite"):
            harness.driver.drive(wrong)


def test_the_limits_of_the_robot_apply_too() -> None:
    harness = Harness(controller=Controller(replace(P3DX, speed_max=150, turn_top=20)))
    harness.ready()
    harness.arm()
    harness.driver.drive(Twist(0.5, 1.0))
    assert harness.exchange()[:2] == [Command(N.VEL, 150), Command(N.RVEL, 20)]


def test_a_halt_comes_first_and_ends_with_the_motors_off() -> None:
    harness = driving()
    harness.driver.drive(FORWARD)
    harness.driver.halt()
    assert harness.exchange()[:2] == [Command(N.STOP), Command(N.ESTOP)]
    sent = harness.run(0.4, lambda: harness.driver.drive(FORWARD))
    assert N.VEL not in numbers(sent)
    assert Command(N.ENABLE, 0) in sent
    assert harness.flags == Flags.LATCHED
    assert N.STOP not in numbers(harness.run(1.0)), "confirmed"
    harness.run(0.3, lambda: harness.driver.drive(FORWARD))
    assert harness.controller.speed == 0


def test_only_a_halt_is_sent_on_a_line_that_still_holds_bytes() -> None:
    harness = driving()
    harness.driver.drive(FORWARD)
    assert harness.driver.outgoing(writable=False) == b""
    harness.driver.halt()
    stop = b"".join(map(encode, (Command(N.STOP), Command(N.ESTOP))))
    assert harness.driver.outgoing(writable=False) == stop


def test_a_halt_is_repeated_until_the_base_stands() -> None:
    harness = driving()
    harness.controller.obeys_stop = harness.controller.obeys_enable = False
    harness.driver.halt()
    sent = harness.run(3.0)
    assert numbers(sent).count(N.ESTOP) in range(28, 33)
    assert numbers(sent).count(N.ENABLE) >= 18, "after a second its motors are switched off in motion"
    assert "the base still moves 3.0 s" in (harness.driver.problem or "")
    harness.controller.obeys_stop = harness.controller.obeys_enable = True
    harness.run(0.4)
    assert harness.flags == Flags.LATCHED
    harness.arm()
    assert harness.driver.problem is None


def test_motors_that_do_not_switch_on_are_reported() -> None:
    harness = Harness()
    harness.ready()
    harness.controller.obeys_enable = False
    harness.driver.release()
    sent = harness.run(2.0)
    assert numbers(sent).count(N.ENABLE) == 3
    assert "the motors stay off" in (harness.driver.problem or "")
    harness.controller.obeys_enable = True
    harness.run(1.0)
    assert not harness.controller.motors
    harness.arm()
    assert harness.driver.problem is None


def test_the_stop_button_is_named_and_motors_stay_off_after_it() -> None:
    harness = driving()
    harness.controller.motors, harness.controller.flags, harness.controller.speed = (
        False,
        type(harness.controller.flags)(0x20),
        0,
    )
    harness.run(0.2)
    assert Flags.LATCHED in harness.flags
    assert "STOP button of the robot is pressed" in (harness.driver.problem or "")
    harness.controller.flags = SipFlags(0)
    sent = harness.run(1.0, lambda: harness.driver.drive(FORWARD))
    assert harness.driver.problem is None
    assert not {N.ENABLE, N.VEL} & set(numbers(sent))


def test_without_other_commands_the_watchdog_is_kept_quiet(harness: Harness) -> None:
    harness.controller.answers_encoder = False
    harness.ready()
    harness.run(3.0)
    sent = harness.run(3.0)
    assert set(numbers(sent)) == {N.PULSE}
    assert len(sent) in range(5, 8)


def test_silence_takes_the_line_down_and_stops_the_base() -> None:
    harness = driving()
    harness.controller.mute = True
    sent = harness.run(0.6, lambda: harness.driver.drive(FORWARD))
    assert harness.state() is LineState.DOWN
    assert "nothing received for 0.5" in (harness.driver.problem or "")
    assert harness.controller.speed == 0, "it still hears"
    assert N.ESTOP in numbers(sent)
    harness.controller.mute = False
    harness.run(4.0)
    assert harness.state() is LineState.READY
    assert not harness.rebooted
    assert harness.flags == Flags.LATCHED
    assert N.VEL not in numbers(harness.run(0.3, lambda: harness.driver.drive(FORWARD)))


def test_a_robot_that_sends_but_does_not_receive_is_down(harness: Harness) -> None:
    harness.ready()
    harness.controller.deaf = True
    harness.run(1.5)
    assert harness.states[-1] is LineState.DOWN
    assert "has not answered a request for" in (harness.driver.problem or "")
    harness.controller.deaf = False
    harness.run(4.0)
    assert harness.state() is LineState.READY


def test_a_reset_controller_begins_a_new_session() -> None:
    harness = driving()
    harness.sip(x=3000, y=500, heading=1000)
    harness.run(1.0)
    harness.to_driver(harness.controller.reset())
    assert harness.state() is LineState.HANDSHAKE
    harness.controller.baud = 9600
    harness.run(4.0)
    assert harness.state() is LineState.READY
    assert harness.rebooted
    assert any("controller was reset" in note for note in harness.notes)
    newest = next(r.odometry for r in reversed(harness.received) if r.odometry is not None)
    assert (newest.pose.x, newest.flags) == (0.0, Flags.LATCHED)
    assert newest.robot_s < 4.0
    assert harness.driver.identity is not None
    assert harness.driver.identity.boot_id == 1


def test_a_robot_that_restarted_unnoticed_is_found_by_its_session_and_its_odometry(harness: Harness) -> None:
    harness.ready()
    harness.sip(x=3000)
    harness.run(1.0)
    harness.controller.reset()
    harness.controller.baud = 9600
    harness.run(5.0)
    assert harness.state() is LineState.READY
    assert harness.rebooted


def test_a_line_that_is_replugged_keeps_the_odometry_and_a_halt() -> None:
    harness = driving()
    harness.sip(x=3000)
    harness.run(1.0)
    before = next(r.odometry for r in reversed(harness.received) if r.odometry is not None)
    harness.driver.line_closed()
    assert harness.state() is LineState.CLOSED
    harness.driver.halt()
    assert harness.driver.outgoing(writable=True) == b""
    harness.now += 1.0
    harness.ready()
    assert not harness.rebooted
    after = next(r.odometry for r in reversed(harness.received) if r.odometry is not None)
    assert after.pose == before.pose
    assert harness.driver.counts.bad < 40, "noise of one SIP after the other at the first speed"


def test_a_mute_line_is_down_within_the_time_that_a_run_waits(harness: Harness) -> None:
    harness.controller.mute = True
    harness.open()
    harness.run(3.0)
    assert harness.states == [LineState.HANDSHAKE, LineState.DOWN]
    assert "no answer to SYNC0 at 9600, 38400" in (harness.driver.problem or "")
    harness.controller.mute = False
    harness.run(6.0)
    assert harness.state() is LineState.READY


def test_ranges_become_firings_with_times_and_poses(harness: Harness) -> None:
    harness.ready()
    for k in range(8):
        harness.controller.readings = tuple(SonarReading(d, 1000 + d) for d in (k, 8 + k))
        harness.run(0.1)
    firings = [firing for received in harness.received for firing in received.firings]
    assert len(firings) == 8
    for k, firing in enumerate(firings):
        assert [i for i, r in enumerate(firing.ranges_m) if not math.isnan(r)] == [k, 8 + k]
        assert firing.ranges_m[k] == pytest.approx(1.0 + 1e-3 * k)
    assert harness.driver.firings_waiting == 0


def test_a_new_pattern_is_sent_and_an_impossible_one_refused(harness: Harness) -> None:
    harness.ready()
    ring = P3DX_FILE.ring.model_copy(update={"firing": FiringConfig(sets=((0, 8), (4, 12)), step_period_s=0.05)})
    harness.driver.set_firing(P3DX_FILE.ring)
    assert N.POLLING not in numbers(harness.run(0.1))
    harness.driver.set_firing(ring)
    sent = harness.run(0.1)
    assert Command(N.SONARCYCLE, 50) in sent
    assert Command(N.POLLING, bytes((1, 9, 5, 13))) in sent
    with pytest.raises(FiringError):
        harness.driver.set_firing(ring.model_copy(update={"firing": FiringConfig(preset="octets")}))


def test_sips_count_while_commands_wait_on_a_line_that_takes_none(harness: Harness) -> None:
    harness.ready()
    ring = P3DX_FILE.ring.model_copy(update={"firing": FiringConfig(sets=((0, 8), (4, 12)), step_period_s=0.05)})
    harness.driver.set_firing(ring)
    for _ in range(6):
        harness.now += 0.1
        harness.to_driver(harness.controller.next_sip())
        harness.driver.tick(harness.now)
        assert harness.driver.outgoing(writable=False) == b""
    assert harness.state() is LineState.READY


def test_sonar_that_is_off_is_switched_on_again(harness: Harness) -> None:
    harness.ready()
    harness.controller.sonar = SipFlags(0)
    harness.run(1.0)
    assert int(harness.controller.sonar) == 0x1E
    assert any("reports its sonar as off" in note for note in harness.notes)


def test_the_session_ends_with_close() -> None:
    harness = driving()
    harness.driver.halt()
    harness.run(0.4)
    harness.driver.end_session()
    sent = harness.exchange()
    assert sent[-4:] == [Command(N.STOP), Command(N.ESTOP), Command(N.ENABLE, 0), Command(N.CLOSE, 1)]
    assert (harness.controller.session, harness.state()) == ("wait", LineState.CLOSED)
    assert harness.run(1.0) == []
    harness.driver.end_session()
    assert harness.exchange() == []


def test_a_robot_without_a_session_is_only_stopped_at_the_end(harness: Harness) -> None:
    harness.open()
    harness.driver.end_session()
    assert harness.driver.outgoing(writable=True) == b"".join(map(encode, STOP))


def test_packets_that_are_none_of_its_business_are_skipped(harness: Harness) -> None:
    harness.ready()
    for kind in (0x60, 0x61, 0x62, 0x9A, 0xC0, 0xE0, 0x41):
        harness.to_driver(encode(Other(kind, bytes(30))))
    harness.run(0.5)
    assert harness.state() is LineState.READY


def test_calls_out_of_place_do_nothing(harness: Harness) -> None:
    harness.driver.release()
    harness.driver.tick(1.0)
    harness.driver.receive(b"\xfa\xfb", 1.0)
    assert harness.driver.outgoing(writable=True) == b""
    harness.open()
    harness.driver.release()
    harness.run(0.2)
    assert N.ENABLE not in numbers([c for c in harness.controller.received if c.argument == 1])
    assert harness.driver.problem is None

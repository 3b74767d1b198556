"""Peers that count packets, answer only in part or never end a session: connected, or named within five seconds."""

from __future__ import annotations

import pytest

from drivers.arcos.codec import Decoder, decode_command, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import Packet, RobotName, SyncEcho
from drivers.driver import LineState
from drivers.messages import Twist
from drivers.odometry_gaps import RARE
from tests.drivers.arcos.harness import OVER_TCP, P3DX_FILE, Controller, Harness, numbers

N = CommandNumber
NAMED_S = 5.0


class CountingSimulator(Controller):
    """Takes the first three packets of a session for the SYNCs, whatever they are.

    The first is sent back, whatever it is; each later one is answered if it is the SYNC whose turn it is, and counted
    if it is not. Answers take up to 0.2 s: they come in steps of 0.1 s, one packet a step.
    """

    def __init__(self, *, moves: bool = False) -> None:
        super().__init__()
        self.answers_encoder = False
        self.name = RobotName("AMRISim", "Pioneer", "p3dx")
        self.count = 0
        self._waiting = list[bytes]()
        if moves:
            self.session, self.motors, self.speed, self.count = "open", True, 300, 3

    def connect_again(self) -> None:
        """Take a new client: its session begins anew."""
        self.session, self.count = "wait", 0

    def next_sip(self) -> bytes:
        answer = self._waiting.pop(0) if self._waiting else b""
        return answer + super().next_sip()

    def receive(self, data: bytes) -> bytes:
        for command in self._decoder.feed(data):
            self.received.append(command)
            self._waiting += [encode(packet) for packet in self._answers(command)]
        return b""

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        if self.session != "wait":
            answers = super()._answers(command)
            if self.session == "wait":
                self.count = 0
            return answers
        turn, self.count = self.count, self.count + 1
        if turn == 0:
            return (SyncEcho(command.number),)
        if command.number != turn or command.argument is not None:
            return ()
        return super()._answers(command)


def test_the_simulator_of_these_tests_behaves_as_the_real_one() -> None:
    peer = CountingSimulator()
    packets = decode(b"fafb031d001d fafb03370037 fafb03000000")
    assert b"".join(encode(answer) for each in packets for answer in peer._answers(each)) == unhex(b"fafb031d001d")
    for _ in range(3):
        assert peer._answers(Command(N.OPEN)) == (), "nothing, for ever"
    peer = CountingSimulator()
    for sent in (b"fafb03000000", b"fafb03010001"):
        (packet,) = decode(sent)
        assert b"".join(map(encode, peer._answers(packet))) == unhex(sent)
    (packet,) = decode(b"fafb03020002")
    assert peer._answers(packet) == (peer.name,)


def unhex(text: bytes) -> bytes:
    return bytes.fromhex(text.decode())


def decode(text: bytes) -> list[Command]:
    return Decoder(decode_command).feed(unhex(text))


@pytest.mark.parametrize("config", [OVER_TCP, P3DX_FILE])
def test_a_simulator_that_counts_packets_is_connected_and_driven(config: object) -> None:
    assert config in (OVER_TCP, P3DX_FILE)
    harness = Harness(OVER_TCP if config is OVER_TCP else P3DX_FILE, CountingSimulator())
    harness.open()
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY
    assert numbers(harness.controller.received)[0] == N.PULSE
    harness.arm()
    harness.run(0.5, lambda: harness.driver.drive(Twist(0.2, 0.0)))
    assert harness.controller.speed == 200


def test_one_that_an_earlier_client_left_driving_is_stopped_and_then_connected() -> None:
    harness = Harness(OVER_TCP, CountingSimulator(moves=True))
    harness.open()
    sent = harness.run(0.3)
    assert numbers(sent)[:3] == [N.STOP, N.ESTOP, N.CLOSE]
    assert harness.controller.speed == 0
    harness.run(NAMED_S - 0.3)
    assert harness.state() is LineState.READY


@pytest.mark.parametrize("driving", [False, True])
def test_it_is_connected_again_when_the_line_was_lost(*, driving: bool) -> None:
    peer = CountingSimulator()
    harness = Harness(OVER_TCP, peer)
    harness.ready()
    if driving:
        harness.arm()
        harness.run(0.3, lambda: harness.driver.drive(Twist(0.2, 0.0)))
    harness.driver.line_closed()
    harness.driver.halt()
    harness.now += 1.0
    peer.connect_again()
    harness.open()
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY
    assert peer.speed == 0 or not driving


def test_one_that_stalled_for_a_while_is_connected_again_on_the_same_line() -> None:
    peer = CountingSimulator()
    harness = Harness(OVER_TCP, peer)
    harness.ready()
    peer.mute = True
    harness.run(2.0)
    assert harness.state() is not LineState.READY
    peer.mute = False
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY


class PartialPeer(Controller):
    """Answers the handshake only so far.

    Parameters
    ----------
    last
        What it answers last: "SYNC0", "SYNC1", "SYNC2" or "CONFIG"; nothing after that is answered.
    """

    def __init__(self, last: str) -> None:
        super().__init__()
        self._last = ("SYNC0", "SYNC1", "SYNC2", "CONFIG").index(last)

    def next_sip(self) -> bytes:
        return b""

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        if self.session == "wait" and command.argument is None and command.number > self._last:
            return ()
        if command.number == N.CONFIG and self._last < 3:
            return ()
        return super()._answers(command)


@pytest.mark.parametrize("config", [OVER_TCP, P3DX_FILE])
@pytest.mark.parametrize(
    ("last", "said"),
    [
        ("SYNC0", "answers SYNC0 and not SYNC1"),
        ("SYNC1", "answers SYNC0 and not SYNC2"),
        ("SYNC2", "neither OPEN nor CONFIG"),
        ("CONFIG", "but sends no odometry"),
    ],
)
def test_a_robot_that_answers_only_in_part_is_named(config: object, last: str, said: str) -> None:
    harness = Harness(OVER_TCP if config is OVER_TCP else P3DX_FILE, PartialPeer(last))
    harness.open()
    harness.run(NAMED_S)
    assert harness.state() is LineState.DOWN
    assert said in (harness.driver.problem or "")
    for _ in range(20):
        harness.run(0.5)
        assert harness.state() is LineState.DOWN, "it stays so, and is called on"
        assert said in (harness.driver.problem or "")
    harness.controller = Controller()
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY


def test_a_line_that_only_sends_is_named() -> None:
    """As a recording that is played on a line, or a robot whose receiver is broken."""
    harness = Harness(OVER_TCP)
    harness.controller.session, harness.controller.deaf = "open", True
    harness.open()
    harness.run(NAMED_S)
    assert harness.state() is LineState.DOWN
    assert "does not end it" in (harness.driver.problem or "")
    harness.controller.deaf = False
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY


def test_a_peer_that_gives_its_name_at_once_is_connected() -> None:
    harness = Harness(OVER_TCP)
    harness.open()
    harness.to_driver(encode(RobotName("sim", "Pioneer", "p3dx")))
    harness.run(NAMED_S)
    assert harness.state() is LineState.READY
    assert numbers(harness.controller.received)[0] == N.PULSE


def test_valid_packets_without_an_answer_are_not_called_nothing() -> None:
    harness = Harness(OVER_TCP)
    harness.controller.mute = True
    harness.open()
    for _ in range(50):
        harness.run(0.1)
        harness.to_driver(encode(RobotName("sim", "Pioneer", "p3dx")))
    assert harness.state() is LineState.DOWN
    assert "although the robot sends other frames" in (harness.driver.problem or "")


def test_a_valid_packet_before_noise_is_not_forgotten() -> None:
    harness = Harness(OVER_TCP)
    harness.controller.mute = True
    harness.open()
    harness.to_driver(encode(RobotName("sim", "Pioneer", "p3dx")))
    for _ in range(50):
        harness.run(0.1)
        harness.to_driver(b"\x80\x01")
    assert "although valid frames of a robot came before" in (harness.driver.problem or "")


@pytest.mark.parametrize(("period_s", "speed"), [(0.6, 0), (1.0, 0), (1.0, 300)])
def test_sips_that_come_too_rarely_leave_the_line_down_with_one_problem(period_s: float, speed: int) -> None:
    """That the base does not stop is not said of a line that is down."""
    harness, problems = Harness(), set[str | None]()

    def look() -> None:
        harness.controller.speed = speed
        problems.add(harness.driver.problem)

    harness.sip_period_s = period_s
    harness.open()
    harness.run(12.0, look)
    harness.states.clear()
    problems.clear()
    harness.run(20.0, look)
    assert (harness.states, problems) == ([LineState.DOWN], {RARE.format(0.5, 0.25)})
    harness.sip_period_s = 0.1
    harness.run(3.0)
    assert harness.state() is LineState.READY, harness.driver.problem

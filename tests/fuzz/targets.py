"""Targets of the fuzzers: each accepts any bytes, and raises only if a promise is broken."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from drivers.denning.codec import FRAME_MAX, Decoder, encode
from drivers.denning.frames import Ack, Frame, Halt, Ident
from drivers.messages import Twist
from drivers.registry import make_driver
from runtime.recording.ring_log import RingLogError, read_ring_log
from tests.drivers.cable import ROBOT
from tests.drivers.noise import framed
from tests.drivers.vectors import BAD, GOOD, Side

LOG = b"t,x,y,theta,ring_yaw,r00,r01,r02\n0.05,0,0,0,0,1.5,,inf\n0.1,0.1,-2e-3,3.14,0,0.30,7.77,\n"


def decoder(data: bytes) -> None:
    """Check that chunking does not matter and that the decoder stays synchronised.

    The first byte selects the side and the size of the chunks.
    """
    if not data:
        return
    side: Side = "host" if data[0] & 1 else "robot"
    size, stream = 1 + (data[0] >> 1) % 16, data[1:]
    chunked, whole = Decoder(side), Decoder(side)
    found: list[Frame] = []
    for start in range(0, len(stream), size):
        found += chunked.feed(stream[start : start + size])
        assert chunked.pending <= FRAME_MAX + 1
    assert found == whole.feed(stream)
    assert (chunked.frames, chunked.bad, chunked.lost) == (whole.frames, whole.bad, whole.lost)
    assert chunked.rejected == whole.rejected
    for frame in found:
        decoded = Decoder(side)
        assert decoded.feed(encode(frame)) == [frame]
    two: tuple[Frame, Frame] = (Halt(1), Halt(2)) if side == "host" else (Ack(1, 1), Ack(2, 2))
    assert chunked.feed(encode(two[0]) + encode(two[1]))[-1:] == [two[1]]


def driver(data: bytes) -> None:
    """Check that the driver survives any content of frames with valid checksums, and sends only valid commands."""
    robot, run_s, rest = make_driver(ROBOT), 0.0, data
    robot.line_opened(run_s)
    while rest:
        length, rest = rest[0] % 48, rest[1:]
        body, rest = rest[:length], rest[length:]
        run_s += length * 0.01
        sent = encode(Ident(0, 1, 24, 381, 500, 20, length % 3, "denning")) if length % 7 == 0 else framed(body)
        robot.receive(sent, run_s)
        robot.tick(run_s)
        robot.drive(Twist(0.1, -0.1))
        if length % 11 == 0:
            robot.halt()
        if length % 13 == 0:
            robot.release()
        received = Decoder("host")
        received.feed(robot.outgoing(writable=length % 5 != 0).lstrip(b"\0"))
        assert received.bad == 0
        for firing in robot.take_received().firings:
            assert all(map(math.isfinite, (firing.robot_s, firing.pose.x, firing.pose.y, firing.pose.theta)))
            assert firing.ranges_m.shape == (24,)


def ring_log(data: bytes) -> None:
    """Check that a file is read as firings in order, or refused in one line that names the file."""
    with tempfile.NamedTemporaryFile(suffix=".csv") as file:
        file.write(data)
        file.flush()
        path, last_s = Path(file.name), -math.inf
        try:
            for firing in read_ring_log(path):
                assert last_s <= firing.robot_s < math.inf
                assert all(r >= 0.0 or math.isnan(r) for r in firing.ranges_m.tolist())
                last_s = firing.robot_s
        except RingLogError as error:
            message = str(error)
        else:
            return
    assert message.startswith(str(path)), message
    assert "\n" not in message


TARGETS: Mapping[str, Callable[[bytes], None]] = MappingProxyType(
    {"decoder": decoder, "driver": driver, "ring_log": ring_log}
)
SEEDS: Mapping[str, tuple[bytes, ...]] = MappingProxyType(
    {
        "decoder": (
            *(bytes((side == "host",)) + bytes.fromhex(wire) for side, _, wire in GOOD),
            *(b"\4" + bytes.fromhex(wire) for _, wire in BAD),
        ),
        "driver": tuple(bytes((7, *bytes(7), len(wire) // 2 - 5)) + encode(frame)[:-1] for _, frame, wire in GOOD),
        "ring_log": (
            LOG,
            LOG[:40],
            LOG.replace(b"\n", b"\r\n"),
            LOG + LOG,
            b'"t",x',
            b"t,x,y,theta,r00\n1,2,3,4,1e999\n",
        ),
    }
)

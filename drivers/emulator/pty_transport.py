"""The emulator as a program: the robot on a pseudo-terminal, in real time.

A pty is not a serial line, and what it lacks is added here: bytes leave at the line's speed (the robot's own
transmitter sees to it), bytes nobody reads are lost instead of waiting, and a line without a host is no error.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import signal
import termios
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

from config.errors import UserError
from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.faults import Fault
from drivers.emulator.latency_trace import LatencyTrace
from drivers.emulator.robot_device import RobotDevice
from drivers.emulator.time_channel import TimeChannel
from drivers.emulator.truth_trace import TruthTrace
from drivers.registry import make_device

PERIOD_S = 0.002
"""The robot catches up with the wall clock this often."""
LAG_MAX_S = 0.1
"""A process held up for longer than this stood still: its robot does not live through the rest in a burst."""
LINGER_S = 4.0
"""How long the robot outlives its parent: long enough to be seen stopping by itself."""
_STEP_S = 0.01
_READ_MAX = 4096
_NO_HOST = frozenset({errno.EIO, errno.ENXIO})


class EmulatorError(UserError):
    """The emulator cannot start or be controlled; the text is one line with the reason."""


class PtyPort:
    """The master's end of a pty, and the link under which the other end is found.

    Parameters
    ----------
    link_path
        A symbolic link to keep pointing at the pty; none where not given.

    Attributes
    ----------
    dropped
        Bytes that nobody read in time.

    Raises
    ------
    EmulatorError
        `link_path` is taken by something that is not a link to a pty, or cannot be made.
    """

    def __init__(self, link_path: str | None) -> None:
        self._link = None if link_path is None else Path(link_path)
        self._master: int | None = None
        self._slave_name = ""
        self._has_host = False
        self.dropped = 0
        self.open()

    @property
    def path(self) -> str:
        """What a host opens."""
        return self._slave_name if self._link is None else str(self._link)

    @property
    def is_open(self) -> bool:
        """False while the line is pulled out."""
        return self._master is not None

    def open(self) -> None:
        """Make a pty in raw mode and point the link at it."""
        master, slave = os.openpty()
        try:
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._slave_name = os.ttyname(slave)
        finally:
            os.close(slave)
        self._master = master
        self._has_host = False
        try:
            self._point_link()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Hang up and take the link away."""
        if self._master is None:
            return
        os.close(self._master)
        self._master = None
        if self._link is not None:
            with contextlib.suppress(OSError):
                if self._link.readlink() == Path(self._slave_name):
                    self._link.unlink()

    def read(self) -> bytes | None:
        """Return what the host wrote, without waiting; None where no host has the pty open."""
        if self._master is None:
            return None
        try:
            data = os.read(self._master, _READ_MAX)
        except BlockingIOError:
            data = b""
        except OSError as error:
            if error.errno not in _NO_HOST:
                raise
            if self._has_host:
                self._forget_unread()
            self._has_host = False
            return None
        self._has_host = True
        return data

    def write(self, data: bytes) -> None:
        """Hand `data` to the host, without waiting; what does not fit is lost, as on a line without flow control."""
        written = 0
        if self._master is not None:
            try:
                written = os.write(self._master, data)
            except OSError as error:
                if error.errno not in {errno.EAGAIN, *_NO_HOST}:
                    raise
        self.dropped += len(data) - written

    async def wait(self, timeout_s: float) -> None:
        """Wait until the host has written something, for `timeout_s` at most."""
        master = self._master
        if master is None or not self._has_host:  # a pty without a host is readable all the time
            await asyncio.sleep(timeout_s)
            return
        loop = asyncio.get_running_loop()
        over = asyncio.Event()
        timer = loop.call_later(timeout_s, over.set)
        loop.add_reader(master, over.set)
        try:
            await over.wait()
        finally:
            loop.remove_reader(master)
            timer.cancel()

    def _forget_unread(self) -> None:
        """Throw away what the last host left unread: a pty keeps it for the next one, a serial port does not."""
        with contextlib.suppress(OSError, termios.error):
            slave = os.open(self._slave_name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                termios.tcflush(slave, termios.TCIFLUSH)
            finally:
                os.close(slave)

    def _point_link(self) -> None:
        link = self._link
        if link is None:
            return
        if link.is_symlink():
            target = link.readlink()
            if link.exists() and not str(target).startswith("/dev/pts/"):
                raise EmulatorError(
                    f"{link} already is a link to {target}, which is not a pty: remove it or choose another path"
                )
        elif link.exists():
            raise EmulatorError(f"{link} already exists and is not a link: remove it or choose another path")
        fresh = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            fresh.symlink_to(self._slave_name)
            fresh.replace(link)
        except OSError as error:
            reason = os.strerror(error.errno or 0)
            raise EmulatorError(f"cannot make the link {link}: {reason}; choose another path") from error


class SlippingClock:
    """The robot's time, tied to the host's clock; slips rather than bursts when the process was held up.

    Attributes
    ----------
    slipped_s
        Time the robot did not live through.
    """

    def __init__(self, now_s: float) -> None:
        self._start_s = now_s
        self._robot_s = 0.0
        self.slipped_s = 0.0

    @property
    def robot_s(self) -> float:
        """How far the robot has come."""
        return self._robot_s

    def steps(self, now_s: float, *, may_slip: bool = True) -> Iterator[float]:
        """Yield the robot's times to advance to, one after another, up to the host's time `now_s`."""
        lag_s = now_s - self._start_s - self._robot_s
        if may_slip and lag_s > LAG_MAX_S:
            self._start_s += lag_s - LAG_MAX_S
            self.slipped_s += lag_s - LAG_MAX_S
        until_s = now_s - self._start_s
        while self._robot_s < until_s:
            self._robot_s = min(until_s, self._robot_s + _STEP_S)
            yield self._robot_s

    def host_s(self, robot_s: float) -> float:
        """Return the host's time at the robot's time `robot_s`."""
        return self._start_s + robot_s


async def serve(
    robot: RobotConfig,
    world: WorldConfig,
    *,
    link_path: str | None,
    faults: Sequence[Fault],
    seed: int,
    trace_path: str | None,
    ready: Callable[[str], None],
    latency_path: str | None = None,
    exit_with_parent: bool = False,
    clock_start_us: int = 0,
    control: tuple[int, int] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Be a robot on a pty until SIGTERM or SIGINT.

    Parameters
    ----------
    robot, world, faults, seed
        As for `drivers.registry.make_device`.
    link_path
        Where to put a symbolic link to the pty; it is removed at the end.
    trace_path
        Where to write the truth, see `TruthTrace`.
    latency_path
        Where to write when echoes left and commands came, see `LatencyTrace`.
    ready
        Called once, with the path to open, when a host can open it.
    exit_with_parent
        End by itself `LINGER_S` after the process that started this one is gone.
    clock_start_us
        As for `drivers.registry.make_device`.
    control
        Two file descriptors: laws of time are read from the one, and how far the robot has lived is written to the
        other, see `TimeChannel`. The truth is then written by the run's clock, which is the host's until it is
        held for the first time.
    clock
        The host's monotonic clock, seconds.

    Raises
    ------
    EmulatorError
        The link or the trace cannot be made, or there is no channel to be controlled by.
    drivers.driver.DriverError
        See `drivers.registry.make_device`.
    """
    parent = os.getppid()
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    with contextlib.ExitStack() as stack:
        for number in (signal.SIGTERM, signal.SIGINT):
            stack.callback(loop.remove_signal_handler, number)
        device = make_device(robot, world, seed, faults=faults, clock_start_us=clock_start_us)
        trace = None if trace_path is None else TruthTrace(_open_trace(trace_path, stack))
        latency = (
            None if latency_path is None else LatencyTrace(_open_trace(latency_path, stack), device.frame_counter())
        )
        port = PtyPort(link_path)
        stack.callback(port.close)
        channel = None if control is None else _open_channel(control, stack)
        ready(port.path)
        timeline = SlippingClock(clock())
        orphaned_s: float | None = None
        while not stop.is_set():
            host_s = now_s = clock()
            pause_s, may_slip = PERIOD_S, True
            if channel is not None:
                channel.receive(host_s)
                scale = channel.follower.scale
                now_s = channel.follower.run_at(host_s)
                pause_s, may_slip = PERIOD_S / max(1.0, scale.factor), scale.is_real_time
            stood_s = timeline.robot_s
            for robot_s in timeline.steps(now_s, may_slip=may_slip):
                _exchange(device, port, robot_s, latency, clock)
                if trace is not None:
                    truth = device.truth
                    trace.write(truth, timeline.host_s(truth.emulated_s))
            if channel is not None:
                if timeline.robot_s == stood_s:
                    # Time stands still, and a HALT is heard nevertheless.
                    _exchange(device, port, stood_s, latency, clock)
                channel.acknowledge(now_s)
            if exit_with_parent and orphaned_s is None and os.getppid() != parent:
                orphaned_s = host_s
            if orphaned_s is not None and host_s - orphaned_s > LINGER_S:
                return
            await port.wait(pause_s)


def _exchange(
    device: RobotDevice,
    port: PtyPort,
    robot_s: float,
    latency: LatencyTrace | None,
    clock: Callable[[], float],
) -> None:
    """Advance the robot and move bytes both ways."""
    left = device.advance(robot_s)
    if port.is_open and not device.plugged:
        port.close()
    elif device.plugged and not port.is_open:
        port.open()
    heard = port.read()
    if heard and latency is not None:
        latency.received(heard, clock())
    # With no host on the line bytes go nowhere: the pty would keep them for the next one to open it.
    if heard is not None and left:
        sent_s = clock()
        port.write(left)
        if latency is not None:
            latency.sent(left, sent_s)
    if heard:
        device.receive(heard)


def _open_channel(control: tuple[int, int], stack: contextlib.ExitStack) -> TimeChannel:
    try:
        channel = TimeChannel(*control)
    except OSError as error:
        raise EmulatorError(f"cannot be controlled: {os.strerror(error.errno or 0)}; give it two pipes") from error
    stack.callback(channel.close)
    return channel


def _open_trace(trace_path: str, stack: contextlib.ExitStack) -> TextIO:
    try:
        return stack.enter_context(Path(trace_path).open("w", encoding="ascii"))
    except OSError as error:
        raise EmulatorError(f"cannot write the trace {trace_path}: {os.strerror(error.errno or 0)}") from error

"""The emulator as a program: an emulated robot on a pseudo-terminal or a TCP port, in real time.

The robot's transmitter limits the line's speed. What the host does not read in time is lost, as on a serial line.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TextIO

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.faults import Fault
from drivers.emulator.latency_trace import LatencyTrace
from drivers.emulator.port_link import EmulatorError
from drivers.emulator.robot_device import RobotDevice
from drivers.emulator.time_channel import TimeChannel
from drivers.emulator.truth_trace import TruthTrace
from drivers.registry import make_device

PERIOD_S = 0.002
"""Time between two turns of the main loop, s."""
LAG_MAX_S = 0.1
"""Longest lag behind the host's clock that is caught up, s; after a longer one the emulated time slips."""
LINGER_S = 4.0
"""How long the emulator runs on after its parent has ended, s: long enough to see the robot stop by itself."""
_STEP_S = 0.01
"""Longest step of the simulation between two exchanges of bytes, s."""


class EmulatorPort(Protocol):
    """The robot's end of a line to which hosts come and go. No method waits."""

    @property
    def path(self) -> str:
        """What a host opens."""

    @property
    def is_open(self) -> bool:
        """False while the line is unplugged."""

    @property
    def watched(self) -> int | None:
        """The descriptor that becomes readable when the host writes, None if there is none."""

    def open(self) -> None:
        """Plug in."""

    def unplug(self) -> None:
        """Hang up; the path stays reserved."""

    def close(self) -> None:
        """Hang up for good."""

    def read(self) -> bytes | None:
        """Return the bytes that the host wrote; None if there is no host."""

    def write(self, data: bytes) -> None:
        """Send bytes to the host; those that do not fit are lost."""


class SlippingClock:
    """The emulated time, which follows the host's clock but slips when the process was suspended.

    Without slipping, the simulation would catch up in a burst of events after a suspension.

    Parameters
    ----------
    start_s
        The clock's reading at the emulator's start.

    Attributes
    ----------
    slipped_s
        Time that was skipped.
    """

    def __init__(self, start_s: float) -> None:
        self._start_s = start_s
        self._emulated_s = 0.0
        self.slipped_s = 0.0

    @property
    def emulated_s(self) -> float:
        """The emulated time, s since the start."""
        return self._emulated_s

    def steps(self, now_s: float, *, may_slip: bool = True) -> Iterator[float]:
        """Yield the emulated times to advance to, in steps, up to the clock's reading `now_s`.

        A lag beyond `LAG_MAX_S` is given up if `may_slip`, and counted; the emulated time then runs later for good.
        """
        lag_s = now_s - self._start_s - self._emulated_s
        if may_slip and lag_s > LAG_MAX_S:
            self._start_s += lag_s - LAG_MAX_S
            self.slipped_s += lag_s - LAG_MAX_S
        until_s = now_s - self._start_s
        while self._emulated_s < until_s:
            self._emulated_s = min(until_s, self._emulated_s + _STEP_S)
            yield self._emulated_s

    def reading_at(self, emulated_s: float) -> float:
        """Return the clock's reading at an emulated time."""
        return self._start_s + emulated_s


@dataclass(frozen=True, slots=True)
class Service:
    """What an emulated robot does beside being a robot."""

    trace_path: str | None = None
    """File for the true states, see `TruthTrace`."""
    latency_path: str | None = None
    """File for the times of echoes and drive commands, see `LatencyTrace`."""
    exit_with_parent: bool = False
    """Whether it ends `LINGER_S` after the parent process has ended."""
    clock_start_us: int = 0
    """As for `drivers.registry.make_device`."""
    control: tuple[int, int] | None = None
    """Two file descriptors: time scales are read from the first, and acknowledged on the second, see `TimeChannel`.
    The true states then have the run's clock, which equals the host's until it is paused for the first time."""


async def serve(
    robot: RobotConfig,
    world: WorldConfig,
    *,
    make_port: Callable[[], EmulatorPort],
    faults: Sequence[Fault],
    seed: int,
    ready: Callable[[str], None],
    service: Service,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run an emulated robot in real time until SIGTERM or SIGINT.

    Parameters
    ----------
    robot, world, faults, seed
        As for `drivers.registry.make_device`.
    make_port
        Returns the port on which it is served; it is closed at the end.
    ready
        Called once, with the path to open, as soon as a host can open it.
    service
        What it does beside being a robot.
    clock
        The host's monotonic clock, seconds.

    Raises
    ------
    EmulatorError
        The port or a trace cannot be made, or the file descriptors cannot be used.
    drivers.driver.DriverError
        See `drivers.registry.make_device`.
    """
    trace_path, latency_path, control = service.trace_path, service.latency_path, service.control
    parent = os.getppid()
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    with contextlib.ExitStack() as stack:
        for number in (signal.SIGTERM, signal.SIGINT):
            stack.callback(loop.remove_signal_handler, number)
        device = make_device(robot, world, seed, faults=faults, clock_start_us=service.clock_start_us)
        trace = None if trace_path is None else TruthTrace(_open_trace(trace_path, stack))
        latency = (
            None if latency_path is None else LatencyTrace(_open_trace(latency_path, stack), device.frame_counter())
        )
        port = make_port()
        stack.callback(port.close)
        channel = None if control is None else _open_channel(control, stack)
        ready(port.path)
        emulated = SlippingClock(clock())
        orphaned_s: float | None = None
        while not stop.is_set():
            host_s = run_s = clock()
            pause_s, may_slip = PERIOD_S, True
            if channel is not None:
                channel.receive(host_s)
                scale = channel.follower.scale
                run_s = channel.follower.run_at(host_s)
                pause_s, may_slip = PERIOD_S / max(1.0, scale.factor), scale.is_real_time
            before_s = emulated.emulated_s
            for emulated_s in emulated.steps(run_s, may_slip=may_slip):
                _exchange(device, port, emulated_s, latency, clock)
                if trace is not None:
                    truth = device.truth
                    trace.write(truth, emulated.reading_at(truth.emulated_s))
            if channel is not None:
                if emulated.emulated_s == before_s:
                    # Time is paused, but a HALT must be received.
                    _exchange(device, port, before_s, latency, clock)
                channel.acknowledge(run_s)
            if service.exit_with_parent and orphaned_s is None and os.getppid() != parent:
                orphaned_s = host_s
            if orphaned_s is not None and host_s - orphaned_s > LINGER_S:
                return
            await wait_for_host(port, pause_s)


async def wait_for_host(port: EmulatorPort, timeout_s: float) -> None:
    """Wait until the host has written something, at most for `timeout_s`."""
    watched = port.watched
    if watched is None:
        await asyncio.sleep(timeout_s)
        return
    loop = asyncio.get_running_loop()
    done = asyncio.Event()
    timer = loop.call_later(timeout_s, done.set)
    loop.add_reader(watched, done.set)
    try:
        await done.wait()
    finally:
        loop.remove_reader(watched)
        timer.cancel()


def _exchange(
    device: RobotDevice,
    port: EmulatorPort,
    emulated_s: float,
    latency: LatencyTrace | None,
    clock: Callable[[], float],
) -> None:
    """Advance the robot to `emulated_s` and move bytes both ways."""
    data = device.advance(emulated_s)
    if port.is_open and not device.plugged:
        port.unplug()
    elif device.plugged and not port.is_open:
        port.open()
    received = port.read()
    if received and latency is not None:
        latency.received(received, clock())
    # Without a host the bytes are dropped: a pty would keep them for the next host.
    if received is not None and data:
        sent_s = clock()
        port.write(data)
        if latency is not None:
            latency.sent(data, sent_s)
    if received:
        device.receive(received)


def _open_channel(control: tuple[int, int], stack: contextlib.ExitStack) -> TimeChannel:
    """Return the channel of two pipes; `stack` closes it.

    Raises
    ------
    EmulatorError
        They are no pipes.
    """
    try:
        channel = TimeChannel(*control)
    except OSError as error:
        raise EmulatorError(
            f"cannot use the control channel: {os.strerror(error.errno or 0)}; pass two pipes"
        ) from error
    stack.callback(channel.close)
    return channel


def _open_trace(trace_path: str, stack: contextlib.ExitStack) -> TextIO:
    """Return the file of the trace, emptied; `stack` closes it.

    Raises
    ------
    EmulatorError
        It cannot be written.
    """
    try:
        return stack.enter_context(Path(trace_path).open("w", encoding="ascii"))
    except OSError as error:
        raise EmulatorError(
            f"cannot write the trace {trace_path}: {os.strerror(error.errno or 0)}; choose another path"
        ) from error

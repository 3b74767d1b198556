"""What answers on a port: the drivers of known robots are tried, without moving anything."""

from __future__ import annotations

import asyncio
import itertools
import math
import shlex
import time
from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from config.robot import RobotConfig
from drivers.driver import LineState, RobotDriver
from drivers.heard_bytes import HeardBytes
from drivers.link import Link, LinkError
from drivers.messages import Flags, Identity
from drivers.registry import line_options, make_driver, other_robot
from drivers.tcp_port import explain_hang_up, is_tcp
from runtime.cycle.connection import POLL_S, Connection

ANSWER_MAX_S: Final = 3.0
"""Longest wait for a robot's first frame, s: as long as it takes to call a Pioneer at every speed of its line."""
SOCKET_MAX_S: Final = 3.9
"""Longest wait for first frames over a network, of all families, s: nothing is lost there, and it has no speeds. A
third is the time to listen to a Pioneer's line and to wait for the answer to its first SYNC."""
AGAIN_MAX_S: Final = 3.0
"""Longest wait until a port that was just given up can be opened again, s: a server of one client is still busy."""
READY_MAX_S: Final = 6.0
"""Longest wait from the first frame until the robot is ready, s."""
LOOK_S: Final = 1.0
"""Longest time to listen to a robot that is ready, for its sensors and its state, s; less if all have fired."""
NOTHING: Final = "nothing answers: is the robot on, and is this its cable?"
NO_FRAME: Final = (
    "no robot answers, and what is received is no frame of a known robot; another device is on this port, or one of "
    "another speed: name its file with --robot"
)
UNREADY: Final = (
    "it answers, but does not finish the handshake: restart the robot, and check its cable in both directions"
)
WARNINGS: Final = (
    (Flags.MOTOR_FAULT, "a motor reports a fault"),
    (Flags.BUMPER, "a bumper is pressed"),
)


class Finding(NamedTuple):
    """What was found on a port."""

    robot: str | None
    """The name by which the robot is run; None if there is none."""
    said: tuple[str, ...]
    """The robot in words, or why there is none."""


class _Event(NamedTuple):
    """One moment of a line, for the driver of another file."""

    at_s: float
    data: bytes | None
    """What was received; None where the driver was asked what to send."""


class _Answer(NamedTuple):
    """What the driver of one robot found out."""

    has_answered: bool
    """Whether any of its frames arrived."""
    text: str | None = None
    """The robot in words; None if it is none of this kind."""
    problem: str | None = None
    """Why it is not, or why the port cannot be opened."""
    stranger: str | None = None
    """Who sent the bytes that were no frame, None if none came."""
    fired: int = 0
    """How many of its sensors have fired."""
    is_whole: bool = False
    """Whether all have."""
    is_other: bool = False
    """Whether the robot has said what it is, so that another file of its family may be its own."""
    events: tuple[_Event, ...] = ()
    """What was received, and when the line was looked after."""


async def probe_port(port: str, robots: dict[str, RobotConfig]) -> Finding:
    """Return what answers on a port.

    Robots of one driver and one speed (a socket has none) are tried one after the other as long as something answers
    them and either is ready or says that it is another robot; what answers one family is not asked by the next. One
    of which all sensors fire is the robot; some controllers do not name theirs, and the one of which most fire is
    chosen.

    Parameters
    ----------
    port
        The port.
    robots
        Robots by the names by which they are run.
    """
    said, best = dict[str, list[str]](), (0, Finding(None, ()))  # what was said as which robots
    strangers, tries = list[str](), itertools.count()
    is_socket = "://" in port
    key = partial(_family, is_socket=is_socket)
    families = [list(ones) for _, ones in itertools.groupby(sorted(robots.items(), key=key), key=key)]
    answer_max_s = min(ANSWER_MAX_S, SOCKET_MAX_S / len(families)) if is_socket else ANSWER_MAX_S
    for family in families:
        events = tuple[_Event, ...]()
        for name, config in family:
            answer = _heard_as(config, events) or await _try(port, config, answer_max_s, again=next(tries) > 0)
            events = answer.events
            if answer.text is not None:
                if best[1].robot is None or answer.fired > best[0]:
                    best = (answer.fired, Finding(name, (answer.text,)))
                if answer.is_whole:
                    return best[1]
            if answer.stranger is not None:
                strangers.append(answer.stranger)
            if answer.problem is not None:
                said.setdefault(answer.problem, []).extend([name] if answer.has_answered else ())
            if not answer.has_answered or (answer.problem is not None and not answer.is_other):
                break
        if best[1].robot is not None:
            return best[1]
        if answer.has_answered or answer.problem is not None:
            break  # it is of this family, or the port cannot be opened
    return Finding(None, _lines(said, strangers))


def _lines(said: dict[str, list[str]], strangers: list[str]) -> tuple[str, ...]:
    """Return the problems, each with the robots that had it; without one, a line on a stranger."""
    known = [stranger for stranger in strangers if stranger != NO_FRAME]
    lines = [f"as {', '.join(names)}: {text}" if names else text for text, names in said.items()]
    return tuple(lines or (known or strangers or [NOTHING])[:1])


def run_it(port: str, robot: str) -> str:
    """Return the command that runs a robot on a port."""
    return shlex.join(("echolocate", "run", "--robot", robot, "--port", port))


def _family(item: tuple[str, RobotConfig], *, is_socket: bool) -> tuple[str, int]:
    return item[1].robot.driver, 0 if is_socket else item[1].link.baud


async def _try(port: str, config: RobotConfig, answer_max_s: float, *, again: bool = False) -> _Answer:
    """Return what the driver of one robot finds out; it is never released, so nothing moves.

    Parameters
    ----------
    port, config
        The port, and the robot.
    answer_max_s
        Longest wait for its first frame, s.
    again
        Whether the port was open just before.
    """
    config = config.model_copy(update={"link": config.link.model_copy(update={"port": port})})
    listener, clock, heard = _Listener(config, answer_max_s), time.monotonic, HeardBytes()
    driver, heard.find_robot = listener.driver, partial(other_robot, config.robot.driver)

    def send() -> None:
        link.set_baud(driver.line_baud)
        if link.is_open and (data := listener.sent(clock(), writable=link.writable)):
            heard.sent(data)
            link.send(data)

    def opened() -> None:
        listener.opened(clock())
        send()

    def received(data: bytes) -> None:
        heard.received(data)
        listener.received(data, clock())

    link = Link(config.link, opened, received, lambda _reason: driver.line_closed(), **line_options(config))
    try:
        await _open(link, AGAIN_MAX_S if again else 0.0, clock)
    except LinkError as error:
        return _Answer(has_answered=False, problem=str(error))
    try:
        while link.is_open:
            send()
            if (answer := listener.found(clock())) is not None:
                stranger = None if answer.has_answered or not heard.total else heard.stranger or NO_FRAME
                return answer._replace(stranger=stranger, events=tuple(listener.events))
            await asyncio.sleep(POLL_S)
        if listener.is_ready:
            return listener.look(clock())
        ended = link.last_error and (explain_hang_up(port) if is_tcp(port) else link.last_error)
        return _Answer(has_answered=False, problem=heard.stranger or ended)
    finally:
        if driver.state is LineState.READY:
            await Connection(link, driver, send, clock, config.body).shut_down()
        await link.stop()


def _heard_as(config: RobotConfig, events: tuple[_Event, ...]) -> _Answer | None:
    """Return what the driver of another file makes of what was received as a file of its family; None if nothing.

    A robot that says what it is, or one whose controller reports unasked, need not be called once more.
    """
    if not events:
        return None
    listener = _Listener(config, math.inf)
    listener.opened(events[0].at_s)
    answer = None
    for at_s, data in events:
        if data is None:
            listener.sent(at_s, writable=True)
            answer = listener.found(at_s)
        else:
            listener.received(data, at_s)
        if answer is not None:
            break
    return answer if answer is None else answer._replace(events=events)


class _Listener:
    """The driver of one robot on a line, and what it finds out.

    Attributes
    ----------
    driver
        The driver.
    events
        What was received, and when the driver was asked what to send.
    """

    def __init__(self, config: RobotConfig, answer_max_s: float) -> None:
        self.driver, self._answer_max_s = make_driver(config), answer_max_s
        self.events: list[_Event] = []
        self._begin_s = 0.0
        self._ready_s = math.inf
        """When the robot was ready, s; inf before."""
        self._flags, self._fired, self._echoed = Flags.NONE, set[int](), set[int]()

    @property
    def is_ready(self) -> bool:
        """Whether the robot was ready."""
        return math.isfinite(self._ready_s)

    def opened(self, at_s: float) -> None:
        """Begin on a line that was just opened."""
        self._begin_s = at_s
        self.driver.line_opened(at_s)

    def received(self, data: bytes, at_s: float) -> None:
        """Take bytes from the line."""
        self.events.append(_Event(at_s, data))
        self.driver.receive(data, at_s)

    def sent(self, at_s: float, *, writable: bool) -> bytes:
        """Let time pass; return what is to be sent, and consider it sent."""
        self.events.append(_Event(at_s, None))
        self.driver.tick(at_s)
        return self.driver.outgoing(writable=writable)

    def found(self, at_s: float) -> _Answer | None:
        """Return what was found out; None as long as more may come."""
        driver = self.driver
        has_answered, waited_s = driver.counts.frames > 0, at_s - self._begin_s
        if driver.state is LineState.READY:
            self._ready_s = min(self._ready_s, at_s)
        if self.is_ready:
            answer = self.look(at_s)
            return answer if answer.is_whole or at_s - self._ready_s >= LOOK_S else None
        if has_answered and (driver.state is LineState.DOWN or waited_s > READY_MAX_S):
            return _Answer(has_answered=True, problem=driver.problem or UNREADY, is_other=_is_other(driver))
        if not has_answered and waited_s > self._answer_max_s:
            return _Answer(has_answered=False)
        return None

    def look(self, at_s: float) -> _Answer:
        """Return what a robot that is ready has said up to now."""
        received, identity = self.driver.take_received(), self.driver.identity
        self._flags |= received.flags
        for firing in received.firings:
            self._fired |= set(np.flatnonzero(~np.isnan(firing.ranges_m)).tolist())
            self._echoed |= set(np.flatnonzero(np.isfinite(firing.ranges_m)).tolist())
        fired, echoed, flags = len(self._fired), len(self._echoed), self._flags
        robot = "a robot" if identity is None else f"{_name(identity)}, {identity.sensors} sensors"
        within = f"within {at_s - self._ready_s:.1f} s {fired} have fired and {echoed} have heard something"
        battery = _battery(self.driver.battery_v, is_low=Flags.BATTERY_LOW in flags)
        text = "; ".join([robot, battery, within, *(warning for flag, warning in WARNINGS if flag in flags)])
        count = math.inf if identity is None else identity.sensors
        return _Answer(has_answered=True, text=text, fired=fired, is_whole=fired >= count)


def _is_other(driver: RobotDriver) -> bool:
    """Return whether the robot says that it is another one; a driver need not know, and may be behind another one."""
    return bool(getattr(driver, "is_other_robot", False))


async def _open(link: Link, tries_s: float, clock: Callable[[], float]) -> None:
    """Open the line, and try again for this long.

    Raises
    ------
    LinkError
        It cannot be opened.
    """
    end_s = clock() + tries_s
    while True:
        try:
            await link.open_once()
        except LinkError:
            if clock() >= end_s:
                raise
        else:
            return
        await asyncio.sleep(POLL_S)


def _battery(volts: float | None, *, is_low: bool) -> str:
    """Return the battery's state as a phrase."""
    if volts is None:
        return "battery low" if is_low else "battery not reported"
    return f"battery {volts:.1f} V, low" if is_low else f"battery {volts:.1f} V"


def _name(identity: Identity) -> str:
    """Return how a robot names itself, as a phrase."""
    return f"robot '{identity.name}'" if identity.name else "a robot without a name"

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
from runtime.cycle.connection import POLL_S, Connection, why_ended

ANSWER_MAX_S: Final = 3.0
"""Longest wait for a robot's first frame, s: to call a Pioneer at every speed of its line takes as long, and so does
the start of a board that opening its port restarts."""
LEAST_S: Final = 0.7
"""Least wait, s, although a driver has given up: this program may be held up, and all families take 5 s at most."""
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
    strangers, line, is_socket = list[str](), _Line(port), "://" in port
    key = partial(_family, is_socket=is_socket)
    families = [list(ones) for _, ones in itertools.groupby(sorted(robots.items(), key=key), key=key)]
    answer_max_s = min(ANSWER_MAX_S, SOCKET_MAX_S / len(families)) if is_socket else ANSWER_MAX_S
    try:
        for family in families:
            events = tuple[_Event, ...]()
            for name, config in family:
                answer = _heard_as(config, events) or await _try(line, config, answer_max_s)
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
    finally:
        await line.close()
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


async def _try(line: _Line, config: RobotConfig, answer_max_s: float) -> _Answer:
    """Return what the driver of one robot finds out; it is never released, so nothing moves.

    Parameters
    ----------
    line
        The port.
    config
        The robot.
    answer_max_s
        Longest wait for its first frame, s.
    """
    config = config.model_copy(update={"link": config.link.model_copy(update={"port": line.port})})
    listener, clock = _Listener(config, answer_max_s), time.monotonic
    driver = listener.driver
    try:
        link, heard = await line.open(config, listener)
    except LinkError as error:
        return _Answer(has_answered=False, problem=str(error))
    answer = _Answer(has_answered=True)
    try:
        while link.is_open:
            line.send()
            if (found := listener.found(clock(), clock() - line.opened_s)) is not None:
                answer = found._replace(events=tuple(listener.events))
                stranger = None if answer.has_answered or not heard.total else heard.stranger or NO_FRAME
                return answer._replace(stranger=stranger)
            await asyncio.sleep(POLL_S)
        if listener.is_ready:
            return listener.look(clock())
        return _Answer(has_answered=False, problem=why_ended(link, driver, heard))
    finally:
        if driver.state is LineState.READY:
            await Connection(link, driver, line.send, clock, config.body).shut_down()
        if answer.has_answered or "://" in line.port:
            await line.close()


class _Line:
    """A port, which stays open until something answers, so that a board that it restarts does so once.

    A network line is closed after each family: what is sent to one may be taken for the begin of another's session.

    Attributes
    ----------
    port
        The port.
    opened_s
        When it was opened, s.
    """

    def __init__(self, port: str) -> None:
        self.port, self.opened_s = port, 0.0
        self._link: Link | None = None
        self._listener: _Listener | None = None
        self._heard: HeardBytes | None = None
        self._is_again = False
        """Whether the port was open just before."""
        self._baud: int | None = None

    async def open(self, config: RobotConfig, listener: _Listener) -> tuple[Link, HeardBytes]:
        """Return the open line, on which a listener begins, and the bytes that it hears.

        Raises
        ------
        LinkError
            It cannot be opened.
        """
        self._heard, self._listener, self._baud = (heard := HeardBytes()), listener, config.link.baud
        heard.find_robot = partial(other_robot, config.robot.driver)
        if self._link is not None and self._link.is_open:
            self._begin()
            return self._link, heard
        self._link = Link(config.link, self._opened, self._received, self._lost, **line_options(config))
        tries_s, self._is_again = AGAIN_MAX_S if self._is_again else 0.0, True
        await _open(self._link, tries_s, time.monotonic)
        return self._link, heard

    def send(self) -> None:
        """Send what the listener's driver has to send."""
        link, listener, heard = self._link, self._listener, self._heard
        if link is None or listener is None or heard is None:
            return
        link.set_baud(listener.driver.line_baud or self._baud)
        if link.is_open and (data := listener.sent(time.monotonic(), writable=link.writable)):
            heard.sent(data)
            link.send(data)

    async def close(self) -> None:
        """Close it."""
        if self._link is not None:
            await self._link.stop()

    def _opened(self) -> None:
        self.opened_s = time.monotonic()
        self._begin()

    def _begin(self) -> None:
        if self._listener is not None:
            self._listener.opened(time.monotonic())
            self.send()

    def _received(self, data: bytes) -> None:
        if self._listener is not None and self._heard is not None:
            self._heard.received(data)
            self._listener.received(data, time.monotonic())

    def _lost(self, _reason: str) -> None:
        if self._listener is not None:
            self._listener.driver.line_closed()


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

    def found(self, at_s: float, open_s: float = 0.0) -> _Answer | None:
        """Return what was found out; None as long as more may come.

        A driver that gives up is believed if the line has been open for so long (s) that a robot has started: what is
        received before may be the end of what a board sent before it was restarted.
        """
        driver = self.driver
        has_answered, waited_s = driver.counts.frames > 0, at_s - self._begin_s
        if driver.state is LineState.READY:
            self._ready_s = min(self._ready_s, at_s)
        if self.is_ready:
            answer = self.look(at_s)
            return answer if answer.is_whole or at_s - self._ready_s >= LOOK_S else None
        is_down, is_other, is_late = driver.state is LineState.DOWN, _is_other(driver), waited_s > self._answer_max_s
        has_given_up = is_down and (is_late or (waited_s > LEAST_S and open_s > ANSWER_MAX_S))
        if has_answered and (has_given_up or (is_down and is_other) or waited_s > READY_MAX_S):
            return _Answer(has_answered=True, problem=driver.problem or UNREADY, is_other=is_other)
        if not has_answered and (has_given_up or is_late):
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

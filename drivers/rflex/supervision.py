"""Supervision of the brake and of the motors: the controller acknowledges no command, but reports both."""

from __future__ import annotations

import math
from collections import deque
from enum import Enum
from typing import Final

from config.robot import RobotConfig
from drivers.base_model import obeyed
from drivers.messages import Twist
from drivers.rflex.codec import BRAKE_RELEASE, BRAKE_SET, STATUS_REQUEST, Frame
from drivers.rflex.wire_units import stop_commands

ROUND_S: Final = 0.1
"""Time from one round of commands to the next until the brake is as wanted, s."""
_BRAKE_S: Final = 1.0
"""Time after which the brake is set on a base that does not stand, s."""
_IGNORED: Final = 3
"""Rounds without effect after which a translation of 0 may be one that the hardware ignores."""
_SEEN_S: Final = 0.02
"""A status that comes so long after the first command reports what it did, s."""
_STILL_M_S, _STILL_RAD_S = 5e-3, 0.01
"""A base stands below these speeds; the least speed that the hardware takes is one count per second."""
_PUSHED_S: Final = 0.4
"""A base must follow so long after a base within its limits would, s."""
_PUSHED_M_S, _PUSHED_RAD_S = 0.05, 0.2
"""Commands below these speeds are too slow to judge by."""
_FOLLOWS: Final = 0.2
"""A base that does less than this share of what is commanded does not follow."""


class Mode(Enum):
    """What is wanted of the brake."""

    HALTING = "halting"
    HELD = "held"
    RELEASING = "releasing"
    RELEASED = "released"


class Brake:
    """Stops the base and then sets its brake, or releases it, and repeats that until the status reports it.

    The brake comes on when the base stands, or when it does not obey for long.
    """

    def __init__(self, config: RobotConfig) -> None:
        self.mode = Mode.HELD
        """What is wanted."""
        self.is_on: bool | None = None
        """What the last status reports; None before the first."""
        self.tries = 0
        """How often the brake was released without effect."""
        self._config = config
        self._round: list[Frame] = []
        """Commands of this round that are still to be sent."""
        self._rounds = 0
        """Rounds since another state was wanted."""
        self._began_s: float | None = None
        """When the first round of a halt began; None before."""
        self._round_s = self._set_s = -math.inf
        """When this round began, and when the brake was first set or released for that; inf before."""
        self._stands = False
        """Whether the base has reported that it stands."""

    @property
    def may_drive(self) -> bool:
        """Whether the brake was released, and is reported so."""
        return self.mode is Mode.RELEASED

    def halt(self) -> None:
        """Stop the base at once and set its brake."""
        self._start(Mode.HALTING)

    def release(self) -> None:
        """Release the brake."""
        self._start(Mode.RELEASING)
        self.tries = 0

    def forget(self) -> None:
        """Take back a release, as the line is lost; a halt goes on with the next line."""
        if self.mode is not Mode.HALTING:
            self.mode = Mode.HELD
        self._round, self.is_on = [], None
        self._began_s, self._round_s, self._set_s = None, -math.inf, math.inf

    def observe_speed(self, twist: Twist) -> None:
        """Take the velocity that the base reports."""
        stood, self._stands = self._stands, abs(twist.v) < _STILL_M_S and abs(twist.w) < _STILL_RAD_S
        if self.mode is Mode.HALTING and self._stands and not stood:
            self._round_s = -math.inf

    def observe_status(self, run_s: float, *, on: bool) -> None:
        """Take what the robot reports of its brake; whatever sets it, only a release takes it off again."""
        self.is_on = on
        has_effect = run_s - self._set_s >= _SEEN_S
        match self.mode:
            case Mode.HALTING if on and has_effect:
                self.mode, self._round = Mode.HELD, []
            case Mode.RELEASING if not on and has_effect:
                self.mode, self._round = Mode.RELEASED, []
            case Mode.RELEASED if on:
                self.mode = Mode.HELD
            case Mode.HELD if not on:
                self.halt()
            case _:
                pass

    def due(self, run_s: float) -> Frame | None:
        """Return the command to send now, and consider it sent; None if there is none."""
        if not self._round and run_s - self._round_s >= ROUND_S:
            self._begin_round(run_s)
        if not self._round:
            return None
        frame = self._round.pop(0)
        if frame in (BRAKE_SET, BRAKE_RELEASE) and math.isinf(self._set_s):
            self._set_s = run_s
        return frame

    def halting_s(self, run_s: float) -> float:
        """Return for how long the base has been halted and its brake not reported."""
        return run_s - self._began_s if self.mode is Mode.HALTING and self._began_s is not None else 0.0

    def _start(self, mode: Mode) -> None:
        """Want another state of the brake, from a first round of commands on, at once."""
        if self.mode is not mode:
            self.mode, self._began_s, self._rounds, self._stands = mode, None, 0, False
            self._set_s = math.inf
        self._round, self._round_s = [], -math.inf

    def _begin_round(self, run_s: float) -> None:
        """Choose the commands of the next round: what the state wanted needs, and a request for the status."""
        if self.mode is Mode.HALTING:
            if self._began_s is None:
                self._began_s = run_s
            is_ignored = not self._stands and self._rounds >= _IGNORED
            self._round = list(stop_commands(self._config, int(is_ignored and self._rounds % 2)))
            if self._stands or run_s - self._began_s >= _BRAKE_S:
                self._round.append(BRAKE_SET)
        elif self.mode is Mode.RELEASING:
            self.tries += 1
            self._round = [BRAKE_RELEASE]
        self._round.append(STATUS_REQUEST)
        self._rounds += 1
        self._round_s = run_s


class StallMonitor:
    """Finds a base that does not follow its commands, as one whose motors have failed or that is blocked.

    A model of the base follows the commands within the limits of its file. The base is stalled if it reports less
    than a share of what the model has done for a while: a command that has just grown says nothing yet.
    """

    def __init__(self, config: RobotConfig) -> None:
        self.is_stalled = False
        """Whether the last sample shows that."""
        self._body = config.body
        self._wanted = self._modelled = Twist(0.0, 0.0)
        """The velocity commanded, and that of the model."""
        self._run_s = 0.0
        """When they were computed, by the run's clock."""
        self._history: deque[tuple[float, Twist]] = deque()
        """Times and velocities of the model, of the last `_PUSHED_S` and one before."""

    def command(self, twist: Twist, run_s: float) -> None:
        """Take a velocity that is commanded."""
        self._model(run_s)
        self._wanted = twist

    def stop(self) -> None:
        """Take a stop."""
        self.is_stalled = False
        self._wanted = self._modelled = Twist(0.0, 0.0)
        self._history.clear()

    def observe(self, twist: Twist, run_s: float) -> None:
        """Take the velocity that the base reports."""
        self._model(run_s)
        history = self._history
        self.is_stalled = history[0][0] <= run_s - _PUSHED_S and (
            _lags(twist.v, [model.v for _, model in history], _PUSHED_M_S)
            or _lags(twist.w, [model.w for _, model in history], _PUSHED_RAD_S)
        )

    def _model(self, run_s: float) -> None:
        """Let the model obey until now, and keep its velocities of the last `_PUSHED_S`, and one before."""
        lasted_s, self._run_s = max(0.0, run_s - self._run_s), run_s
        self._modelled = obeyed(self._modelled, self._wanted, self._body, lasted_s)
        self._history.append((run_s, self._modelled))
        while len(self._history) > 1 and self._history[1][0] <= run_s - _PUSHED_S:
            self._history.popleft()


def _lags(reported: float, modelled: list[float], pushed: float) -> bool:
    """Return whether a base is slower than a share of all that the model did; slower ones than `pushed` may stick."""
    least, most = min(modelled), max(modelled)
    if least >= pushed:
        return reported < _FOLLOWS * least
    return most <= -pushed and reported > _FOLLOWS * most

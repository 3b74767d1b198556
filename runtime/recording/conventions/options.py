"""What a user may say about the conventions of a ring log; what is left at auto is decided from the data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from config.errors import WRONG_CALL, UserError
from config.robot import ECHO_LAG_MAX_S

Heading: TypeAlias = Literal[
    "auto",
    "ccw",
    "cw",
    "north-cw",
    "north-ccw",
    "y-down",
    "left-handed",
    "west-ccw",
    "west-cw",
    "south-ccw",
    "south-cw",
    "y-down-north-ccw",
    "y-down-north-cw",
    "y-down-west-ccw",
    "y-down-west-cw",
    "y-down-south-ccw",
    "y-down-south-cw",
]
AngleUnit: TypeAlias = Literal["auto", "rad", "deg"]
TimeUnit: TypeAlias = Literal["auto", "s", "ms", "us", "ns", "min", "h", "d"]
LengthUnit: TypeAlias = Literal["auto", "m", "cm", "mm", "in", "ft"]


@dataclass(frozen=True)
class RingLogOptions:
    """Ring logs: what their numbers mean, where the data do not say.

    Parameters
    ----------
    latched
        Ring logs: whether each row repeats the last value of every sensor, so that only changes are readings.
    heading
        Ring logs: how theta and y are counted: ccw (from x, y to the left), cw, north-cw (a compass), north-ccw,
        y-down (y to the right, theta counter-clockwise), left-handed (y to the right, theta from x to y); the others
        are counted from where their names say on a map whose x points east, with y north or down.
    sensor_order
        Ring logs: whether the columns follow the robot file (file) or run the other way round (mirrored).
    angle_unit
        Ring logs: unit of theta and ring_yaw.
    time_unit
        Ring logs: unit of t; d, days, as spreadsheets and MATLAB have them.
    length_unit
        Ring logs: unit of x and y.
    range_unit
        Ring logs: unit of the ranges.
    silence
        Ring logs: what stands for a sensor that fired and heard nothing: inf alone, nan, exactly a number as 0, -1 or
        7.6, or max, the narrow band at the top of the ranges. Numbers are in the file's unit.
    not_fired
        Ring logs: what stands for a sensor that did not fire in this row: empty (an empty cell alone), nan, inf, or
        exactly a number as 0 or -1.
    echo_lag
        Ring logs: time by which the ranges lag behind their rows' poses, s; below 0, the poses lag.
    """

    latched: Literal["auto", "yes", "no"] = "auto"
    heading: Heading = "auto"
    sensor_order: Literal["auto", "file", "mirrored"] = "auto"
    angle_unit: AngleUnit = "auto"
    time_unit: TimeUnit = "auto"
    length_unit: LengthUnit = "auto"
    range_unit: LengthUnit = "auto"
    silence: str = "auto"
    not_fired: str = "auto"
    echo_lag: str = "auto"

    @property
    def echo_lag_s(self) -> float | None:
        """The time by which ranges lag behind poses, s; None where the data decide."""
        return None if self.echo_lag == "auto" else float(self.echo_lag)

    def check(self) -> None:
        """Raise an error if `silence`, `not_fired` or `echo_lag` is neither a word nor a number.

        Raises
        ------
        UserError
            One is.
        """
        for name, value, words in (
            ("silence", self.silence, ("auto", "inf", "nan", "max")),
            ("not-fired", self.not_fired, ("auto", "empty", "nan", "inf")),
            ("echo-lag", self.echo_lag, ("auto",)),
        ):
            if value not in words and not _is_number(value):
                raise UserError(f"--{name} {value}: give {', '.join(words)} or a number, as 0 or -1", WRONG_CALL)
        if abs(self.echo_lag_s or 0.0) > ECHO_LAG_MAX_S:
            raise UserError(
                f"--echo-lag {self.echo_lag}: give seconds from -{ECHO_LAG_MAX_S} to {ECHO_LAG_MAX_S}", WRONG_CALL
            )

    def refuse_for(self, recording: str) -> None:
        """Raise an error if an option is given for a recording, whose conventions are known.

        Raises
        ------
        UserError
            One is.
        """
        given = [f"--{name.replace('_', '-')}" for name, value in vars(self).items() if value != "auto"]
        if given:
            raise UserError(f"{recording}: is a recording; {', '.join(given)} applies to ring logs only", WRONG_CALL)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


AUTO: Final = RingLogOptions()

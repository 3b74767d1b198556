"""What a user may say about the conventions of a ring log; what is left at auto is decided from the data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from config.errors import WRONG_CALL, UserError

Heading: TypeAlias = Literal["auto", "ccw", "cw", "north-cw", "north-ccw", "y-down", "left-handed"]
AngleUnit: TypeAlias = Literal["auto", "rad", "deg"]
TimeUnit: TypeAlias = Literal["auto", "s", "ms", "us"]
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
        y-down (y to the right, theta counter-clockwise), left-handed (y to the right, theta from x to y).
    sensor_order
        Ring logs: whether the columns follow the robot file (file) or run the other way round (mirrored).
    angle_unit
        Ring logs: unit of theta and ring_yaw.
    time_unit
        Ring logs: unit of t.
    length_unit
        Ring logs: unit of x and y.
    range_unit
        Ring logs: unit of the ranges.
    silence
        Ring logs: what stands for a sensor that fired and heard nothing: inf alone, nan, exactly a number as 0, -1 or
        7.6, or max, the narrow band at the top of the ranges. Numbers are in the file's unit.
    """

    latched: Literal["auto", "yes", "no"] = "auto"
    heading: Heading = "auto"
    sensor_order: Literal["auto", "file", "mirrored"] = "auto"
    angle_unit: AngleUnit = "auto"
    time_unit: TimeUnit = "auto"
    length_unit: LengthUnit = "auto"
    range_unit: LengthUnit = "auto"
    silence: str = "auto"

    def check(self) -> None:
        """Raise an error if `silence` is neither a word nor a number.

        Raises
        ------
        UserError
            It is not.
        """
        if self.silence in {"auto", "inf", "nan", "max"}:
            return
        try:
            number = float(self.silence)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise UserError(
                f"--silence {self.silence}: give auto, inf, nan, max or a number, as 0, -1 or 7.6", WRONG_CALL
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


AUTO: Final = RingLogOptions()

"""The watch on a ring that hears no echo: wires that carry none look like open space.

A pin that a 5 V echo destroyed, a ring without its supply, a ring under a cover: each firing reports silence. So
does open ground. A robot that has never heard an echo drives slowly (`runtime.cycle.unheard_limit`). If its ring
reaches far, so that it would hear any room, it is stopped once, after a short way, with what to try. Armed again
after such a way, it drives on, until it touches something.

Later the ring may fail, or freeze: then it hears nothing new. A line of the log says so once that has lasted for
longer than ever before in this run; a turn counts as well as a way, as it looks at something else. If old echoes came
until late in that silence, the robot drives slowly from there on until the next new echo: no honest ring does that
for long. What a silent ring heard last holds for as far as it reached then, and few sensors often hear nothing for
half a metre: after such a way it drives slowly, too. It does not stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from config.bounded import Coordinate
from drivers.messages import Firing, Odometry, Pose

WAY_MIN_M: Final = 1.0
"""Way without an echo since the start after which a robot stops whose ring reaches far, and after which any is taken
to be in the open if it is armed again, m."""
LONGER: Final = 2.0
LINE_MIN_M: Final = 0.5
"""A way without anything new is worth a line if it is so many times as long as any before, and this long, m: an
honest run gives at most four, as each doubles what the next one needs."""
TURN_M: Final = LINE_MIN_M / math.pi
"""Way that a turn by a radian counts as for such a line: half a turn looks at what lies on the other side."""
REPEATED_SHARE: Final = 0.5
"""Old echoes are repeated if the last one came after this share of a silence or later: a frozen ring repeats them to
the end, an honest one hears one again and is silent then."""
OPEN_M: Final = 4.0
"""Way and reach together at which a ring that hears nothing is stopped, m: from the middle of a room 8 m wide it has
come within reach of a wall by then. In the shipped room a reach of 1.7 m hears its first echo after 1.3 m. After the
first echo, this is the way without anything new after which it drives slowly: honest rings of 17 robots heard
something new after 2.0 m at most in rooms, and none drives farther than it can have heard."""
NOTHING_YET: Final = (
    "no sensor has heard an echo since the start: the robot drives slowly until one does; in the open that is right, "
    "else check the ring's power and cables"
)
_SLOWLY: Final = (
    "the robot drives slowly until it hears something new; in the open that is right, and it drives on as before "
    "once it is halted and re-armed; if anything stands within range, check the ring's power and cables (`echolocate "
    "ring-test --hand`)"
)
NOTHING_SO_FAR: Final = f"no sensor has heard an echo since the start, over more than {WAY_MIN_M:g} m: {_SLOWLY}"
NOTHING_NEW: Final = f"no sensor has heard anything new over the last {OPEN_M:g} m: {_SLOWLY}"


@dataclass(frozen=True, slots=True)
class EchoWatch:
    """How far the robot has driven without a new echo; immutable, as keyframes hold it."""

    is_over: bool = False
    """An echo was heard, or the robot was stopped for want of one."""
    way_m: Coordinate = 0.0
    """Driven since the start or since the ring heard anything new, at most `OPEN_M`, m."""
    turned_m: Coordinate = 0.0
    """Way that its turns in this silence count as, at most `OPEN_M`, m."""
    longest_m: Coordinate = 0.0
    """The longest such silence that an echo has ended, way and turns, m."""
    is_open: bool = False
    """The operator has armed the robot although the ring hears nothing: it is in the open until the next echo."""
    repeated_m: Coordinate = -1.0
    """Way and turns in this silence until an old echo was repeated last, m; below zero if none was."""
    at: Pose | None = None
    """Where the robot was by its newest odometry in this silence."""

    def observe(self, odometry: Odometry | None, firings: Sequence[Firing], *, hears_new: bool = True) -> EchoWatch:
        """Return the watch after a cycle.

        Parameters
        ----------
        odometry, firings
            What arrived in it.
        hears_new
            Whether an echo among them may be new: a frozen ring repeats old ones.
        """
        hears = any(math.isfinite(r) for firing in firings for r in firing.ranges_m.tolist())
        if hears and hears_new:
            if self.is_over and self.at is None and not self.is_open:
                return self
            return EchoWatch(is_over=True, longest_m=max(self.longest_m, self.searched_m if self.is_over else 0.0))
        if odometry is None or not firings:
            return self
        pose = odometry.pose
        at = pose if self.at is None else self.at
        way_m = self.way_m + math.dist((pose.x, pose.y), (at.x, at.y))
        turned_m = self.turned_m + TURN_M * abs(math.remainder(pose.theta - at.theta, math.tau))
        watch = replace(
            self, is_over=self.is_over or hears, way_m=min(way_m, OPEN_M), turned_m=min(turned_m, OPEN_M), at=pose
        )
        return replace(watch, repeated_m=watch.searched_m) if hears else watch

    @property
    def searched_m(self) -> float:
        """Way and turns in this silence, m."""
        return self.way_m + self.turned_m

    def armed(self) -> EchoWatch:
        """Return the watch after the robot was armed, by an operator who has seen where it stands."""
        if not self.is_over:
            return EchoWatch(is_over=True, is_open=True) if self.way_m >= WAY_MIN_M else self
        return replace(self, is_open=self.is_open or self.slow_reason is not None)

    def touched(self) -> EchoWatch:
        """Return the watch after a contact: a ring that heard nothing is not known to hear, and nothing is open."""
        if self.longest_m > 0.0:  # an echo has ended a silence
            return replace(self, is_open=False)
        return EchoWatch() if self.is_open or not self.is_over else self

    @property
    def slow_reason(self) -> str | None:
        """Why the robot must drive slowly; None if it need not."""
        if not self.is_over:
            return NOTHING_YET if self.way_m < WAY_MIN_M else NOTHING_SO_FAR
        return self.silence if self._repeats or self.way_m >= OPEN_M else None

    @property
    def _repeats(self) -> bool:
        """Whether the last old echo came in the later part of this silence."""
        return self.repeated_m >= REPEATED_SHARE * self.searched_m

    @property
    def silence(self) -> str | None:
        """What to check where the ring has long heard nothing new, after its first echo or that stop; or None."""
        least_m = min(max(LINE_MIN_M, LONGER * self.longest_m), OPEN_M)
        if not self.is_over or self.is_open or self.searched_m < least_m:
            return None
        if self.way_m >= OPEN_M:
            return NOTHING_NEW
        over = (
            f"over the last {least_m:.1f} m, in this run never before for so long (half a turn counts as "
            f"{LINE_MIN_M:g} m)"
        )
        if self._repeats:
            return f"all echoes are old ones, repeated {over}: {_SLOWLY}"
        return (
            f"no sensor has heard anything new {over}: if anything stands within range, halt the robot and check the "
            f"ring's power and cables"
        )

    def stopped(self, reach_m: float, problem: str | None = None) -> tuple[EchoWatch, str | None]:
        """Return the watch, and why a robot whose ring reaches so far, m, must stop; then it is over.

        Another problem comes first. A ring of less reach often hears nothing: it does not stop, it drives slowly on.
        """
        reaches_far = reach_m >= OPEN_M - WAY_MIN_M
        if problem is not None or self.is_over or not reaches_far or self.way_m < WAY_MIN_M:
            return self, problem
        return EchoWatch(is_over=True, is_open=True), (
            f"no sensor has heard an echo since the start, over {self.way_m:.1f} m: if anything stands within range, "
            f"check the sensors' supply, the wires of trigger and echo, and what covers the ring (`echolocate "
            f"ring-test --hand` shows which), then re-arm; in the open re-arm and it drives on"
        )

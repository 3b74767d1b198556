"""The units of a ring log's times, positions and ranges, by what the robot can do and its ring can hear.

Each combination of units has a log-likelihood: the firing period, the speed and the turning rate against the robot's,
the ranges against the ring's reach and resolution, and, where the robot drove towards something, how much a range
changes with the distance driven. The last knows no scale but measures the ratio of the two units.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np

from config.robot import RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.headings import sureness
from runtime.recording.conventions.options import RingLogOptions
from runtime.recording.conventions.silence import Silence
from runtime.recording.conventions.table import ANGLES, LENGTHS, TIMES, Table
from runtime.recording.conventions.way_ratios import PAIR_LN
from runtime.recording.ring_log import RingLogError

SURE_NAT: Final = 12.0
"""By how much other units than metres and seconds must be more likely. An honest log of a robot that crawls, or rests
between its firings, is a few nats less likely than one in feet."""
APART_NAT: Final = 4.0
"""By how much the second best units must be less likely than the best."""
PROOF_NAT: Final = SURE_NAT + APART_NAT
"""Of a fact that decides alone: it outweighs metres, and every rival."""
METRES_NAT: Final = 6.0
"""Odds on positions and ranges in metres, as most logs have them, where t is in another unit."""
RIVAL_NAT: Final = 20.0
"""Units less likely by this are left out."""
WORSE: Final = 3.0
"""Standard errors from which echoes speak against units that are too small."""
DOUBT_NAT: Final = 8.0
"""The most that echoes say against units: wide beams blur them, and in 40 drives those of the right units were worse
than those of units 2.54 times as large by up to 7.6 standard errors."""
IMPOSSIBLE_NAT: Final = -60.0
PERIOD_LN, SPEED_LN, REACH_LN = 1.5, 1.0, 0.8
"""Spreads of the logarithms of the row's period, the speed and the farthest echo, over the robot's."""
FAST, TURNS_FAST = 3.0, 5.0
"""A median speed or turning rate over the robot's greatest by this is impossible: odometry leaps, but not always."""
USUAL_SPEED, USUAL_REACH = 0.4, 0.6
"""The most likely median speed and farthest echo, over the robot's greatest ones."""
FARTHEST: Final = 0.95
"""The farthest echo is this quantile of the ranges."""
FAR: Final = 1.2
"""Ranges beyond the ring's greatest one by this factor are impossible."""
FAR_SHARE: Final = 0.1
"""Share of the ranges that may be such, as glitches."""
FAR_NAT: Final = 20.0
"""Evidence against units in which all ranges would be such; in proportion where only some are."""
CEILING_SAME: Final = 0.05
"""A limit of the ranges is the ring's greatest one if it differs by less, as a share of it: noise is some per cent,
and units differ by more than a factor of two."""
RESOLUTION_MIN_M: Final = 0.01
"""Finer resolutions of a ring are lost among the file's decimals."""
MULTIPLES_OFF: Final = 0.1
"""Ranges are multiples of the resolution if they are off by less of it in the mean square; any would be by 0.29."""
EDGE: Final = 0.02
"""Width in which ranges end at the ring's greatest one, as a share of it."""
EDGE_NAT: Final = 4.3
"""Log of how rarely they end there by chance: where they do is a matter of the room, over a factor of 4 or so."""
EDGE_GLITCHES: Final = 0.05
"""Share of the ranges about the greatest one that may lie beyond it."""
PAIRS_WEIGHT: Final = 0.2
"""What a pair counts, as neighbouring ones share an echo."""
PAIRS_MAX: Final = 150
"""All pairs together count no more than so many."""
PAIRS_BIAS_LN: Final = 0.14
"""Spread of the logarithm of the ratio that most pairs of a log share. A wide beam sees a surface aslant: in 30
drives it was between -0.30 and 0.26."""
PAIRS_BIASES: Final = np.linspace(-3.0, 3.0, 61)
"""Where this bias is looked at, in its standard deviations."""
DENSE: Final = 0.5
"""Rows closer than this share of the ring's steps may be in minutes, which else would excuse all that is too fast."""
IMPERIAL: Final = ("in", "ft")
TWICE: Final = 2.0
"""Ranges change by this much of the way where the whole path of the sound was written down, there and back."""
TWICE_NAT: Final = 1.0
"""By how much this must be more likely than units of two systems: inches beside cm, by 2.54, gain 1.5 at most."""
STEPS_MIN: Final = 30
"""Steps on which a speed or a rate rests."""
ECHOES_MIN: Final = 50
"""Echoes on which what is said of ranges rests."""


class Units(NamedTuple):
    """A combination of units by name: t, x and y, ranges."""

    time: str = "s"
    length: str = "m"
    range_: str = "m"

    @property
    def words(self) -> str:
        """What is in which unit, and the options that say so."""
        return f"t in {self.time}, x and y in {self.length}, ranges in {self.range_}"

    @property
    def options(self) -> str:
        """The options that set them."""
        return f"--time-unit {self.time} --length-unit {self.length} --range-unit {self.range_}"


def find_units(
    table: Table, silence: Silence, robot: RobotConfig, options: RingLogOptions, angle: str, ratios: Floats
) -> tuple[Units, dict[Units, float]]:
    """Return the units of times, positions and ranges, and the log-likelihood of each combination.

    Parameters
    ----------
    table : Table
        With NaN and inf where nothing was heard.
    silence : Silence
        Of the ranges.
    robot : RobotConfig
        The robot that the log is said to be of.
    options : RingLogOptions
        What is known.
    angle : str
        Unit of the angles.
    ratios : (k,) float
        Of `way_ratios`.

    Raises
    ------
    RingLogError
        No combination fits the robot, or several do.
    """
    given, facts = (options.time_unit, options.length_unit, options.range_unit), _Facts.of(table, silence, angle)
    known = (_times(facts.period, robot.ring.firing.step_period_s), LENGTHS, LENGTHS)
    choices = [Units(*one) for one in itertools.product(*map(_choice, given, known))]
    if len(choices) == 1:
        return choices[0], {choices[0]: 0.0}
    ways = {pair: _way_score(ratios, LENGTHS[pair[0]] / LENGTHS[pair[1]]) for pair in {one[1:] for one in choices}}
    scores = {units: _units_score(units, facts, robot) + ways[units[1:]] for units in choices}
    best = max(scores, key=scores.__getitem__)
    default = Units(*(_choice(one, [plain])[0] for one, plain in zip(given, Units(), strict=True)))
    if scores[default] > scores[best] - SURE_NAT:
        best = default
    rate_rad_s = facts.rate / TIMES[best.time]
    if options.angle_unit == "auto" and rate_rad_s > TURNS_FAST * robot.body.turn_max_rad_s:
        raise RingLogError(
            f"{_too_fast(rate_rad_s, robot)}: say --angle-unit deg if it is in degrees, or give it in radians"
        )
    if "auto" in given[1:]:
        _check_ways(best, ratios)
    if best == default:
        return default, scores
    reason = _reason(default, best, facts, robot)
    if _contradictions(best, facts, robot):
        raise RingLogError(reason)
    near = (units for units in choices if units != best and scores[units] > scores[best] - APART_NAT)
    rivals = [units for units in near if not _is_same(units, best, facts)]
    if rivals:
        names = " or ".join(f"{units.words} ({units.options})" for units in [best, *rivals[:2]])
        raise RingLogError(f"cannot have {default.words} ({reason}); it may have {names}")
    return best, scores


def check_scale(units: Units, scores: dict[Units, float], echoes: Callable[[Units], Floats]) -> None:
    """Raise an error unless the echoes and what the robot can do leave one combination of units.

    The place of the sensors on the robot is known in metres. In units that are too small it is too large in the
    file's numbers, and echoes of one surface fall apart as the robot turns. Units that are too large only blur them.

    Parameters
    ----------
    units : Units
        The combination to confirm.
    scores : dict
        Of `find_units`.
    echoes : callable
        Returns how well earlier echoes explain later ones under units, in blocks of time.

    Raises
    ------
    RingLogError
        Others are as likely; the text names the options.
    """
    plain = {one: score - METRES_NAT * (one.length == one.range_ == "m") for one, score in scores.items()}
    near = [one for one, score in plain.items() if score > plain[units] - RIVAL_NAT or one == units]
    found = {(one.length, one.range_): echoes(one) for one in near}
    for one in near:
        reach = LENGTHS[one.range_]
        larger = [blocks for (_, range_), blocks in found.items() if LENGTHS[range_] > reach]
        worse = max((sureness(blocks, found[one.length, one.range_]) for blocks in larger), default=0.0)
        if worse > WORSE:
            plain[one] -= min(0.5 * worse**2, DOUBT_NAT)
    rivals = [one for one in near if one[1:] != units[1:] and plain[one] > plain[units] - APART_NAT]
    if rivals:
        rivals.sort(key=plain.__getitem__, reverse=True)
        names = " or ".join(f"{one.words} ({one.options})" for one in [units, *rivals[:2]])
        raise RingLogError(f"is in other conventions than a ring log's, and its units are open: it may have {names}")


def _choice(given: str, known: Iterable[str]) -> list[str]:
    return [given] if given != "auto" else list(known)


def _times(period: float, step_s: float) -> list[str]:
    return [name for name, unit in TIMES.items() if unit <= 1.0 or period < DENSE * step_s]


class _Facts(NamedTuple):
    """What the file's numbers show, in its own units of time and length."""

    period: float
    """Median time between rows."""
    speed: float
    """Median of the speeds where it moved; 0 if it did not."""
    rate: float
    """Median turning rate where it turned, rad per unit of time."""
    echoes: Floats
    """(k,): all ranges that are echoes."""
    ceiling: float | None
    """The range that stands for silence, if it is the most that the ring reports; None otherwise."""

    @staticmethod
    def of(table: Table, silence: Silence, angle: str) -> _Facts:
        """Return the facts of a table whose angles are in the unit `angle`; a rate or speed of few steps is 0."""
        dt = np.diff(table.t)
        gaps = dt[dt > 0.0]
        period = float(np.median(gaps)) if len(gaps) else 0.0
        step = np.maximum(dt, 1e-12)
        moved = np.hypot(*np.diff(table.pose[:, :2], axis=0).T)
        turned = np.abs(np.diff(table.pose[:, 2])) * ANGLES[angle]
        turned = np.abs((turned + math.pi) % (2.0 * math.pi) - math.pi)
        rows = (dt > 0.0) & (moved > 0.0)
        speed = float(np.median(moved[rows] / step[rows])) if rows.sum() >= STEPS_MIN else 0.0
        turns = (dt > 0.0) & (turned > 1e-6)
        rate = float(np.median(turned[turns] / step[turns])) if turns.sum() >= STEPS_MIN else 0.0
        ceiling = silence.centre if silence.is_top else None
        return _Facts(period, speed, rate, table.ranges[np.isfinite(table.ranges)], ceiling)


def _check_ways(units: Units, ratios: Floats) -> None:
    """Raise an error if ranges are the whole path of the sound: surely, or more likely than units of two systems."""
    expected = LENGTHS[units.length] / LENGTHS[units.range_]
    is_mixed = (units.length in IMPERIAL) != (units.range_ in IMPERIAL)
    surely = _way_score(ratios, expected) + (TWICE_NAT if is_mixed else PROOF_NAT)
    if len(ratios) and max(_way_score(ratios, TWICE * one) for one in (expected, 1.0)) > surely:
        raise RingLogError(
            f"ranges change by {float(np.median(ratios)):.2g} for each unit of the way to what is heard: halve them "
            "if they are the whole path of the sound, there and back; correct x and y if these are too small; or say "
            f"{units.options} if both are right"
        )


def _way_score(ratios: Floats, expected: float) -> float:
    """Return the log-likelihood of ratios of range to way, all of them with one unknown bias."""
    if not len(ratios):
        return 0.0
    ratios = ratios[:: 1 + int(PAIRS_WEIGHT * len(ratios) / PAIRS_MAX)]
    off = np.log(ratios) - math.log(expected) - PAIRS_BIAS_LN * PAIRS_BIASES[:, None]
    fits = np.exp(-0.5 * (off / PAIR_LN) ** 2) / (PAIR_LN * math.sqrt(2.0 * math.pi))
    weight = min(PAIRS_WEIGHT, PAIRS_MAX / len(ratios))
    scores = weight * np.log(0.3 * fits + 0.7 * 0.1).sum(axis=1) - 0.5 * PAIRS_BIASES**2
    return float(np.logaddexp.reduce(scores) - np.logaddexp.reduce(-0.5 * PAIRS_BIASES**2))


def _units_score(units: Units, facts: _Facts, robot: RobotConfig) -> float:
    """Return the log-likelihood of units but for the ratios of range to way."""
    body, ring = robot.body, robot.ring
    t, length, range_ = TIMES[units.time], LENGTHS[units.length], LENGTHS[units.range_]
    score = METRES_NAT * (units.length == units.range_ == "m")
    score += IMPOSSIBLE_NAT * len(_contradictions(units, facts, robot))
    score += _ln_normal(facts.period * t / ring.firing.step_period_s, PERIOD_LN)
    score += _ln_normal(facts.speed * length / t / body.speed_max_m_s / USUAL_SPEED, SPEED_LN)
    if len(facts.echoes) >= ECHOES_MIN:
        score += _range_score(facts, range_, robot)
    return score


def _contradictions(units: Units, facts: _Facts, robot: RobotConfig) -> list[str]:
    """Return what this robot cannot have in these units, a clause each: ranges, speed, turning rate."""
    body, ring = robot.body, robot.ring
    t, echoes = TIMES[units.time], LENGTHS[units.range_] * facts.echoes
    found = list[str]()
    if len(echoes) >= ECHOES_MIN:
        far = float((echoes > FAR * ring.range_max_m).mean())
        if far > FAR_SHARE:
            found.append(
                f"{100 * far:.0f} % of the ranges are beyond ring.range_max_m {ring.range_max_m:g}, the greatest is "
                f"{float(echoes.max()):g}"
            )
        near = float((echoes < 0.5 * ring.range_min_m).mean())
        if near > 0.5:
            found.append(f"{100 * near:.0f} % of the ranges are below half of ring.range_min_m {ring.range_min_m:g}")
    speed_m_s, rate_rad_s = facts.speed * LENGTHS[units.length] / t, facts.rate / t
    if speed_m_s > FAST * body.speed_max_m_s:
        found.append(
            f"x and y move at {speed_m_s:.3g} m/s, and this robot's body.speed_max_m_s is {body.speed_max_m_s:g}"
        )
    if rate_rad_s > TURNS_FAST * body.turn_max_rad_s:
        found.append(_too_fast(rate_rad_s, robot))
    return found


def _range_score(facts: _Facts, unit: float, robot: RobotConfig) -> float:
    """Return the log-likelihood (nat) of the echoes if one unit of the file's ranges is `unit` metres.

    It adds up how many lie beyond the ring's reach, how far the farthest lie, whether they end at the ring's greatest
    range, and whether they are multiples of its resolution, from the first on. There must be an echo.
    """
    ring = robot.ring
    echoes = unit * facts.echoes
    far = float((echoes > FAR * ring.range_max_m).mean())
    farthest = float(np.quantile(echoes, FARTHEST)) / ring.range_max_m
    score = -FAR_NAT * far + _ln_normal(farthest / USUAL_REACH, REACH_LN)
    if facts.ceiling is not None and abs(unit * facts.ceiling / ring.range_max_m - 1.0) < CEILING_SAME:
        score += PROOF_NAT
    else:
        score += _edge_score(echoes / ring.range_max_m)
    if ring.resolution_m >= RESOLUTION_MIN_M:
        steps = echoes / ring.resolution_m
        off = float(np.sqrt(np.mean((steps - np.maximum(np.round(steps), 1.0)) ** 2)))
        score += PROOF_NAT * (off < MULTIPLES_OFF)
    return score


def _edge_score(shares: Floats) -> float:
    """Return the evidence that ranges, as shares of the ring's greatest one, end there."""
    below = np.count_nonzero(np.abs(shares - 1.0 + 0.5 * EDGE) <= 0.5 * EDGE)
    above = np.count_nonzero(np.abs(shares - 1.0 - 0.5 * EDGE) < 0.5 * EDGE)
    score = below * math.log((1.0 - EDGE_GLITCHES) / 0.5) + above * math.log(EDGE_GLITCHES / 0.5)
    return min(max(PAIRS_WEIGHT * score, 0.0), EDGE_NAT)  # as of pairs, neighbouring readings are of one echo


def _ln_normal(ratio: float, spread: float) -> float:
    """Return the log of a normal density of the ratio's logarithm, over that at a ratio of 1; 0 for a ratio of 0."""
    return -0.5 * (math.log(ratio) / spread) ** 2 if ratio > 0.0 else 0.0


def _is_same(one: Units, other: Units, facts: _Facts) -> bool:
    """Return whether units differ only in what the file does not show."""
    return (
        (one.time == other.time or facts.period == 0.0)
        and (one.length == other.length or facts.speed == 0.0)
        and (one.range_ == other.range_ or len(facts.echoes) == 0)
    )


def _reason(default: Units, best: Units, facts: _Facts, robot: RobotConfig) -> str:
    """Return in a clause why a file is in the best units and not in the default ones."""
    if contradictions := _contradictions(default, facts, robot):
        return contradictions[0]
    if best.time != default.time:
        period_s, usual_s = facts.period * TIMES[default.time], robot.ring.firing.step_period_s
        return f"the firings are {period_s:.3g} s apart, and this robot's are {usual_s:g}"
    return "the ranges fit this robot's ring, or the way that it drove, far better in other units"


def _too_fast(rate_rad_s: float, robot: RobotConfig) -> str:
    limit = robot.body.turn_max_rad_s
    return f"theta turns at {rate_rad_s:.3g} rad/s, and this robot's body.turn_max_rad_s is {limit:g}"

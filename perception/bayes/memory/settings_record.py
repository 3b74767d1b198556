"""The settings record, which kernels read and never change.

It has the same layout for every ring, library and configuration. A kernel is compiled for a layout, so adding a model
at run time compiles nothing. Lists of variable length have a capacity, and `kernel_settings` refuses what exceeds it.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias

from config.model import VERTICES_MAX
from config.robot import LISTEN_MAX_M
from config.units import FOOT_M
from perception.bayes.memory.parameters import NOISE_ABSOLUTE_M, NOISE_RELATIVE
from perception.kernel import Floats, Ints
from perception.records import Record, Records

CIRCLES_MAX: Final = 64
"""Greatest number of radii: round models and their rivals."""
POLYGONS_MAX: Final = CIRCLES_MAX
"""Polygon models."""
CHORDS: Final = 10
"""Chords by which a circle is relaxed onto the map."""
TABLE_LEVELS: Final = 24
"""Noise levels of the table, spaced geometrically: 32 % apart over .001 to .6 ft, finer than the accuracy of σ."""
TABLE_BINS: Final = 129
"""Bins of an error in the table; see `perception.bayes.inference.likelihood`."""
NOISES: Final = len(NOISE_ABSOLUTE_M) * len(NOISE_RELATIVE)
"""Noise hypotheses: each absolute one with each relative one."""
RANGE_BINS_PER_M: Final = 2.0 / FOOT_M
"""Range bins per metre; within a bin a noise hypothesis has one level."""
RANGE_BINS: Final = math.ceil(LISTEN_MAX_M * RANGE_BINS_PER_M)
"""Ranges that are distinguished in a table of noise levels."""


class NoiseModel(Record):
    """A noise hypothesis: σ² = absolute² + (relative · range)²."""

    absolute_m: float
    relative: float
    levels: Annotated[Ints, RANGE_BINS]
    """Level of the table by range bin."""


class CircleModel(Record):
    """A radius that may explain a track."""

    radius_m: float
    chords: Annotated[Floats, CHORDS, 4]
    """Middle x, y (m), direction (rad), length (m) of each side, as `perception.relaxation` takes them."""


class PolygonSide(Record):
    """A side of a polygon in its own frame; of an open outline's last vertex only x and y are set."""

    x: float
    """Its start, m."""
    y: float
    tangent_x: float
    """Unit direction; a closed outline runs counter-clockwise."""
    tangent_y: float
    length: float
    """m"""


class PolygonModel(Record):
    """An outline that may explain a track."""

    vertex_count: int
    side_count: int
    is_closed: int
    """1 where the last side joins the first, else 0."""
    symmetry: int
    """Order of the rotational symmetry."""
    inner_radius_m: float
    """Distance of the nearest side from the origin, and at least half the outline's least width."""
    outer_radius_m: float
    """Distance of the farthest vertex from the origin."""
    sides: Annotated[Records[PolygonSide], VERTICES_MAX]
    relaxation_sides: Annotated[Floats, VERTICES_MAX, 4]
    """The same as `perception.relaxation` takes them: middle x, y (m), direction (rad), length (m)."""


class Settings(Record):
    """The method's settings; `perception.bayes.memory.parameters` gives the source of each value."""

    half_angle_rad: float
    """Half the beam's opening."""
    cos_half_angle: float
    sin_half_angle: float
    cos_may_answer: float
    """Cosine of a little more than half the opening: beyond this angle a reading does not count."""
    cos_must_answer: float
    """Cosine of a little less than half the opening: within this angle a reading must hit."""
    sin_must_answer: float
    half_resolution_m: float
    """A range is rounded by at most this."""
    range_min_m: float
    """The ring measures no shorter range: what is nearer has this one, too."""
    range_max_m: float
    gate_m: float
    """A range this near to the predicted one is attributed to the object."""
    missed_echo_nat: float
    """Log probability of a reading that should have hit and passed through."""
    short_echo_nat: float
    """Log probability of an unseen object in front."""
    unknown_nat: float
    """Evidence of an unknown object for each near reading, against a circle."""
    unknown_polygon_nat: float
    """The same against a polygon."""
    model_prior_nat: float
    """Log prior of a known model over every other explanation."""
    dispersion_min: float
    """Least dispersion of the axes of the sensors that heard an object."""
    far_m: float
    """Distance beyond which an object's prior as a model falls, if it was heard only from there."""
    far_nat_per_m: float
    roughness_gate_nat: float
    """Noises less likely than the best by this, by roughness, are ruled out."""
    pair_range_max_m: float
    """Segments farther than this start no hypotheses, and silence from farther is not evidence."""
    history_spacing_m: float
    """Least distance between consecutive readings of a sensor's history."""
    pair_gap_s: float
    """Readings further apart in time than this make no segment."""
    merge_m: float
    """Two centres nearer than this are one object."""
    compare_all_below: int
    """With fewer readings than this each refinement compares all alternatives."""
    attempts_per_firing: int
    """Segments examined for hypotheses per firing."""
    hypothesis_sigma_m: float
    """Greatest standard deviation of the centre behind a segment that starts a hypothesis."""
    report_probability: float
    """A model is reported by name from this probability on."""
    report_probability_near: float
    """The same where it was heard from within `far_m`."""
    idle_firings: int
    """Firings without new evidence after which a track gets its final refinements."""
    final_refinements: int
    """Number of final refinements of an idle track."""
    table: Annotated[Floats, TABLE_LEVELS, TABLE_BINS]
    """Log likelihood ratios (nat) by noise level and error; see `inference.likelihood.build_table`."""
    table_bins_per_m: Annotated[Floats, TABLE_LEVELS]
    silent_share_min: float
    """Share of silent readings below which surfaces answer at any angle."""
    noises: Annotated[Records[NoiseModel], NOISES]
    model_count: int
    """Number of models: the first circles, in ascending order; the others are rivals."""
    circle_count: int
    circles: Annotated[Records[CircleModel], CIRCLES_MAX]
    polygon_count: int
    polygons: Annotated[Records[PolygonModel], POLYGONS_MAX]


SettingsRecord: TypeAlias = Records[Settings]
"""The settings as kernels take them: one record."""

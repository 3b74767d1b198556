"""Records of the work on polygons: requests for new hypotheses, and the progress of the current job.

Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Final

from perception.bayes.memory.elements import (
    MAX_POLYGONS,
    POLYGON_BEARING_BINS,
    POLYGON_BIN_CAPACITY,
    LowerTriangle,
    Pose,
)
from perception.bayes.memory.polygon_parameters import LATTICE_ATTEMPTS
from perception.bayes.memory.settings_record import NOISES, POLYGONS_MAX
from perception.bounds import FINITE, POSITIVE, Bound, Count, Finite, Flag, Place, index_of, up_to
from perception.records import Record

NO_JOB, INITIATION, REFINEMENT = range(3)
"""Values of `PolygonJob.kind`."""
ASSIGN, SEARCH_WIDE, RESTART, SEARCH_NEAR, JUDGE, LATTICE = range(6)
"""Stages of a refinement, values of `PolygonJob.stage`. The stages of an initiation are fewer."""
ALONG, ACROSS, TURN, AXES = range(4)
"""Axes of a search: along and across the body, and turn; and their number."""
JOB_READINGS: Final = POLYGON_BEARING_BINS * POLYGON_BIN_CAPACITY
"""Readings of the track that is refined."""
STEPS_MAX: Final = 4096
"""The longest stage of a job has a few hundred steps, a search a few dozen rounds."""


class PolygonRequest(Record):
    """A request for a polygon hypothesis behind a segment."""

    model: Annotated[int, index_of(POLYGONS_MAX)]
    x: Place
    y: Place
    normal_x: Place
    normal_y: Place
    is_done: Flag


class PoseSearch(Record):
    """A search for the pose of greatest likelihood; see `polygons.likelihood.search`."""

    x: Place
    y: Place
    heading: Place
    log_likelihood_ratio: Finite
    """At that pose, nat."""
    step_m: Place
    trial: Annotated[int, Bound(-1, 2 * AXES - 1)]
    """The next trial; −1 before the first score."""
    rounds_left: Annotated[int, up_to(STEPS_MAX)]
    has_gained: Flag
    """1 where this round gained."""


class LatticeMoments(Record):
    """Mass, first and second moments of a likelihood on a lattice, in pitches along the frame's axes a, b, c."""

    mass: Annotated[float, POSITIVE]
    a: Finite
    b: Finite
    c: Finite
    aa: Finite
    ab: Finite
    bb: Finite
    ac: Finite
    bc: Finite
    cc: Finite


class PolygonJob(Record):
    """The current job on polygons and its progress; see `perception.bayes.polygons.job`."""

    kind: Annotated[int, Bound(NO_JOB, REFINEMENT)]
    stage: Annotated[int, up_to(LATTICE)]
    track: Annotated[int, index_of(MAX_POLYGONS)]
    """The track that a job of refinement works on."""
    model: Annotated[int, index_of(POLYGONS_MAX)]
    """The model that another job tries."""
    reading_count: Annotated[int, up_to(JOB_READINGS)]
    reading_step: Annotated[int, up_to(JOB_READINGS)]
    """Step between the readings that a search scores."""
    noise_level: Annotated[int, index_of(NOISES)]
    """Noise assumed when the job began."""
    next_step: Annotated[int, up_to(STEPS_MAX)]
    """Progress within the stage."""
    lattices: Annotated[int, up_to(LATTICE_ATTEMPTS)]
    """Lattices laid."""
    refines_next: Flag
    """Turn of refinements (1) and of new hypotheses (0)."""
    requests_made: Count
    search: PoseSearch
    best: Pose
    """Best pose of several searches."""
    best_nat: Annotated[float, FINITE._replace(infinite=True)]
    """Its log likelihood ratio."""
    segment_x: Place
    """The segment behind which a hypothesis is tried."""
    segment_y: Place
    segment_normal_x: Place
    segment_normal_y: Place
    middle: Pose
    """Middle of the lattice, or of the restarts."""
    middle_nat: Finite
    """Log likelihood ratio there."""
    root: LowerTriangle
    """The lattice's frame: lower root of one pitch."""
    covariance: LowerTriangle
    moments: LatticeMoments

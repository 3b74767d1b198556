"""Memory of the Bayesian method: records of a fixed layout, allocated once and never resized.

Kernels call them `s` (one `State`), `tracks` (circles, as many as the configuration allows) and `p` (one `Settings`
record of `perception.bayes.settings_record`). Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, TypeAlias

import numpy as np

from config.robot import SENSORS_MAX
from perception.bayes.elements import (
    ALTERNATIVES_MAX,
    ATTRACTING_MAX,
    BEARING_BINS,
    BIN_CAPACITY,
    BUCKET_CAPACITY,
    BUCKETS,
    CROSS_HISTORY,
    HISTORY,
    MAX_LINES,
    MAX_POLYGONS,
    MAX_TRACKS,
    POLYGON_BEARING_BINS,
    POLYGON_BIN_CAPACITY,
    REJECTIONS_MAX,
    REQUESTS_MAX,
    LowerTriangle,
    MappedSegment,
    Pose,
    Reading,
)
from perception.bayes.parameters import START_NOISE, START_NOISE_NAT
from perception.bayes.scratch import Scratch
from perception.bayes.settings_record import NOISES
from perception.bayes.wall_records import WallMap
from perception.kernel import Floats, Ints
from perception.records import Record, Records, records, zeros

FREE, TENTATIVE, ESTABLISHED = range(3)
"""Values of `Track.status`."""
CONFIRMED: Final = 1
PLACED: Final = 2
"""Bits of `Track.marks`: a user confirmed the object; a user placed it, and readings do not support it yet."""


class Sensor(Record):
    """Memory of one sensor."""

    history: Annotated[Records[Reading], HISTORY]
    """A ring buffer of spaced readings, hits and silences."""
    times_s: Annotated[Floats, HISTORY]
    kept: int
    """Readings ever put there."""
    last: Reading
    """The last reading that was not redundant."""
    crossed: Reading
    """Where it stood when others last listened to it; without a range."""


class Bucket(Record):
    """The segments of one cell of the map."""

    cell_x: int
    cell_y: int
    count: int
    """Segments put in since the cell took the bucket."""
    segments: Annotated[Records[MappedSegment], BUCKET_CAPACITY]


class Line(Record):
    """A wall, or a line that may become one; its normal and distance refer to a local origin."""

    normal_x: float
    normal_y: float
    distance: float
    """From the origin along the normal, m."""
    origin_x: float
    origin_y: float
    variance_angle: float
    """rad²"""
    covariance: float
    """m·rad"""
    variance_distance: float
    """m²"""
    low: float
    """Extent along the line, m."""
    high: float
    log_odds: float
    """Log odds that it is still there."""
    echoes: float
    """Echoes that it explained; 0 where the place is free."""


class CircleBin(Record):
    """The readings that a circle keeps of one direction."""

    count: int
    """Readings ever put in."""
    readings: Annotated[Records[Reading], BIN_CAPACITY]


class PolygonBin(Record):
    """The readings that a polygon keeps of one direction."""

    count: int
    readings: Annotated[Records[Reading], POLYGON_BIN_CAPACITY]


class Track(Record):
    """Fields that circle and polygon tracks have in common."""

    status: int
    """`FREE`, `TENTATIVE` or `ESTABLISHED`."""
    unseen: int
    """Readings since the last refinement."""
    reservoir: int
    """Readings that bore on it at the last refinement."""
    refinements: int
    idle_firings: int
    """Firings without new evidence."""
    final_refinements: int
    """Refinements still due once it is idle."""
    passed_over: int
    """Quanta that went to other tracks since its last one."""
    number: int
    """Number that users see."""
    marks: int
    """Sum of `CONFIRMED` and `PLACED`."""
    x: float
    y: float
    log_likelihood_ratio: float
    """Evidence against the background, nat."""
    hits: float
    near: float
    """Readings within the gate."""
    probability: float
    """Existence probability: this explanation against all others."""


class CircleTrack(Track):
    """Track of a round object."""

    kind: int
    """Index of its radius in `Settings.circles`."""
    alternative: int
    """Index of the alternative that was compared last."""
    is_named: int
    """1 while it is reported as a model."""
    radius: float
    root_xx: float
    """Lower Cholesky root of the covariance from which the next grid starts, m."""
    root_yx: float
    root_yy: float
    covariance_xx: float
    """m²"""
    covariance_xy: float
    covariance_yy: float
    misses: float
    """Readings that should have hit and passed through."""
    dispersion: float
    """Dispersion of the axes of the sensors that heard it."""
    unknown_nat: float
    """Evidence of an unknown object in its place."""
    misfit: float
    """Shortfall of its hits' log likelihood from what the noise lets expect, in σ."""
    outline_lead: float
    """Lead of a body of unknown outline, nat; 0 where it was not compared."""
    round_lead: float
    """Lead of a circle of unknown radius, nat; 0 where it was not compared."""
    room_lead: float
    """Lead of the mapped walls and corners, nat."""
    sides: int
    """Bearing bins from which it was heard."""
    is_confirmed: int
    """1 once it was heard from many sides while it was named."""
    leads: Annotated[Floats, ALTERNATIVES_MAX]
    """Lead of each alternative, nat: the radii, then a line, then a corner; 0 where it was not compared."""
    noise_nat: Annotated[Floats, NOISES]
    """Log likelihood of its residuals under each noise, nat."""
    bins: Annotated[Records[CircleBin], BEARING_BINS]
    """The readings it keeps, by bearing."""


class PolygonTrack(Track):
    """An object of polygonal outline."""

    model: int
    """Index in `Settings.polygons`."""
    has_challenger: int
    """1 while another pose is to be tried."""
    heading: float
    sure_hits: float
    """Hits where an echo was certain to be heard."""
    covariance: LowerTriangle
    """Of the pose; all zero until it is known."""
    challenger: Pose
    bins: Annotated[Records[PolygonBin], POLYGON_BEARING_BINS]


class Rejection(Record):
    """A place where a user rejected an object."""

    x: float
    y: float
    radius: float
    """Nothing of the kind starts within this, m, …"""
    what: int
    """Index of a circle, or `POLYGON` plus that of a polygon model."""
    evidence_nat: float
    """… until the evidence exceeds this."""


class PolygonRequest(Record):
    """A request for a polygon hypothesis behind a segment."""

    model: int
    x: float
    y: float
    normal_x: float
    normal_y: float
    is_done: int


class PoseSearch(Record):
    """A search for the pose of greatest likelihood; see `polygon_likelihood.search`."""

    x: float
    y: float
    heading: float
    log_likelihood_ratio: float
    """At that pose, nat."""
    step_m: float
    trial: int
    """The next trial; −1 before the first score."""
    rounds_left: int
    has_gained: int
    """1 where this round gained."""


class LatticeMoments(Record):
    """Mass, first and second moments of a likelihood on a lattice, in pitches along the frame's axes a, b, c."""

    mass: float
    a: float
    b: float
    c: float
    aa: float
    ab: float
    bb: float
    ac: float
    bc: float
    cc: float


class PolygonJob(Record):
    """The current job on polygons and its progress; see `perception.bayes.polygon_job`."""

    kind: int
    stage: int
    track: int
    """The track that is refined, or …"""
    model: int
    """… the model that is tried."""
    reading_count: int
    reading_step: int
    """Step between the readings that a search scores."""
    noise_level: int
    """Noise assumed when the job began."""
    next_step: int
    """Progress within the stage."""
    lattices: int
    """Lattices laid."""
    refines_next: int
    """Turn of refinements (1) and of new hypotheses (0)."""
    requests_made: int
    search: PoseSearch
    best: Pose
    """Best pose of several searches."""
    best_nat: float
    """Its log likelihood ratio."""
    segment_x: float
    """The segment behind which a hypothesis is tried."""
    segment_y: float
    segment_normal_x: float
    segment_normal_y: float
    middle: Pose
    """Middle of the lattice, or of the restarts."""
    middle_nat: float
    """Log likelihood ratio there."""
    root: LowerTriangle
    """The lattice's frame: lower root of one pitch."""
    covariance: LowerTriangle
    moments: LatticeMoments


class State(Record):
    """The memory without the circle tracks."""

    sensor_count: int
    noise_level: int
    """Index of the assumed noise in `Settings.noises`."""
    segments_made: int
    segments_held: int
    """Segments in the outline map: to count them anew would drive everything else out of the processor's caches."""
    buckets_used: int
    """Buckets of the outline map that hold segments, …"""
    used_buckets: Annotated[Ints, BUCKETS]
    """… and which they are, in ascending order, for the same reason."""
    refinements: int
    ring_x: float
    """Position of the ring at its last firing, m."""
    ring_y: float
    objects_numbered: int
    """Numbers assigned to objects; a number is never reused."""
    segments_numbered: int
    """The same for segments."""
    rejection_count: int
    heard: float
    """Readings with an echo …"""
    silent: float
    """… and without; older ones count less."""
    crosses_kept: int
    """Cross paths ever remembered."""
    names_withdrawn: int
    """Names withdrawn since a named circle was last heard from many sides, …"""
    unconfirmed_m: float
    """… and the way driven since, m."""
    roughness_nat: Annotated[Floats, NOISES]
    """Evidence of the readings' roughness for each noise."""
    residuals_nat: Annotated[Floats, NOISES]
    """Evidence of all objects' residuals for each noise."""
    crosses: Annotated[Records[Reading], CROSS_HISTORY]
    """A ring buffer of cross paths."""
    sensors: Annotated[Records[Sensor], SENSORS_MAX]
    buckets: Annotated[Records[Bucket], BUCKETS]
    """The outline map."""
    lines: Annotated[Records[Line], MAX_LINES]
    room: WallMap
    polygons: Annotated[Records[PolygonTrack], MAX_POLYGONS]
    rejections: Annotated[Records[Rejection], REJECTIONS_MAX]
    requests: Annotated[Records[PolygonRequest], REQUESTS_MAX]
    job: PolygonJob
    job_readings: Annotated[Records[Reading], POLYGON_BEARING_BINS * POLYGON_BIN_CAPACITY]
    scratch: Scratch


StateRecord: TypeAlias = Records[State]
"""The memory as kernels take it: one record."""
CircleTracks: TypeAlias = Records[CircleTrack]
AnyTrack: TypeAlias = CircleTrack | PolygonTrack


class Memory:
    """The arrays of the memory, as numpy arrays and as kernels take them."""

    SCRATCH: Final = ("s", "tracks", "firings", "objects_numbered")
    """Views of the same memory, left out of snapshots."""

    def __init__(self, sensors: int, tracks: int = MAX_TRACKS) -> None:
        self.state = zeros(State, 1)
        self.circles = zeros(CircleTrack, tracks)
        self.s = records(State, self.state)
        self.tracks = records(CircleTrack, self.circles)
        # What Python reads at each firing: to find a field anew takes numpy ten times as long as to read it.
        self.firings = self.state["room"]["firings"]
        self.objects_numbered = self.state["objects_numbered"]
        self.state["sensor_count"] = sensors
        self.clear()

    @property
    def polygons(self) -> np.ndarray[Any, Any]:
        """The tracks of polygons as numpy takes them, shape (MAX_POLYGONS,)."""
        return self.state["polygons"][0]  # type: ignore[no-any-return]  # numpy types a field as Any

    def clear(self) -> None:
        """Clear the memory, except the numbers assigned so far."""
        kept = {name: self.state[name].copy() for name in ("sensor_count", "objects_numbered", "segments_numbered")}
        for array in (self.state, self.circles):
            array.view(np.uint8)[...] = 0
        for name, value in kept.items():
            self.state[name] = value
        for field in ("x", "y", "axis_x", "axis_y", "range_m"):
            self.state["sensors"]["last"][field] = self.state["sensors"]["crossed"][field] = np.nan
        self.state["noise_level"] = START_NOISE
        self.state["roughness_nat"][0, START_NOISE] = START_NOISE_NAT
        self.state["scratch"]["attracting_rows"] = np.arange(ATTRACTING_MAX)

"""Memory of the Bayesian method: records of a fixed layout, allocated once and never resized.

Kernels call them `s` (one `State`), `tracks` (circles, as many as the configuration allows) and `p` (one `Settings`
record of `perception.bayes.memory.settings_record`). Lengths are metres, angles radians.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, TypeAlias

import numpy as np

from config.robot import SENSORS_MAX
from perception.bayes.memory.elements import (
    ALTERNATIVES_MAX,
    ATTRACTING_MAX,
    BEARING_BINS,
    BIN_CAPACITY,
    BUCKET_CAPACITY,
    BUCKETS,
    CROSS_HISTORY,
    HISTORY,
    MAX_POLYGONS,
    POLYGON_BEARING_BINS,
    POLYGON_BIN_CAPACITY,
    RADIUS,
    REJECTIONS_MAX,
    REQUESTS_MAX,
    LowerTriangle,
    MappedSegment,
    Pose,
    Reading,
)
from perception.bayes.memory.job_records import JOB_READINGS, LATTICE, REFINEMENT, PolygonJob, PolygonRequest
from perception.bayes.memory.parameters import START_NOISE, START_NOISE_NAT
from perception.bayes.memory.polygon_parameters import LATTICE_ATTEMPTS
from perception.bayes.memory.scratch import POLYGON, Scratch
from perception.bayes.memory.settings_record import CIRCLES_MAX, NOISES, POLYGONS_MAX
from perception.bayes.memory.wall_records import WallMap
from perception.bounds import (
    CONSTANT,
    FINITE,
    FLAG,
    PLACE,
    SIGNED,
    UNHEARD,
    Bound,
    Count,
    Finite,
    Flag,
    Place,
    bounds,
    index_of,
    up_to,
)
from perception.kernel import Floats, Ints
from perception.records import Record, Records, records, zeros

RAYS_MAX: Final = 3
"""Greatest number of rays that is distinguished from a whole beam. By 4 and more drums are found by their nearest
points; and 5 in an office led by 58 nat, where nearest points are heard."""
FREE, TENTATIVE, ESTABLISHED = range(3)
"""Values of `Track.status`."""
CONFIRMED, PLACED = (1 << bit for bit in range(2))
"""Bits of `Track.marks`: a user confirmed the object; a user placed it, and readings do not support it yet."""


class Sensor(Record):
    """Memory of one sensor."""

    history: Annotated[Records[Reading], HISTORY]
    """A ring buffer of spaced readings, hits and silences."""
    times_s: Annotated[Floats, HISTORY, PLACE]
    kept: Count
    """Readings ever put there."""
    last: Annotated[Reading, UNHEARD]
    """The first reading from the place where it was last."""
    looks: Count
    """Readings from its place; see `placement.says_new`."""
    changed: Count
    """The newest of them that in turn differ from `last`."""
    crossed: Annotated[Reading, UNHEARD]
    """Where it stood when others last listened to it; without a range."""
    tried: Count
    """`State.segments_numbered` when one of its segments last started a hypothesis."""


class Bucket(Record):
    """The segments of one cell of the map."""

    cell_x: Annotated[int, SIGNED]
    cell_y: Annotated[int, SIGNED]
    count: Count
    """Segments put in since the cell took the bucket."""
    segments: Annotated[Records[MappedSegment], BUCKET_CAPACITY]


class CircleBin(Record):
    """The readings that a circle keeps of one direction."""

    count: Count
    """Readings ever put in."""
    readings: Annotated[Records[Reading], BIN_CAPACITY]


class PolygonBin(Record):
    """The readings that a polygon keeps of one direction."""

    count: Count
    readings: Annotated[Records[Reading], POLYGON_BIN_CAPACITY]


class Track(Record):
    """Fields that circle and polygon tracks have in common."""

    status: Annotated[int, Bound(FREE, ESTABLISHED)]
    """`FREE`, `TENTATIVE` or `ESTABLISHED`."""
    unseen: Count
    """Readings since the last refinement."""
    reservoir: Count
    """Readings that bore on it at the last refinement."""
    refinements: Count
    idle_firings: Count
    """Firings without new evidence."""
    final_refinements: Annotated[int, SIGNED]
    """Refinements still due once it is idle."""
    passed_over: Count
    """Quanta that went to other tracks since its last one."""
    number: Count
    """Number that users see."""
    marks: Annotated[int, up_to(CONFIRMED | PLACED)]
    """Sum of `CONFIRMED` and `PLACED`."""
    x: Place
    y: Place
    log_likelihood_ratio: Finite
    """Evidence against the background, nat."""
    hits: Finite
    near: Finite
    """Readings within the gate."""
    probability: Finite
    """Existence probability: this explanation against all others."""


class CircleTrack(Track):
    """Track of a round object."""

    kind: Annotated[int, index_of(CIRCLES_MAX)]
    """Index of its radius in `Settings.circles`."""
    alternative: Annotated[int, index_of(ALTERNATIVES_MAX)]
    """Index of the alternative that was compared last."""
    is_named: Flag
    """1 while it is reported as a model."""
    other_rays: Annotated[int, up_to(RAYS_MAX)]
    """By how many rays it was compared last."""
    rays_leads: Annotated[Floats, RAYS_MAX + 1, FINITE]
    """The lead of each number of rays; see `circles.heard_rays.compare_rays`."""
    radius: Annotated[float, RADIUS]
    root_xx: Finite
    """Lower Cholesky root of the covariance from which the next grid starts, m."""
    root_yx: Finite
    root_yy: Finite
    covariance_xx: Finite
    """m²"""
    covariance_xy: Finite
    covariance_yy: Finite
    misses: Finite
    """Readings that should have hit and passed through."""
    dispersion: Finite
    """Dispersion of the axes of the sensors that heard it."""
    unknown_nat: Finite
    """Evidence of an unknown object in its place."""
    outline_lead: Finite
    """Lead of a body of unknown outline, nat; 0 where it was not compared."""
    round_lead: Finite
    """Lead of a circle of unknown radius, nat; 0 where it was not compared."""
    room_lead: Finite
    """Lead of the mapped walls and corners, nat."""
    sides: Annotated[int, up_to(BEARING_BINS)]
    """Bearing bins from which it was heard."""
    is_confirmed: Flag
    """1 once it was heard from many sides while it was named."""
    leads: Annotated[Floats, ALTERNATIVES_MAX, FINITE]
    """Lead of each alternative, nat: the radii, then a line, then a corner; 0 where it was not compared."""
    noise_nat: Annotated[Floats, NOISES, FINITE]
    """Log likelihood of its residuals under each noise, nat."""
    bins: Annotated[Records[CircleBin], BEARING_BINS]
    """The readings it keeps, by bearing."""


class PolygonTrack(Track):
    """An object of polygonal outline."""

    model: Annotated[int, index_of(POLYGONS_MAX)]
    """Index in `Settings.polygons`."""
    has_challenger: Flag
    """1 while another pose is to be tried."""
    heading: Place
    sure_hits: Finite
    """Hits where an echo was certain to be heard."""
    covariance: LowerTriangle
    """Of the pose; all zero until it is known."""
    challenger: Pose
    bins: Annotated[Records[PolygonBin], POLYGON_BEARING_BINS]


class Rejection(Record):
    """A place where a user rejected an object."""

    x: Place
    y: Place
    radius: Place
    """Nothing of the kind starts within this, m."""
    what: Annotated[int, index_of(POLYGON + POLYGONS_MAX)]
    """Index of a circle, or `POLYGON` plus that of a polygon model."""
    evidence_nat: Finite
    """Evidence from which on it may start again."""


class State(Record):
    """The memory without the circle tracks."""

    sensor_count: Annotated[int, CONSTANT]
    noise_level: Annotated[int, index_of(NOISES)]
    """Index of the assumed noise in `Settings.noises`."""
    segments_made: Count
    segments_held: Count
    """Segments in the outline map: to count them anew would drive everything else out of the processor's caches."""
    buckets_used: Annotated[int, up_to(BUCKETS)]
    """How many buckets of the outline map hold segments."""
    used_buckets: Annotated[Ints, BUCKETS, index_of(BUCKETS)]
    """Which buckets these are, in ascending order, for the same reason."""
    refinements: Count
    ring_x: Place
    """Position of the ring at its last firing, m."""
    ring_y: Place
    objects_numbered: Count
    """Numbers assigned to objects; a number is never reused."""
    segments_numbered: Count
    """The same for segments."""
    rejection_count: Count
    heard: Finite
    """Readings with an echo; older ones count less."""
    silent: Finite
    """Readings without an echo; older ones count less."""
    crosses_kept: Count
    """Cross paths ever remembered."""
    names_withdrawn: Count
    """Names withdrawn since a named circle was last heard from many sides."""
    unconfirmed_m: Place
    """The way driven since then, m."""
    roughness_nat: Annotated[Floats, NOISES, FINITE]
    """Evidence of the readings' roughness for each noise."""
    residuals_nat: Annotated[Floats, NOISES, FINITE]
    """Evidence of all objects' residuals for each noise."""
    rays: Annotated[int, up_to(RAYS_MAX)]
    """By how many rays bodies are heard here, 0: by their nearest points; see `inference.beam`."""
    tried_rays: Annotated[int, up_to(RAYS_MAX)]
    """By how many rays one that failed was tried last."""
    untried: Count
    """How many that failed were not tried since then."""
    crosses: Annotated[Records[Reading], CROSS_HISTORY]
    """A ring buffer of cross paths."""
    sensors: Annotated[Records[Sensor], SENSORS_MAX]
    buckets: Annotated[Records[Bucket], BUCKETS]
    """The outline map."""
    room: WallMap
    polygons: Annotated[Records[PolygonTrack], MAX_POLYGONS]
    rejections: Annotated[Records[Rejection], REJECTIONS_MAX]
    requests: Annotated[Records[PolygonRequest], REQUESTS_MAX]
    job: PolygonJob
    job_readings: Annotated[Records[Reading], JOB_READINGS]
    scratch: Scratch


StateRecord: TypeAlias = Records[State]
"""The memory as kernels take it: one record."""
CircleTracks: TypeAlias = Records[CircleTrack]
AnyTrack: TypeAlias = CircleTrack | PolygonTrack


class Memory:
    """The arrays of the memory, as numpy arrays and as kernels take them."""

    SCRATCH: Final = ("s", "tracks", "firings", "objects_numbered")
    """Views of the same memory, left out of snapshots."""
    BOUNDS: Final = bounds({"state.room.edges.second": FLAG}, state=State.BOUNDS, circles=CircleTrack.BOUNDS)

    def __init__(self, sensors: int, tracks: int) -> None:
        self.state = zeros(State, 1)
        self.circles = zeros(CircleTrack, tracks)
        self.s = records(State, self.state)
        self.tracks = records(CircleTrack, self.circles)
        # What Python reads at each firing: to find a field anew takes numpy ten times as long as to read it.
        self.firings = self.state["room"]["firings"]
        self.objects_numbered = self.state["objects_numbered"]
        self.state["sensor_count"] = sensors
        self.clear()

    def contradiction(self) -> str | None:
        """Return what would keep a job on polygons from ending, None if nothing does."""
        job = self.s[0].job
        if job.kind == REFINEMENT and job.stage == LATTICE and job.lattices >= LATTICE_ATTEMPTS:
            return f"state.job.lattices is {job.lattices}, but the stage of lattices is not over"
        return None

    @property
    def polygons(self) -> np.ndarray[Any, Any]:
        """The tracks of polygons as numpy takes them, shape (MAX_POLYGONS,)."""
        return self.state["polygons"][0]  # type: ignore[no-any-return]  # numpy types a field as Any

    def clear_walls(self) -> None:
        """Clear walls and corners, and the readings from which new ones come."""
        self.state["room"].view(np.uint8)[...] = 0

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

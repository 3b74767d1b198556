"""The numbers that tune the polygon tracks of the Bayesian method; `parameters` has the others.

Where a value gives no other source, it was tuned on random halls with the Denning's ring. A unit stands at the end of
the name or in the line below; a plain number is a count, a factor or a share.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.memory.parameters import MAY_ANSWER_DEG

# --- What a polygon answers ----------------------------------------------------------------------------------------

POLYGON_UNKNOWN_NAT: Final = 2.9
"""Evidence of an unknown object for each near reading, against a polygon."""
DOUBTFUL_ANSWER_NAT: Final = 0.7
"""Price of an answer that a mirror may give or not: about log 2. At a side's end or the beam's edge it costs nothing:
all the readings of a sensor may then be heard, or none, and a price for each would turn the body until they must."""
EDGE_REACH_M: Final = 1.0
"""A convex edge scatters 20 to 30 dB below a mirror's echo: it is heard from within this."""
EDGE_NAT_PER_M: Final = 3.0 / FOOT_M
"""An echo of an edge from beyond that costs this much per metre."""
SIDE_END_MARGIN_M: Final = 0.12 * FOOT_M
"""A foot this near the end of its side need not answer: the accuracy of a pose."""
GRAZING_COS: Final = 0.05
"""An edge of the beam that is more parallel to a side than this does not meet it."""

# --- Searches for a pose -------------------------------------------------------------------------------------------

SEARCH_TURN_RAD_PER_M: Final = 0.7 / FOOT_M
"""Ratio of a search's turn to its shift: it moves the side of a body of 1.4 ft as far as the shift."""
SEARCH_SHRINK: Final = 0.5
"""Factor on the steps when no move gains."""
SEARCH_GAIN_MIN_NAT: Final = 1e-6
"""Smallest score gain that counts as progress."""
SEARCH_FINEST_M: Final = 0.005 * FOOT_M
"""Step below which a search ends: a tenth of the resolution, narrower than the likelihood's plateau."""
SEARCH_EVERY: Final = 4
"""A pose whose covariance is known and that explains its readings is searched only once in this many refinements."""
WIDE_SEARCHES_FIRST: Final = 4
"""The search is wide in so many first refinements."""
WIDE_SEARCH_EVERY: Final = 8
"""After these the search is wide in one of so many refinements."""
FITTING_SHARE: Final = 0.85
"""The search is wide every other time while less than this share of the near readings is explained."""
COARSE_READINGS: Final = 96
"""Greatest number of readings that a wide search scores."""
WIDE_STEP_M: Final = 0.3 * FOOT_M
"""First step of a wide search."""
WIDE_ROUNDS: Final = 14
"""Rounds of a wide search."""
NARROW_STEP_M: Final = 0.05 * FOOT_M
"""First step of a search near by."""
NARROW_ROUNDS: Final = 6
"""Rounds of a search near by."""
RESTART_SHIFTS: Final = (0.5, -0.5, 1.0, -1.0)
"""Shifts of the restarts along and across, in inner radii."""
RESTART_TURNS: Final = (-0.5, 0.5)
"""Turns of the restarts, in π over the order of the symmetry."""
RESTART_ROLLS_MAX: Final = 12
"""Greatest number of other sides that restarts are rolled onto."""
RESTART_ROUNDS: Final = 5
"""Rounds of the restarts' searches, which begin with `FINE_STEP_M`."""

# --- New polygon tracks --------------------------------------------------------------------------------------------

REQUEST_SAME_M: Final = 0.25 * FOOT_M
"""A segment this near to a parallel one makes the same request."""
PARALLEL_COS: Final = 0.98
"""Two segments are parallel from this cosine (11°) on."""
POLYGON_AROUND_M: Final = 0.3 * FOOT_M
"""Segments up to this far off the farthest vertex may attract the body; circles up to there stand in its place."""
POLYGON_RELAXATION_STEPS: Final = 3
"""Greatest number of a polygon's relaxation steps."""
POLYGON_RESTS_RAD: Final = 0.01
"""These steps end with turns below this and shifts below `POLYGON_RESTS_M`."""
POLYGON_RESTS_M: Final = POLYGON_RESTS_RAD * FOOT_M
"""The shift that a turn by `POLYGON_RESTS_RAD` makes a foot away."""
SIDE_SHIFTS: Final = (-0.3, 0.0, 0.3)
"""Where on a side the segment is laid, from its middle, in lengths of the side."""
TRIAL_READINGS_MIN: Final = 8
"""Least readings of a trial."""
TRIAL_READINGS_MAX: Final = 80
"""Greatest number of readings that a trial scores: it is only compared with the other trials."""
TRIAL_STEP_M: Final = 0.2 * FOOT_M
"""First step of a trial's search."""
TRIAL_ROUNDS: Final = 8
"""Rounds of a trial's search."""
TRIAL_EVIDENCE_MIN_NAT: Final = 15.0
"""Least evidence of the best trial."""
FINE_STEP_M: Final = 0.1 * FOOT_M
"""First step of the search from the best trial, and of those of restarts."""
FINE_ROUNDS: Final = 10
"""Rounds of the search from the best trial."""
POLYGON_HITS_MIN: Final = 6.0
"""Least hits of a new track."""
WHOLE_SHARE: Final = 0.9
"""A track that explains this share of its near readings keeps its place."""
APART_WHOLE: Final = 1.5
"""No like track starts this near to one that keeps its place, in inner radii."""
POLYGONS_APART: Final = 0.5
"""No like track starts this near to any other track, in inner radii."""
CHALLENGE_UNSEEN: Final = 8
"""Unseen readings that a challenger counts as."""

# --- The lattice of a polygon's posterior --------------------------------------------------------------------------

LATTICE_PITCH: Final = 1.3
"""The lattice's pitch, in expected standard deviations."""
LATTICE_RADIUS2: Final = 6
"""The lattice's squared radius, in pitches: 81 points."""
LATTICE_ATTEMPTS: Final = 5
"""Greatest number of lattices laid for a track: the bound on the work."""
LATTICE_LEAD_MAX_NAT: Final = 40.0
"""Greatest lead of a point over the middle that counts."""
LATTICE_OFF_CENTRE: Final = 0.7
"""The lattice is laid again when the mean is this many pitches off its middle."""
LATTICE_NARROW: Final = 0.7
"""The lattice is laid again when a variance is below this share of the expected one."""
LATTICE_WIDE: Final = 1.4
"""The lattice is laid again when a variance is above this share of the expected one."""
LATTICE_THINNEST: Final = 0.1
"""Least variance that the next lattice assumes, in the same shares: a narrower peak falls between the points."""
LATTICE_CORRELATION_SHARE: Final = 0.95
"""Share of a correlation that the next lattice assumes, so that it never collapses."""
LATTICE_PITCHES_M: Final = (1e-4, 0.15)
"""Least and greatest pitch of the place."""
LATTICE_PITCHES_RAD: Final = (1e-4, 0.4)
"""Least and greatest pitch of the turn."""
FIRST_SIGMA_M: Final = 0.01
"""Standard deviation of the place that a track's first lattice assumes."""
FIRST_SIGMA_RAD: Final = 0.02
"""Standard deviation of the turn that a track's first lattice assumes."""

# --- The life of a polygon track -----------------------------------------------------------------------------------

POLYGON_EVIDENCE_MIN_NAT: Final = 5.0
"""A track with less evidence than this ends."""
POLYGON_UNKNOWN_LEAD_NAT: Final = 8.0
"""A track ends if the evidence of an unknown object leads it by this."""
POLYGON_ESTABLISH_HITS: Final = 10.0
"""Least hits to establish a track."""
POLYGON_ESTABLISH_SURE: Final = 3.0
"""Least sure hits to establish a track: corners alone fit anywhere."""
MANY_HITS: Final = 20.0
"""A track of so many hits may be reported, and fewer sure ones suffice to establish it."""
MANY_HITS_SURE: Final = 2.0
"""Least sure hits to establish a track of `MANY_HITS`."""
POLYGON_DOUBT_PROBABILITY: Final = 0.3
"""A track less probable than this is tentative again."""
POLYGON_DOUBT_SHARE: Final = 0.75
"""A track that explains less than this share of its near readings is tentative again."""
TWIN_RADII: Final = 0.4
"""Two bodies whose centres are nearer than this, in inner radii, are one."""
OVERLAP_RADII: Final = 1.8
"""Two bodies whose centres are nearer than this, in inner radii, cannot both exist."""

# --- Walls and circles in a polygon's place ------------------------------------------------------------------------

POLYGON_WALL_LENGTH_RADII: Final = 3.0
"""Least length of a mapped wall that stands in a polygon's place: a factor on half its longest side, or on the inner
radius where that is longer."""

# --- Which polygons are reported, and how --------------------------------------------------------------------------

POLYGON_PROBABILITY: Final = 0.9
"""A polygon is established from this probability on, and reported, or from the user's `report_probability` if that is
less."""
POLYGON_NEAR_M: Final = 6.5 * FOOT_M
"""Greatest distance of the nearest sensor that heard a reported body."""
POLYGON_DISPERSION_MIN: Final = 0.02
"""Least dispersion of the axes that heard it: a single face seen from afar may belong to any wall."""
POLYGON_SIGMA_MAX_M: Final = 0.2 * FOOT_M
"""Greatest standard deviation of its position along either axis."""
POLYGON_NAMED_HITS_SWEPT: Final = 12.0
"""Least hits of a reported body that many readings fit, in place of `MANY_HITS`."""
POLYGON_SWEPT_READINGS: Final = 80
"""Least readings, silences included, that bear on such a body and fit it."""
POLYGON_INFLATION: Final = 1.15
"""Factor on a polygon's reported covariance: the noise does not include the influence of its neighbours."""
POLYGON_TURN_SIGMA_RAD: Final = math.radians(MAY_ANSWER_DEG)
"""Least standard deviation of its heading: that of the beam's edges, since an echo at an edge turns a body."""

# --- Effort --------------------------------------------------------------------------------------------------------

QUANTUM_COST: Final = 22_000
"""Cost of a quantum, in predicted ranges of one side, or what takes as long."""
READING_COST: Final = 3
"""Cost of a reading, in sides, besides the model's own sides."""
COLLECTING_COST: Final = 800
"""Cost of collecting the readings, in the same unit."""

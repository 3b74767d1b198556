"""The numbers that tune the Bayesian method: what one range says, the outline map, circles, reports, effort.

Those of polygon tracks are in `perception.bayes.memory.polygon_parameters`. Where a value gives no other source, it
was tuned on random halls with the Denning's ring (docs/figures.md names them). The values hold for other rings as
well, because the beam, the resolution and the range are the ring's own, and sizes are those of the models. Lengths
that depend on neither reflect the spacing of objects in a building; they are in metres, to a tenth of a foot.

A unit stands at the end of the name or in the line below; a plain number is a count, a factor or a share. A user's
settings are in `config.settings`, array sizes beside the arrays (`elements`, `settings_record`). The kernels take
these values as constants: a change compiles the kernels anew.
"""

from __future__ import annotations

from typing import Final

from config.units import FOOT_M

# --- What one range says -------------------------------------------------------------------------------------------

MAY_ANSWER_DEG: Final = 0.4
"""A reading this far outside the beam may match: the accuracy of mounts and headings."""
MUST_ANSWER_DEG: Final = 1.5
"""A reading must hit only this far inside the beam: sensitivity fades towards the edge."""
GATE_M: Final = 0.5 * FOOT_M
"""A range this near to the predicted one is attributed to the object."""
MISSED_ECHO_PROBABILITY: Final = 0.1
"""Probability of a reading that should have hit and passed through."""
SHORT_ECHO_NAT: Final = -1.0
"""Log probability of an unseen object in front."""
BACKGROUND_RANGE_M: Final = 15.0 * FOOT_M
"""Range over which echoes of the background are uniform; its density is the inverse."""
OUTLIER_SHARE: Final = 0.03
"""Share of outliers: ranges from another object."""
TABLE_SIGMAS_M: Final = (0.001 * FOOT_M, 0.6 * FOOT_M)
"""Least and greatest noise of the likelihood's table."""
TABLE_REACH_SIGMAS: Final = 6.0
"""Distance beyond the box of rounding, in σ, at which only outliers remain."""
DROP_OUT_SHARE: Final = 0.2
"""Up to this share of what should have hit, and one more, drop-outs are a matter of the sensor."""
DROP_OUT_NAT: Final = 2.0
"""Price of each further drop-out: many of them indicate an absent body."""

# --- Noise of the ranges -------------------------------------------------------------------------------------------

NOISE_ABSOLUTE_M: Final = tuple(v * FOOT_M for v in (0.003, 0.012, 0.03, 0.05, 0.09))
NOISE_RELATIVE: Final = (0.0, 0.005, 0.01, 0.02)
"""Absolute and relative noises of the hypotheses: σ² = absolute² + (relative · range)². The greatest is that of poses
that jump by 3 cm from firing to firing: with .08 ft in its place two corners and a doorway of 40 rooms were drums;
with .1 ft an open shell between mirrors is found turned."""
START_NOISE: Final = 9
"""Index of the noise assumed at the start: σ = 0.03 ft, 0.5 %."""
START_NOISE_NAT: Final = 6.0
"""Evidence for it at the start."""
ROUGHNESS_GATE_NAT: Final = 20.0
"""Noises less likely than the best by this, by roughness, are ruled out."""
TRIPLE_MAX_M: Final = 1.0 * FOOT_M
"""Greatest distance between the positions of a triple, or of neighbours that did not fire together: farther apart
they rarely see one surface."""
CURVATURE_VARIANCE_M2: Final = 1e-4 * FOOT_M * FOOT_M
"""Variance that a curved surface adds to the middle of a triple."""
ROUGHNESS_MEMORY: Final = 0.997
"""Factor on the evidence from roughness after each triple: a memory of about three hundred triples."""
SAME_SURFACE_SHARE: Final = 0.8
"""Share of middle readings that hit the same surface as the outer two."""
ELSEWHERE_PER_M: Final = 0.02 / FOOT_M
"""Density of a middle reading that hit something else."""
RANGE_VARIANCE_MIN_M2: Final = 1e-6 * FOOT_M * FOOT_M
"""Least variance of a range, and of a fitted centre, so that perfect ones do not divide by zero."""
SYSTEMATIC_M: Final = 0.005
"""Error of poses and surfaces that the mean of many readings keeps."""
RESIDUAL_HITS_MIN: Final = 25.0
"""A certain object's residuals count from this many hits on."""
RESIDUAL_EVERY: Final = 3
"""They count in one of so many of its refinements."""

# --- Which readings are kept and attributed ------------------------------------------------------------------------

HISTORY_SPACING_M: Final = 0.2 * FOOT_M
"""Least distance between consecutive readings of a sensor's history."""
STILL_M: Final = 0.05 * FOOT_M
"""A sensor that moved less than this, and turned less than `STILL_COS`, repeats an equal range."""
STILL_COS: Final = 0.9998
"""Cosine of the turn in `STILL_M`: 1°."""
ASSOCIATION_MARGIN_M: Final = 0.004 * FOOT_M
"""Distance outside a beam at which a centre may lie for the reading to be associated with the object."""
KEEPING_MARGIN_M: Final = 0.01 * FOOT_M
"""Distance outside a beam at which a centre may lie for the reading to be kept in the object's reservoir."""
HYPOTHESIS_MARGIN_M: Final = 0.02 * FOOT_M
"""A hypothesis' centre this far outside a beam may still move into it during the fit."""

# --- The outline map and its segments ------------------------------------------------------------------------------

OUTLINE_CELL_M: Final = 1.0 * FOOT_M
"""A cell of the outline map."""
PAIR_RANGE_MAX_M: Final = 12.0 * FOOT_M
"""Segments farther than this start no hypotheses, and silence from farther is not evidence."""
PAIR_GAP_S: Final = 30.0
"""Readings further apart in time than this make no segment."""
BASELINE_MIN_M: Final = 0.5 * FOOT_M
"""Shortest baseline of one sensor; the longer ones are twice and four times this."""
BASELINES: Final = 3
"""Number of baselines that are tried."""
BASELINE_MAX_M: Final = 2.6 * FOOT_M
"""Longest baseline that is tried."""
NEIGHBOUR_BASELINE_MIN_M: Final = 0.3 * FOOT_M
"""Shortest baseline of neighbours that did not fire together."""
MAPPED_LENGTH_MIN_M: Final = 0.2 * FOOT_M
"""Least length of a mapped segment: a shorter one's direction is too uncertain for the relaxation."""
HYPOTHESIS_SIGMA_MAX_M: Final = 0.7 * FOOT_M
"""Greatest standard deviation of the centre behind a segment that starts a hypothesis."""
HYPOTHESES_PER_FIRING: Final = 2
"""Greatest number of hypotheses computed per firing: the bound on the work."""

# --- New circle tracks ---------------------------------------------------------------------------------------------

RIVAL_RADII_M: Final = (0.0, 0.35 * FOOT_M, 2.2 * FOOT_M)
"""Radii that compete with every model: an edge or corner, a post, a barrel."""
RIVAL_APART_M: Final = 0.1 * FOOT_M
"""A rival as near as this to a model's radius is that model."""
MERGE_RADII: Final = 0.9
"""Two centres nearer than this many radii of the smallest model are one object."""
RELAXATION_GAMMA: Final = 2.0
"""γ of the relaxation, dimensionless: the paper's value."""
CIRCLE_AROUND_M: Final = 0.4 * FOOT_M
"""Segments up to this far off the body may attract it."""
FACING_RADII: Final = 0.6
"""A segment attracts where the body's centre lies at least this many radii behind it."""
ATTRACTING_MIN: Final = 3
"""Fewer segments than this do not move a hypothesis."""
OTHER_FIT_STEPS: Final = 4
"""Steps of the relaxation and of the fits of a circle that has no track yet, and of an explanation other than a
track's or wall's own."""
CIRCLE_RESTS_RAD: Final = 0.005
"""A circle's relaxation ends with turns below this and shifts below `CIRCLE_RESTS_M`."""
CIRCLE_RESTS_M: Final = CIRCLE_RESTS_RAD * FOOT_M
"""The shift that a turn by `CIRCLE_RESTS_RAD` makes a foot away."""
FIT_SOFTNESS: Final = 9.0
"""Robustness of the fits: squared residual, in σ², at which the weight has fallen to a quarter."""
FIRST_FIT_SOFTNESS: Final = 16.0
"""The same for the first fit of a hypothesis."""
FIT_DAMPING: Final = 0.02
"""Share of the information that holds a fit where it is, so that unobserved directions do not move."""
FIT_STEP_MAX_GATES: Final = 0.8
"""Longest step of a circle's fit, in gates: a longer one would leave the readings that it came from."""
FIT_STEP_MIN_GATES: Final = 4e-4
"""A step below this many gates ends a circle's fit."""
FIT_TURN_MAX_RAD: Final = 0.2
"""Longest turn of a line's fit."""
FIT_TURN_MIN_RAD: Final = 1e-5
"""A turn below this ends a line's fit."""
CIRCLE_READINGS_MIN: Final = 5
"""Least readings of a new track."""
CIRCLE_EVIDENCE_MIN_NAT: Final = 10.0
"""Least evidence of a new track."""
SWITCH_LEAD_NAT: Final = 6.0
"""Lead required of another explanation: of a circle or a line over a circle, of an unknown object, at which a track
ends, and of an established polygon over a circle in its place."""
RIVAL_OVER_UNKNOWN_NAT: Final = 3.0
"""Lead required of a rival over an unknown object."""
CENTRE_VARIANCE_MAX_M2: Final = 0.2 * FOOT_M * FOOT_M
"""Greatest variance assumed for a fitted centre."""

# --- Refinement of circle tracks -----------------------------------------------------------------------------------

UNKNOWN_NAT: Final = 2.0
"""Evidence of an unknown object for each near reading, against a circle."""
MODEL_PRIOR_NAT: Final = 3.0
"""Log prior of a known model over every other explanation."""
LINE_PRIOR_NAT: Final = 1.0
"""Log prior ratio of walls to models."""
DISPERSION_MIN: Final = 0.0015
"""Least dispersion of the axes of the sensors that heard an object."""
DOUBTED_DISPERSION_SHARE: Final = 0.5
"""An established track is tentative again below this share of the least dispersion."""
FAR_M: Final = 6.0 * FOOT_M
"""The prior of an object as a model falls with the distance beyond this, if it was heard only from there."""
FAR_NAT_PER_M: Final = 2.0 / FOOT_M
"""How fast that prior falls."""
TRACK_READINGS_MIN: Final = 3
"""A track with fewer readings ends."""
TRACK_FIT_STEPS: Final = 2
"""Steps of the fit that precedes the posterior of an established track."""
TENTATIVE_FIT_STEPS: Final = 3
"""Steps of the fit that precedes the posterior of a tentative track."""
FIT_LEAD_SIGMAS2: Final = 6.0
"""A robust fit this many σ² off replaces the pose."""
FITTED_REFINEMENTS: Final = 2
"""Every robust fit of so many first refinements replaces the pose."""
LOST_NAT: Final = 2.0
"""Loss of evidence at the mean, against the start, at which it has left the beams that heard the object."""
ROOT_CORRELATION_MAX: Final = 0.9
"""Greatest correlation assumed for a fit."""
SWITCH_ROOT_M: Final = 0.02 * FOOT_M
"""Least root of the covariance with which the pose is searched after a change of kind."""
SWITCH_UNSEEN: Final = 4
"""Unseen readings that a change of kind, or of the radius, counts as, so that the track is refined."""
CORNER_MISS_SHARE: Final = 0.5
"""Share of the evidence of missed echoes against the circle that also counts against a corner."""
WALL_FRONT_RADII: Final = 0.7
"""A centre lies in a wall up to so many radii before its face."""
IN_WALL_NAT: Final = -8.0
"""Log prior ratio of a body against the walls that explain its readings."""
ESTABLISH_PROBABILITY: Final = 0.7
"""Least probability of a track that is established."""
ESTABLISH_HITS: Final = 8.0
"""Least hits of a track that is established."""
ESTABLISH_ROOT_M: Final = 0.25 * FOOT_M
"""Greatest standard deviation of a track that is established."""
DOUBT_PROBABILITY: Final = 0.2
"""Probability below which an established track is tentative again."""
APART_RADII: Final = 0.8
"""Two centres nearer than this many of the larger radius are one object: bodies do not overlap."""
LATERAL_PLACES: Final = 3
"""Positions that are tried on either side."""
LATERAL_STEP_M: Final = 0.12 * FOOT_M
"""Distance of these positions: together half a foot, a beam's edge at two and a half feet."""
ELSEWHERE_LEAD_NAT: Final = 1.0
"""Evidence by which another position, or another maximum of a polygon, must lead; a smaller lead is chance."""

# --- The corner as an explanation ----------------------------------------------------------------------------------

CORNER_READINGS_MIN: Final = 8
"""Least number of readings of two faces together."""
CORNER_FACE_READINGS_MIN: Final = 3
"""Least number of readings of one face: two to fix it and one to test it."""
CORNER_ROUNDS: Final = 3
"""Rounds of assigning readings to the faces and fitting both, and steps of each fit."""
CORNER_LEEWAY_COS: Final = 0.02
"""Cosine by which a face's fit extends the beam, so that a face started at a wrong angle keeps its readings."""
CORNER_OUT_OF_BEAM_GATES: Final = 2.0
"""Error added, in gates, where a face lies outside the beam."""
CORNER_EDGE_LEAD_GATES: Final = 0.04
"""A reading is assigned to the edge only if the edge explains it this many gates better than a face."""
CORNER_OPENING_MIN: Final = 0.2
"""Least |sin| of the angle between the faces at which they have an edge."""
CORNER_HIT_NAT: Final = 0.4
"""Price of each hit: a choice of three surfaces also explains chance readings."""
CORNER_MODEL_NAT: Final = 8.0
"""Price of the two parameters that a circle does not have."""

# --- The grid of a circle's posterior ------------------------------------------------------------------------------

GRID_ATTEMPTS: Final = 4
"""Greatest number of grids laid in one call: the bound on the work."""
GRID_NEGLIGIBLE_NAT: Final = 30.0
"""A cell this far below the best one is ignored."""
GRID_OFF_CENTRE: Final = 1.2
"""The grid is laid again when the mean is this many pitches off its middle."""
GRID_NARROW: Final = 0.3
"""Variance, in squared pitches, below which the grid is too coarse: 1 is as expected."""
GRID_WIDE: Final = 2.2
"""Variance, in squared pitches, above which the grid is too small."""
GRID_THINNEST: Final = 0.06
"""Least variance, in squared pitches, that the next grid assumes: a narrower peak falls between the cells."""
GRID_CORRELATION_MAX: Final = 0.95
"""Greatest correlation that the next grid assumes."""
GRID_GROWTH: Final = 2.0
"""Factor on the covariance where the best cell lies on the rim."""
GRID_SIGMA_MIN_GATES: Final = 2e-4
"""Least σ of the frame, in gates; its greatest is one gate, beyond which no reading counts."""

# --- Which tracks are reported, and how ----------------------------------------------------------------------------

NAMED_OVER_UNKNOWN: Final = 1.25
"""Least ratio of a named object's evidence to that of an unknown one."""
NAMED_OVER_UNKNOWN_ALONE: Final = 1.1
"""The same ratio where every alternative is far behind."""
ALONE_LEAD_NAT: Final = -20.0
"""Lead of the best alternative at which it counts as far behind."""
NO_WALL_LEAD_NAT: Final = -4.0
"""Lead of a wall at which it is excluded. Walls are the most frequent alternative."""
NAMED_DISPERSION_MIN: Final = 0.008
"""Least dispersion of the axes of an object seen from two sides; an object straight ahead has less."""
NAMED_SIGMA_MAX_M: Final = 0.17 * FOOT_M
"""Greatest standard deviation of a named circle along either axis."""
PLACED_SIGMA_M: Final = 0.15
"""Standard deviation of a position that a user gave: it is wrong by a decimetre or two."""
CIRCLE_INFLATION: Final = 1.1
"""Factor on a circle's covariance when it is reported."""
POST_RADIUS_M: Final = 1.0 * FOOT_M
"""A round rival thinner than this is a post, a thicker one a barrel."""
UNKNOWN_HITS_MIN: Final = 5.0
"""Least hits of an unnamed object that is reported."""

# --- Whether a model is right where it is the best explanation ----------------------------------------------------

ROOM_MARGIN_M: Final = 0.2
"""Mapped walls explain as far as this beyond the ends of their spans, and a thin object there is the wall's edge."""
MODEL_CHECK_EVERY: Final = 4
"""A named object is checked in every fourth of its refinements."""
READINGS_MEMORY: Final = 0.999
"""Factor on counts and sums after each reading: a memory of a thousand, a few seconds of driving."""
MIRRORS_HEARD: Final = 8
"""Points of a room of mirrors that answer, over a beam's opening each: those of four walls, and four corners."""
DIFFUSE_SILENCE: Final = 0.35
"""Where the beams are silent less often than this share of what such a room leaves silent, surfaces answer at any
angle: 16 % for beams of ±12°. The halls have 26 % or more, closed rooms of diffuse walls none."""
CONFIRMED_SIDES: Final = 8
"""Bearing bins (10° each) from which a named object must have been heard to count as confirmed."""
TRUSTED_M: Final = 15.0
"""After this way without a confirmed object, a withdrawn name turns the prior against all new ones."""

# --- A user's edits ------------------------------------------------------------------------------------------------

REJECTED_MAX_NAT: Final = 40.0
"""New evidence that always lifts a rejection: about ten good echoes, four times what starts a track."""
PLACED_ROUNDS: Final = 3
"""Relaxations of a placed model onto the map, a few steps each."""
PLACED_STRAY_MAX_M: Final = 0.5
"""Greatest shift of a placed model by a relaxation: one that moves farther has found something else."""
PLACED_STRAY_MAX_RAD: Final = 0.8
"""Greatest turn of a placed model by a relaxation."""

# --- Which track is refined next -----------------------------------------------------------------------------------

COMPARE_ALL_BELOW: Final = 80
"""With fewer readings than this each refinement compares all alternatives."""
IDLE_FIRINGS: Final = 12
"""Firings without new evidence after which a track gets its final refinements."""
FINAL_REFINEMENTS: Final = 6
"""Number of final refinements of an idle track."""
UNSURE_FACTOR: Final = 4.0
"""Factor on the evidence of an object that is not certain, so that it is refined earlier."""
UNSURE_ROOT_M: Final = 0.03 * FOOT_M
"""An object is not certain if its position is less certain than this, and perhaps wrong."""
RESERVOIR_OFFSET: Final = 8.0
"""Readings added to an object's count, so that an object with few is not refined at every reading."""
FINAL_VALUE: Final = 1e-6
"""Value of a final refinement above the threshold."""
PASSED_OVER_MAX: Final = 60
"""Quanta that may go to others; then a track goes before all that are not passed over as often."""

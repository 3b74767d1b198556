"""The Bayesian method's whole memory: arrays made once, and the settings they are read with, as named tuples.

Compiled kernels take named tuples of arrays as they are, so one argument carries everything that is remembered and
one everything that was set; nothing here is ever resized. Kernels call them `s` and `p`. Python, to which such a call
is dear, goes by `perception.bayes.entry`. Lengths are metres.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from perception.bayes.segment_pairs import SEG
from perception.kernel import Floats, Ints

NT: Final = 48
"""Tracks of circles where the configuration says nothing else."""
NB: Final = 36
"""Bins of a track's reservoir, by the bearing from the object to the sensor: 10° each."""
CAP: Final = 20
"""Readings in a bin; the newest takes the place of the oldest."""
NL: Final = 24
"""Lines: walls."""
HK: Final = 28
"""Readings that are remembered of each sensor, whatever they hit."""
WORK: Final = NB * CAP + 64
"""Rows of scratch for one object's readings, with room for the posterior's grid at the end."""
PULLING: Final = 16
"""Outline segments that may pull at a hypothesis."""
BUCKETS: Final = 4096
"""Buckets of the hashed outline map; a power of two."""
BUCKET: Final = 8
"""Segments in a bucket."""
PT: Final = 24
"""Tracks of polygons."""
PB: Final = 24
"""Bearing bins of a polygon's reservoir."""
PCAP: Final = 12
"""Readings in such a bin."""

BARRED: Final = 32
"""Places where a person said that something does not stand."""

ASKED: Final = 32
"""Segments that wait for a polygon to be tried behind them, and of late did."""

# Columns of `State.tf`, a circle's track: centre, heading (none), radius, lower root of the covariance that the next
# grid starts from, covariance, log ratio to the background, counts, probability, dispersion of the axes, birth.
TX, TY, TTH, TRHO, R00, R10, R11, C00, C01, C11, LLR, HITS, THRU, NEAR, PROB, SPAN, BORN, LXX, LXY, LYY, UNK, SEEN = (
    range(22)
)
NTF: Final = 24
# Columns of `State.ti` and `State.pi`. ST: 0 free, 1 tentative, 2 established. KIND: index into `Settings.radii`.
# QUIET: firings without evidence; POLISH: refinements still owed once it is quiet; CALLED: 1 while it has its name.
# RIVAL: of a polygon, whether it has a challenger. PASSED: quanta for others since.
ST, KIND, DIRTY, CYC, NRES, MODEL, REFS, QUIET, POLISH, CALLED, RIVAL, PASSED = range(12)
NTI: Final = 12
# Columns of `State.lines`: normal, distance along it from an origin on the spot, that origin, covariance of angle and
# distance, extent along the line, log odds of being there still, echoes that it explained (0: free).
LNX, LNY, LC, LOX, LOY, LP00, LP01, LP11, LLO, LHI, LLOG, LN = range(12)
# Columns of `State.pf`, a polygon's track: pose, log ratio, counts, probability, must-answer hits, covariance of x, y
# and heading, pose of a challenger.
PX, PY, PTH, PLLR, PHITS, PNEAR, PPROB, PSURE, PXX, PXY, PYY, PXT, PYT, PTT, CX, CY, CTH = range(17)
NPF: Final = 17
# Cells of `State.g`; HERE is where the ring last fired.
NOISE, SEGMENTS, BIRTHS, REFINEMENTS, HERE_X, HERE_Y = range(6)

# Columns of `State.names`, a row a track, the circles' first; the latter a sum of the marks below: a person said that
# it is there, or put it there and the readings do not bear it out by themselves yet.
NUMBER, MARK = range(2)
CONFIRMED: Final = 1
PLACED: Final = 2
# Columns of `State.stamps`: a mapped segment's number and time.
STAMP, STAMP_S = range(2)
# Cells of `State.tally`: numbers given to objects and to segments, which are never cleared, and places barred.
NUMBERED, STAMPED, BARS = range(3)

FREE, TENTATIVE, ESTABLISHED = range(3)

START_NOISE: Final = 9
"""Index of the noise believed until something is known: σ = 0.03 ft, 0.5 %."""


class Settings(NamedTuple):
    """Everything that kernels are told and never change; see `perception.bayes.kernel_settings`."""

    half_angle: float
    cos_half: float
    cos_opt: float
    """Cosine of a little more than the beam: such readings may match and never cost."""
    cos_in: float
    """Cosine of a little less than the beam: such readings must hit."""
    half_box: float
    """Half the resolution: a range is rounded by at most this."""
    gate: float
    """A range this near to what is predicted is an attempt at it."""
    miss: float
    """Log probability of a reading that should have hit and went through."""
    short: float
    """Log probability of something unseen in front."""
    unknown: float
    """What an unknown thing earns for each near reading, nat."""
    unknown_poly: float
    prior: float
    """Log prior of a known model over every other explanation."""
    spread: float
    """Least dispersion of the axes that heard an object."""
    far: float
    """Seen only from beyond this, a thing is less and less likely a model."""
    far_price: float
    """By so much for each metre, nat."""
    rough_gate: float
    """Noises less likely than the best by this, by roughness, are ruled out, nat."""
    range_max: float
    pair_max: float
    """Segments farther than this start no hypotheses, and silence from farther says nothing."""
    spacing: float
    """A sensor's memory takes a reading only from this far off the last."""
    gap: float
    """Readings further apart than this are no pair, s."""
    per_metre: float
    """Range bins of `levels` a metre."""
    merge: float
    """Two centres nearer than this are one object."""
    all_until: int
    """With fewer readings than this every rival is asked at every refinement."""
    claim: float
    """A line shorter than this explains nothing away."""
    attempts: int
    """Segments looked at for hypotheses, a firing."""
    hyp_sigma: float
    """A segment starts a hypothesis only where the centre behind it would be surer than this."""
    radii: Floats
    """(k,) radii in competition; the first `models` are models, ascending."""
    models: int
    sides: Floats
    """(k, m, 4) chords of each circle, for the relaxation."""
    table: Floats
    inv_step: Floats
    noises: Floats
    levels: Ints
    polys: int
    verts: Floats
    """(M, V, 2) vertices of the polygon models."""
    nv: Ints
    closed: Ints
    sym: Ints
    """Order of each polygon's rotational symmetry."""
    inner: Floats
    """Distance of the nearest side from the origin, and at least half the outline's least width."""
    bound: Floats
    """Distance of the farthest vertex from the origin."""
    psides: Floats
    """(M, V, 4) sides for the relaxation."""
    faces: Floats
    """(M, V, 5) the same for contact: where each begins, its unit direction, its length."""
    inflate: float
    """What the posterior's covariance is multiplied with when it is reported."""
    report: float
    """A model is called by its name from this probability on."""
    report_near: float
    """The same where it was heard from within `far`."""
    quiet: int
    """Firings without evidence after which what is left is worked off."""
    polish: int
    """Refinements then."""


class State(NamedTuple):
    """Everything that is remembered. `w`, `w2`, `wl` and all below `near` are scratch."""

    hist: Floats
    """(S, HK, 6) each sensor's memory: x, y, axis x, axis y, range, time."""
    hn: Ints
    """(S,) readings ever kept."""
    tags: Ints
    """(slots, 2) which cell of the plane a bucket of the outline map holds."""
    fill: Ints
    store: Floats
    """(slots, bucket, 4) a segment's middle and normal."""
    ti: Ints
    tf: Floats
    comp: Floats
    """(NT, k + 2) by how much each rival leads, nat: radii, line, wedge."""
    ddl: Floats
    """(NH,) what roughness says of each noise."""
    ntot: Floats
    """(NH,) what the objects say."""
    nll: Floats
    """(NT, NH) and each of them."""
    bins: Floats
    """(NT, NB, CAP, 5) the reservoirs: raw readings."""
    bn: Ints
    lines: Floats
    g: Floats
    w: Floats
    """(WORK, 5)"""
    w2: Floats
    wl: Ints
    cur: Floats
    """(S, 6) this firing: x, y, axis x, axis y, range, sensor."""
    owner: Ints
    """(S,) what explains each: −1 nothing, −2−k line k, t a track, 1000+t a polygon."""
    fit: Floats
    stats: Floats
    segs: Floats
    """(8 S, SEG + 1) this firing's segments, and the reading each came from."""
    near: Floats
    """(32, 4) segments near a place."""
    pi: Ints
    pf: Floats
    pbins: Floats
    pbn: Ints
    stats2: Floats
    pose: Floats
    root: Floats
    cov: Floats
    pull: Floats
    """(PULLING, 5) segments as the relaxation wants them: ends and normal."""
    all_pull: Ints
    """(PULLING,) 0, 1, 2, …"""
    last: Floats
    """(S, 5) each sensor's last reading that said anything new."""
    job: Ints
    """(24,) what is being done about which polygon, and how far that has come; see `polygon_job`."""
    work: Floats
    """(56,) the numbers of that job."""
    pw: Floats
    """(PT's reservoir, 5) its readings."""
    asked: Floats
    """(ASKED, 6) where polygons shall be tried: model, segment's middle and normal, whether it has been tried."""
    names: Ints
    """(NT + PT, 2) number and marks of each track."""
    tally: Ints
    stamps: Floats
    """(slots, bucket, 2) of each segment in `store`."""
    barred: Floats
    """(BARRED, 5) what does not stand where: x, y, how far around (m), what, and how much must speak for it (nat)."""


def make_state(sensors: int, p: Settings, tracks: int = NT, slots: int = BUCKETS) -> State:
    """Return an empty memory for a ring of `sensors`."""
    z, n = np.zeros, np.int64
    rivals, noises = len(p.radii) + 2, len(p.noises)
    s = State(
        hist=z((sensors, HK, 6)), hn=z(sensors, n), tags=z((slots, 2), n), fill=z(slots, n),
        store=z((slots, BUCKET, 4)), ti=z((tracks, NTI), n), tf=z((tracks, NTF)), comp=z((tracks, rivals)),
        ddl=z(noises), ntot=z(noises), nll=z((tracks, noises)), bins=z((tracks, NB, CAP, 5)), bn=z((tracks, NB), n),
        lines=z((NL, 12)), g=z(8), w=z((WORK, 5)), w2=z((WORK, 5)), wl=z(WORK, n), cur=z((sensors, 6)),
        owner=z(sensors, n), fit=z(12), stats=z(12), segs=z((8 * sensors, SEG + 1)), near=z((32, 4)),
        pi=z((PT, NTI), n), pf=z((PT, NPF)), pbins=z((PT, PB, PCAP, 5)), pbn=z((PT, PB), n), stats2=z(12),
        pose=z(3), root=z(3), cov=z(3), pull=z((PULLING, 5)), all_pull=np.arange(PULLING), last=z((sensors, 5)),
        job=z(24, n), work=z(56), pw=z((PB * PCAP, 5)), asked=z((ASKED, 6)), names=z((tracks + PT, 2), n),
        tally=z(4, n), stamps=z((slots, BUCKET, 2)), barred=z((BARRED, 5)),
    )  # fmt: skip
    clear(s)
    return s


def clear(s: State) -> None:
    """Forget everything but which numbers have been given."""
    for name in s._fields:
        if name not in {"all_pull", "tally"}:
            getattr(s, name)[...] = 0
    s.tally[BARS] = 0
    s.last[...] = np.nan
    s.g[NOISE] = START_NOISE
    s.ddl[START_NOISE] = 6.0

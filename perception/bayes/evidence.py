"""What each reading says of an object, one at a time, for whoever asks why it is believed.

Nothing here touches the memory: who looks must not change what is seen, and a replay in which nobody looked would
differ. What readings say together and not each (drop-outs are dearer where there are many) is left out.
"""

from __future__ import annotations

import numpy as np

from perception.bayes.noise_estimation import noise_variance
from perception.bayes.occlusion import speaks
from perception.bayes.polygon_job import ear_of, sides_of
from perception.bayes.polygon_likelihood import score_poly
from perception.bayes.range_fit import DISPERSION, FAR, score_circle
from perception.bayes.range_fit import LLR as SAID
from perception.bayes.reservoir import flatten
from perception.bayes.state import (
    KIND,
    MODEL,
    NOISE,
    PTH,
    PX,
    PY,
    TRHO,
    TX,
    TY,
    WORK,
    Settings,
    State,
)
from perception.edits import Arc, Evidence
from perception.kernel import Floats, kernel


@kernel
def weigh_circle(s: State, p: Settings, t: int, w: Floats, n: int, stats: Floats, nats: Floats) -> None:
    """Write to `nats`, shape (≥ n,), what each of `n` readings in `w` says of circle `t`; 0 where it cannot speak."""
    x = s.tf[t, TX]
    y = s.tf[t, TY]
    rho = s.tf[t, TRHO]
    var0, rel2 = noise_variance(s, p)
    for j in range(n):
        nats[j] = 0.0
        if speaks(s, p, w[j], x, y, rho, t, var0, rel2):
            score_circle(
                w[j : j + 1], 1, x, y, rho, p.cos_opt, p.cos_half, p.cos_in, p.gate, p.miss, p.short,
                p.levels[int(s.g[NOISE])], p.per_metre, p.table, p.inv_step, stats,
            )  # fmt: skip
            nats[j] = stats[SAID]


@kernel
def weigh_polygon(s: State, p: Settings, t: int, w: Floats, n: int, stats: Floats, nats: Floats) -> None:
    """Write the same for polygon `t`."""
    model = s.pi[t, MODEL]
    faces = p.faces[model, : sides_of(p, model)]
    for j in range(n):
        nats[j] = score_poly(
            w[j : j + 1], 1, 1, s.pf[t, PX], s.pf[t, PY], s.pf[t, PTH], faces, p.closed[model] > 0, ear_of(p),
            p.levels[int(s.g[NOISE])], p.table, p.inv_step, stats,
        )  # fmt: skip


def evidence_of(s: State, p: Settings, row: int, number: int, model: str, labels: tuple[str, ...]) -> Evidence:
    """Return the evidence on the track of a row of `State.names`.

    Parameters
    ----------
    s, p
        Memory and settings.
    row : int
        Circles first, then polygons.
    number, model
        What the object is known by and called.
    labels : tuple of str
        What the columns of `State.comp` are called.
    """
    w, nats, stats = np.empty((WORK, 5)), np.zeros(WORK), np.zeros(DISPERSION + 4)
    t, rivals = row - len(s.ti), tuple[tuple[str, float], ...]()
    if t < 0:
        n = flatten(s.bins, s.bn, row, w)
        weigh_circle(s, p, row, w, n, stats, nats)
        own = int(s.ti[row, KIND])
        led = s.comp[row].tolist()
        rivals = tuple((labels[k], v) for k, v in enumerate(led) if k != own and v != 0.0)
    else:
        n = flatten(s.pbins, s.pbn, t, w)
        weigh_polygon(s, p, t, w, n, stats, nats)
    arcs = tuple(
        Arc(x, y, float(np.arctan2(uy, ux)), r if r < FAR else None, said)
        for (x, y, ux, uy, r), said in zip(w[:n].tolist(), nats[:n].tolist(), strict=True)
    )
    told = nats[:n]
    return Evidence(
        number, model, arcs=arcs, supporting=float(told[told > 0.0].sum()), opposing=float(told[told < 0.0].sum()),
        rivals=rivals,
    )  # fmt: skip

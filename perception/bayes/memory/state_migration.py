"""Migration of the memory when models are added.

Further models are further explanations. Raw readings, walls and positions stay as they are. Values indexed by
explanation move to the explanation's new index, and are compared with the new explanations in turn.
"""

from __future__ import annotations

import numpy as np

from perception.bayes.memory.elements import REJECTIONS_MAX
from perception.bayes.memory.parameters import SWITCH_UNSEEN
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import FREE, Memory
from perception.kernel import Floats, Ints
from perception.records import Structured, column


def radii_of(p: SettingsRecord) -> Floats:
    """Return the radii (m) in competition, shape (n,)."""
    radii: Floats = column(p, "circles")["radius_m"][0, : p[0].circle_count]
    return radii


def migrate(memory: Memory, archived: Structured, before: SettingsRecord, after: SettingsRecord) -> None:
    """Move values indexed by explanation to the indices of other settings.

    Parameters
    ----------
    memory : Memory
        Updated.
    archived : (n,) record of `archived_tracks.archived_dtype`
        Archived circles; updated.
    before, after : (1,) Settings
        Of the models in `after` the polygons of `before` are the first.
    """
    old, new = radii_of(before), radii_of(after)
    index = np.abs(new[None] - old[:, None]).argmin(axis=1)
    for circles in (memory.circles, archived):
        _migrate_circles(circles, old, new, index)
    rejections = memory.state["rejections"][0]
    for k in range(REJECTIONS_MAX):
        if rejections["what"][k] < POLYGON:
            rejections["what"][k] = index[rejections["what"][k]]


def _migrate_circles(circles: Structured, old: Floats, new: Floats, index: Ints) -> None:
    """Move circles from the old radii (m) to those of `index` among the new ones.

    A circle whose radius becomes another one, as a rival's that is too near a model, is refined anew.
    """
    leads = np.zeros_like(circles["leads"])
    for k, to in enumerate(index.tolist()):
        leads[:, to] = circles["leads"][:, k]
    leads[:, len(new) : len(new) + 2] = circles["leads"][:, len(old) : len(old) + 2]
    is_changed = new[index] != old
    for t in np.flatnonzero(circles["status"] != FREE).tolist():
        kind = int(circles["kind"][t])
        circles["kind"][t], circles["alternative"][t] = index[kind], 0
        if is_changed[kind]:
            circles["radius"][t] = new[index[kind]]
            circles["refinements"][t] = 0
            circles["unseen"][t] += SWITCH_UNSEEN
        leads[t, index[kind]] = 0.0
    circles["leads"] = leads

"""Migration of the memory to a larger library of models."""

from __future__ import annotations

import numpy as np

from perception.bayes.inference.kernel_settings import apply_library, copied
from perception.bayes.memory.state import ESTABLISHED
from perception.bayes.memory.state_migration import migrate, radii_of
from tests.naive_tracks import FT
from tests.perception.bayes.random_tracks import RADII, SETTINGS, P, new_memory


def test_a_rival_that_has_become_a_model_is_tracked_as_that_model() -> None:
    """A post of 0.35 ft is a rival of the drums; a model of 0.11 m is that post."""
    post = SETTINGS.models[0].model_copy(update={"name": "bollard", "arc_radius_m": 0.11})
    after = copied(P)
    apply_library(after, (*SETTINGS.models, post))
    new = radii_of(after)
    assert radii_of(P).tolist() == RADII.tolist(), "the earlier settings do not change"
    rival = int(np.argmin(np.abs(RADII - 0.35 * FT)))
    memory, many = new_memory(), len(RADII)
    circles, kinds = memory.circles, (0, rival, many - 1)
    for t, kind in enumerate(kinds):
        circles["status"][t], circles["kind"][t], circles["radius"][t] = ESTABLISHED, kind, RADII[kind]
        circles["leads"][t, : many + 2] = np.arange(many + 2) + 10.0 * t
        circles["leads"][t, kind] = 0.0
    memory.state["rejections"][0, 0] = (1.0, 1.0, 0.3, 0, 40.0)
    memory.state["rejection_count"] = 1
    archived = circles[:3].copy()
    migrate(memory, archived, P, after)
    assert all(np.array_equal(archived[name], circles[name][:3]) for name in ("kind", "radius", "leads", "unseen"))
    leads = circles["leads"]
    assert not leads[:, len(new) + 2 :].any()
    found = circles["kind"][:3].tolist()
    assert new[found].tolist() == circles["radius"][:3].tolist() == [RADII[0], 0.11, RADII[-1]]
    assert found[1] < after[0].model_count
    assert (circles["unseen"][:3] > 0).tolist() == [False, True, False]
    for t, kind in enumerate(kinds):
        for k, rho in enumerate(RADII.tolist()):
            to = int(np.argmin(np.abs(new - rho)))
            assert leads[t, to] == (0.0 if k == kind else k + 10.0 * t)
        assert leads[t, len(new) : len(new) + 2].tolist() == [many + 10.0 * t, many + 1 + 10.0 * t]
    assert new[memory.state["rejections"]["what"][0, 0]] == RADII[0]

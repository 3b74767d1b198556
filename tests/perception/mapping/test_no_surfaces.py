"""What stands in for the map of surfaces has nothing to do, and nothing to report."""

from __future__ import annotations

import numpy as np

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.mapping.no_surfaces import NoSurfaces, SurfaceReport
from perception.mapping.surfaces.surface_map import SurfaceMap


def test_nothing_is_done_and_nothing_is_reported() -> None:
    settings, surfaces = load_settings(), NoSurfaces()
    surfaces.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.ones(len(settings.ring.mounts))))
    surfaces.set_models(settings.models)
    surfaces.apply_settings(settings.perception.surfaces)
    surfaces.follow_maps(1, None)
    surfaces.finish()
    surfaces.drop_caches()
    surfaces.clear()
    assert not surfaces.can_refine
    assert surfaces.converged
    assert surfaces.refine() == 0
    assert surfaces.report(lambda: 1 / 0) == SurfaceReport()  # type: ignore[arg-type,return-value]  # it is not asked
    assert issubclass(SurfaceMap, NoSurfaces)

"""The map of surfaces, whatever their shape: walls in pieces, and polylines, an anytime algorithm.

It is for places that are not made of the shapes of the models. Echoes are shared among the places on their arcs as
the map explains them (`cells`), and the surest lines of occupied cells become walls, the rest polylines (`pieces`,
`polylines`). Local maps hold the readings of a few metres of way; what was found in them stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import SurfacesConfig
from drivers.messages import Firing
from perception.bayes.inference.kernel_settings import circle_models
from perception.bounds import CONSTANT, bounds
from perception.detected_object import DetectedObject
from perception.kernel import Floats
from perception.map_moves import MapMoves
from perception.mapping.no_surfaces import NoSurfaces, SurfaceReport
from perception.mapping.surfaces.beside_known import RIVALS_M, beside_known, nearness, refuted, replaced, wall_prior
from perception.mapping.surfaces.local_map import LocalMapSearch
from perception.mapping.surfaces.parameters import CELL_M, CELLS, PIECE_KEPT_M
from perception.mapping.surfaces.surface_list import Surface, SurfaceList
from perception.records import Structured, zeros
from perception.sensor_mounts import mounts_array, mounts_at

HALF_ANGLE_MAX: Final = math.radians(45.0)


class SurfaceMap(NoSurfaces):
    """Walls and polylines from all echoes, in the frame in which firings are given.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise: what one of the round ones explains better is no wall.
    config : SurfacesConfig
        The settings.
    """

    SCRATCH: Final = ("_known", "_near", "_report", "_archived")
    BOUNDS: Final = bounds(_mounts=CONSTANT)

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: SurfacesConfig) -> None:
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._config = config
        half = min(math.radians(ring.beam_half_angle_deg), HALF_ANGLE_MAX)
        self._search = LocalMapSearch(half, ring.range_max_m, round_radii(models))
        self._list = SurfaceList()
        self._name_sizes(models)
        self._forget_derived()

    def _name_sizes(self, models: Sequence[ModelConfig]) -> None:
        self._reach_m = RIVALS_M | {one.name: one.reach_m for one in models}
        radii, names = circle_models(models)
        self._radius_m = RIVALS_M | dict(zip(names, radii, strict=True))

    def _forget_derived(self) -> None:
        self._known: tuple[DetectedObject, ...] = ()
        self._near = np.zeros((0, 0), np.int64)
        self._report: SurfaceReport | None = None
        self._archived: tuple[tuple[DetectedObject, ...], tuple[DetectedObject, ...]] | None = None

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve before the next firing."""
        return self._search.quanta_left > 0 and self._search.is_due

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve."""
        return not self._search.is_due

    def observe(self, firing: Firing) -> None:
        """Take a firing; its readings are entered by `refine`."""
        x, y = float(firing.pose.x), float(firing.pose.y)
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(firing.ring_yaw)):
            return
        if self._search.has_left(x, y):
            self._list.leave()
            self._search.begin_at(x, y)
        self._search.keep(firing, mounts_at(firing, self._mounts, self._turning))
        self._search.quanta_left = self._config.quanta_per_firing

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Continue in the map of the way with this number; move surfaces with their maps (None: none has moved)."""
        self._search.local["submap"] = submap
        if moves is not None:
            self._search.move(moves)
            self._list.move(moves)
            self._forget_derived()

    def refine(self) -> int:
        """Do one quantum of refinement; return 1."""
        self._search.quanta_left -= 1
        if self._search.refine():
            self._take_over()
        return 1

    def finish(self) -> None:
        """Refine until nothing is left, and search with the last readings: at the end of a log there is time."""
        if self._search.finish():
            self._take_over()

    def _take_over(self) -> None:
        self._list.replace_live(self._found())
        self._forget_derived()

    def _found(self) -> Structured:
        """Return the surfaces of the search that has just ended, as records of `Surface`."""
        pieces = self._search.pieces()
        pieces = pieces[pieces["high"] - pieces["low"] >= PIECE_KEPT_M]
        x, y = self._search.centre
        rows = zeros(Surface, len(pieces))
        for end, along in (("1", pieces["low"]), ("2", pieces["high"])):
            rows[f"x{end}"] = x + pieces["x"] + along * pieces["ux"]
            rows[f"y{end}"] = y + pieces["y"] + along * pieces["uy"]
        middle = 0.5 * (pieces["low"] + pieces["high"])
        rows["variance_turn"] = pieces["variance_turn"]
        rows["variance_across"] = pieces["variance_across"] + middle**2 * pieces["variance_turn"]
        rows["echoes"], rows["evidence"] = pieces["echoes"], pieces["evidence"]
        rows["number"] = -(self._list.numbered + 1 + np.arange(len(rows)))
        self._list.numbered += len(rows)
        found = np.concatenate([rows, self._polyline_rows()])
        found["is_live"] = 1
        found["submap"] = self._search.submaps(found["x1"], found["y1"])
        return found

    def _polyline_rows(self) -> Structured:
        """Return the parts of the polylines through the middles of cells, as records of `Surface`."""
        cells, of = self._search.chains()
        if not len(cells):
            return zeros(Surface, 0)
        x, y = self._search.centre
        xs = x + (cells["i"] + 0.5 - 0.5 * CELLS) * CELL_M
        ys = y + (cells["j"] + 0.5 - 0.5 * CELLS) * CELL_M
        count = np.bincount(of)
        is_alone = count[of] == 1
        begin = np.flatnonzero(np.append(of[1:] == of[:-1], False) | is_alone)
        half_cell = 0.5 * CELL_M * is_alone[begin]  # one cell has its own extent
        end = begin + ~is_alone[begin]
        rows = zeros(Surface, len(begin))
        rows["number"] = self._list.numbered + 1 + of[begin]
        self._list.numbered += len(count)
        rows["x1"], rows["x2"], rows["y1"], rows["y2"] = (
            xs[begin] - half_cell,
            xs[end] + half_cell,
            ys[begin],
            ys[end],
        )
        rows["echoes"] = (np.bincount(of, cells["strength"]) / np.maximum(count, 1))[of[begin]]
        return rows

    def report(self, known: Callable[[], tuple[DetectedObject, ...]]) -> SurfaceReport:
        """Return walls and polylines beside what the method reports; the same tuples until they change.

        Parameters
        ----------
        known : callable
            Returns what the method reports.
        """
        objects = known()
        if self._report is None or objects != self._known:
            rows = self._list.archived_rows
            near, gone = nearness(rows, objects, self._reach_m), frozenset[int]()
            prior = wall_prior(rows, near)
            if prior > 0.0:
                gone = refuted(rows, objects, self._radius_m)
            if gone:
                near = nearness(rows, tuple(one for one in objects if one.number not in gone), self._reach_m)
                prior = wall_prior(rows, near)
            if self._report is None or gone != self._report.refuted or not np.array_equal(near, self._near):
                self._near, self._report = near, beside_known(rows, near, prior)._replace(refuted=gone)
                self._archived = None
            along = replaced(self._report.walls, objects) if prior > 0.0 else frozenset[int]()
            if along != self._report.replaced:
                self._report, self._archived = self._report._replace(replaced=along), None
            self._known = objects
        return self._report

    def archived_shown(
        self, archived: tuple[DetectedObject, ...], known: Callable[[], tuple[DetectedObject, ...]]
    ) -> tuple[DetectedObject, ...]:
        """Return the archived objects without those that surfaces replace or refute.

        They may be many, and this is asked often: another tuple than before is filtered, the same one is not.

        Parameters
        ----------
        archived : tuple of DetectedObject
            What the method left behind; the same tuple until that changes.
        known : callable
            As for `report`.
        """
        report = self.report(known)
        if self._archived is None or archived is not self._archived[0]:
            self._archived = (archived, report.shown(archived))
        return self._archived[1]

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Compare with the round ones of these models."""
        self._search.radii = round_radii(models)
        self._name_sizes(models)
        self._forget_derived()

    def apply_settings(self, config: SurfacesConfig) -> None:
        """Use other settings."""
        self._config = config

    def drop_caches(self) -> None:
        """Derive anew what depends on the memory, after it was overwritten."""
        self._search.drop_caches()
        self._forget_derived()

    def clear(self) -> None:
        """Forget everything, as after a reset of the odometry."""
        self._search.clear()
        self._list.clear()
        self._forget_derived()


def round_radii(models: Sequence[ModelConfig]) -> Floats:
    """Return the radii of the round models, and of what is round besides, m."""
    return np.array(sorted({*RIVALS_M.values(), *circle_models(models)[0]}))

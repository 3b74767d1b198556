"""What perception asks of a map of surfaces, and what stands in for it where the settings have none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from config.model import ModelConfig
from config.settings import SurfacesConfig
from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.map_moves import MapMoves
from perception.polyline import Polyline


class SurfaceReport(NamedTuple):
    """What is reported of the map of surfaces."""

    walls: tuple[DetectedObject, ...] = ()
    polylines: tuple[Polyline, ...] = ()
    refuted: frozenset[int] = frozenset()
    """Numbers of round objects of the method that are not shown: the pieces at their places are straight."""
    replaced: frozenset[int] = frozenset()
    """Numbers of the method's walls that are not shown: pieces stand along them."""

    def shown(self, objects: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return the method's objects without those that the surfaces refute or replace."""
        hidden = self.refuted | self.replaced
        return tuple(one for one in objects if one.number not in hidden) if hidden else objects


class NoSurfaces:
    """A map of surfaces without any."""

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve before the next firing."""
        return False

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve."""
        return True

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Note the number of the map of the way that goes on, and move what is remembered of each."""

    def observe(self, firing: Firing) -> None:
        """Take a firing; its readings are entered by `refine`."""

    def refine(self) -> int:
        """Do one quantum of refinement; return 1, or 0 where nothing is left to improve."""
        return 0

    def finish(self) -> None:
        """Refine until nothing is left, and search with the last readings: at the end of a log there is time."""

    def report(
        self,
        known: Callable[[], tuple[DetectedObject, ...]],  # noqa: ARG002 - other maps need it
    ) -> SurfaceReport:
        """Return walls and polylines beside what the method reports; the same tuples until they change.

        Parameters
        ----------
        known : callable
            Returns what the method reports.
        """
        return SurfaceReport()

    def archived_shown(
        self,
        archived: tuple[DetectedObject, ...],
        known: Callable[[], tuple[DetectedObject, ...]],  # noqa: ARG002 - other maps need it
    ) -> tuple[DetectedObject, ...]:
        """Return all archived objects: no surface replaces or refutes one."""
        return archived

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Compare with these models."""

    def apply_settings(self, config: SurfacesConfig) -> None:
        """Use other settings."""

    def drop_caches(self) -> None:
        """Derive anew what depends on the memory, after it was overwritten."""

    def clear(self) -> None:
        """Forget everything, as after a reset of the odometry."""

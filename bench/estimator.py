"""Interface of a peer in the comparison: associated evidence in, a list of drums out after every reading."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from bench.association import Evidence
from bench.front_end import Place


class Estimator(Protocol):
    """Estimates drums from associated evidence."""

    def take(self, evidence: Evidence) -> None:
        """Process one reading."""
        ...

    def estimates(self) -> Mapping[int, Place]:
        """Return the estimated centre of each track, m; association gates around it."""
        ...

    def drums(self) -> list[Place]:
        """Return the centres of the drums seen so far, m."""
        ...


@dataclass(frozen=True, slots=True)
class Peer:
    """A library in the comparison: its name in the table, its package, and a factory of its estimator."""

    name: str
    package: str
    create: Callable[[], Estimator]
    slow: bool = False
    """Whether the drive of twenty passes is left out because it would take too long."""


class Tracks(ABC):
    """Base of estimators that keep one state per track."""

    def __init__(self) -> None:
        self.places: dict[int, Place] = {}
        self._confirmed: tuple[int, ...] = ()

    def take(self, evidence: Evidence) -> None:
        """Process one reading."""
        self.update(evidence)
        self._confirmed = evidence.confirmed

    @abstractmethod
    def update(self, evidence: Evidence) -> None:
        """Update `places` from `evidence`."""

    def estimates(self) -> Mapping[int, Place]:
        """Return the estimated centre of each track, m."""
        return self.places

    def drums(self) -> list[Place]:
        """Return the centres of the confirmed tracks, m."""
        return [self.places[k] for k in self._confirmed if k in self.places]

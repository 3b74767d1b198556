"""Who takes part, and what each must answer: a list of drums after every reading."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from bench.association import Evidence
from bench.front_end import Place


class Estimator(Protocol):
    """A peer: associated evidence in, drums out."""

    def take(self, evidence: Evidence) -> None:
        """Take in one reading."""
        ...

    def believed(self) -> Mapping[int, Place]:
        """Return where each track is thought to be, m; association gates round it."""
        ...

    def drums(self) -> list[Place]:
        """Return the drums seen so far, m."""
        ...


@dataclass(frozen=True, slots=True)
class Peer:
    """A peer as the table names it: its library, that library's package, and how one begins anew."""

    name: str
    package: str
    begin: Callable[[], Estimator]
    slow: bool = False
    """Whether twenty passes would take it longer than anyone waits."""


class Tracks(ABC):
    """What estimators that follow tracks one by one have in common."""

    def __init__(self) -> None:
        self.places: dict[int, Place] = {}
        self._confirmed: tuple[int, ...] = ()

    def take(self, evidence: Evidence) -> None:
        """Take in one reading."""
        self.update(evidence)
        self._confirmed = evidence.confirmed

    @abstractmethod
    def update(self, evidence: Evidence) -> None:
        """Bring `places` up to date with `evidence`."""

    def believed(self) -> Mapping[int, Place]:
        """Return where each track is thought to be."""
        return self.places

    def drums(self) -> list[Place]:
        """Return the places of those tracks that association calls drums."""
        return [self.places[k] for k in self._confirmed if k in self.places]

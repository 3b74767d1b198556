"""Common interface of our methods and the peers in the comparison, with the time of each reading."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from time import perf_counter
from typing import NamedTuple, Protocol

from bench.association import Association
from bench.estimator import Peer
from bench.front_end import FrontEnd, Place
from config.load import load_settings
from config.robot import RingConfig
from config.settings import Settings
from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.simulation.open_loop import perceive


class ReadingTimes(NamedTuple):
    """Times of one reading, s: the common front end, the association, and the candidate itself."""

    front_end: float
    association: float
    own: float


class Runner(Protocol):
    """Candidate during one drive."""

    def take(self, firing: Firing) -> ReadingTimes:
        """Process one reading; return its times."""
        ...

    def drums(self) -> list[Place]:
        """Return the centres of the drums seen so far, m."""
        ...


@dataclass(frozen=True, slots=True)
class Candidate:
    """Implementation in the comparison: our method or a library."""

    name: str
    version: str
    create: Callable[[], Runner]
    slow: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """One of our own methods: its name in the table, its settings, its object models of a drum."""

    name: str
    sets: tuple[str, ...]
    models: tuple[str, ...] = ("semicircle",)


class OurRunner:
    """Our perception as the runtime uses it; its time includes its own front end and reading its objects."""

    def __init__(self, settings: Settings) -> None:
        self._perception = Perception(settings.ring, settings.models, settings.perception)
        self._names = {model.name for model in settings.models}
        self._seen: tuple[DetectedObject, ...] = ()

    def take(self, firing: Firing) -> ReadingTimes:
        """Process one reading; return its times."""
        begin = perf_counter()
        self._seen = perceive(self._perception, firing)
        return ReadingTimes(0.0, 0.0, perf_counter() - begin)

    def drums(self) -> list[Place]:
        """Return the centres of the drums seen so far, m, without objects of other kinds."""
        return [(seen.x, seen.y) for seen in self._seen if seen.model in self._names]


class PeerRunner:
    """Peer behind the common front end and association."""

    def __init__(self, peer: Peer, ring: RingConfig) -> None:
        self._front_end = FrontEnd(ring)
        self._association = Association(ring)
        self._estimator = peer.create()
        self._drums: list[Place] = []

    def take(self, firing: Firing) -> ReadingTimes:
        """Process one reading; return its times."""
        begin = perf_counter()
        reading = self._front_end.take(firing)
        segments = perf_counter()
        evidence = self._association.take(reading, self._estimator.estimates())
        associated = perf_counter()
        self._estimator.take(evidence)
        self._drums = self._estimator.drums()
        return ReadingTimes(segments - begin, associated - segments, perf_counter() - associated)

    def drums(self) -> list[Place]:
        """Return the centres of the drums seen so far, m."""
        return self._drums


def candidates(methods: Sequence[Method], peers: Sequence[Peer]) -> list[Candidate]:
    """Return all candidates, our methods first; all have the same ring."""
    from runtime import VERSION

    ring = load_settings("hallway").ring

    def ours(method: Method) -> Candidate:
        settings = load_settings("hallway", method.sets, models=method.models)
        return Candidate(method.name, VERSION, lambda: OurRunner(settings))

    def theirs(peer: Peer) -> Candidate:
        return Candidate(peer.name, version(peer.package), lambda: PeerRunner(peer, ring), peer.slow)

    return [*map(ours, methods), *map(theirs, peers)]

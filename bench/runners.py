"""A contestant at work on one drive, with a watch in hand: ours and the peers behind one door."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from time import perf_counter
from typing import NamedTuple, Protocol

from bench.association import Association
from bench.contestant import Peer
from bench.front_end import FrontEnd, Place
from config.load import load_settings
from config.robot import RingConfig
from config.settings import Settings
from drivers.messages import Firing
from perception.pipeline import DetectedObject, Perception
from runtime.simulation.open_loop import perceive


class Watch(NamedTuple):
    """What one reading took, s: the common front end, association, and the contestant itself."""

    front_end: float
    association: float
    own: float


class Runner(Protocol):
    """A contestant on one drive."""

    def take(self, firing: Firing) -> Watch:
        """Take in one reading; return how long that took."""
        ...

    def drums(self) -> list[Place]:
        """Return the drums seen so far, m."""
        ...


@dataclass(frozen=True, slots=True)
class Contestant:
    """Whoever takes part."""

    name: str
    version: str
    begin: Callable[[], Runner]
    slow: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """One of our own methods: what the table calls it, its settings, its models of a drum."""

    name: str
    sets: tuple[str, ...]
    models: tuple[str, ...] = ("semicircle",)


class OurRunner:
    """Perception as the runtime uses it; its own front end is part of its time, and reading out its objects too."""

    def __init__(self, settings: Settings) -> None:
        self._perception = Perception(settings.ring, settings.models, settings.perception)
        self._names = {model.name for model in settings.models}
        self._seen: tuple[DetectedObject, ...] = ()

    def take(self, firing: Firing) -> Watch:
        """Take in one reading."""
        begin = perf_counter()
        self._seen = perceive(self._perception, firing)
        return Watch(0.0, 0.0, perf_counter() - begin)

    def drums(self) -> list[Place]:
        """Return the drums seen so far; a wall or a post that is called one is no drum."""
        return [(seen.x, seen.y) for seen in self._seen if seen.model in self._names]


class PeerRunner:
    """A peer behind the common front end."""

    def __init__(self, peer: Peer, ring: RingConfig) -> None:
        self._front_end = FrontEnd(ring)
        self._association = Association(ring)
        self._estimator = peer.begin()
        self._drums: list[Place] = []

    def take(self, firing: Firing) -> Watch:
        """Take in one reading."""
        begin = perf_counter()
        reading = self._front_end.take(firing)
        segments = perf_counter()
        evidence = self._association.take(reading, self._estimator.believed())
        associated = perf_counter()
        self._estimator.take(evidence)
        self._drums = self._estimator.drums()
        return Watch(segments - begin, associated - segments, perf_counter() - associated)

    def drums(self) -> list[Place]:
        """Return the drums seen so far."""
        return self._drums


def contestants(methods: Sequence[Method], peers: Sequence[Peer]) -> list[Contestant]:
    """Return all who take part, ours first; everyone has the same ring."""
    from runtime import VERSION

    ring = load_settings("hallway").ring

    def ours(method: Method) -> Contestant:
        settings = load_settings("hallway", method.sets, models=method.models)
        return Contestant(method.name, VERSION, lambda: OurRunner(settings))

    def theirs(peer: Peer) -> Contestant:
        return Contestant(peer.name, version(peer.package), lambda: PeerRunner(peer, ring), peer.slow)

    return [*map(ours, methods), *map(theirs, peers)]

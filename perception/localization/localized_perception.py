"""Perception in the map frame: each firing is entered at the corrected pose, so that drift does not smear objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.object_report import worst_sigma
from perception.detected_object import DetectedObject
from perception.localization.drift_correction import DriftCorrection, LocalizedPose, SeenObject
from perception.pipeline import Perception

SHIFT_MIN_M: Final = 0.002
"""An object moves with its landmark once that has moved this far."""


class LocalizedPerception:
    """Perception whose poses are corrected by what it recognises.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise; the round ones become landmarks.
    config : PerceptionConfig
        The method and its settings.

    Attributes
    ----------
    perception : Perception
        In the map frame.
    drift : DriftCorrection
        The landmark filter.
    """

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> None:
        self.perception = Perception(ring, models, config)
        self.drift = DriftCorrection(ring)
        self._radii = {model.name: model.arc_radius_m for model in models if model.arc_radius_m is not None}

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        return self.perception.can_refine

    def observe(self, firing: Firing) -> int:
        """Enter one firing, with its pose by odometry, and return how many outline segments it completed."""
        self.drift.learn(self._seen())
        self.drift.observe(firing)
        self._shift_objects()
        return self.perception.observe(self.drift.corrected(firing))

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero if nothing is left to improve."""
        return self.perception.refine()

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised now in the map frame, best first; landmarks with the filter's place."""
        return tuple(self._placed(seen) for seen in self.perception.objects())

    def localized(self) -> LocalizedPose:
        """Return where the ring is in the map frame."""
        return self.drift.localized()

    def _seen(self) -> list[SeenObject]:
        return [
            SeenObject(seen.number, seen.x, seen.y, self._radii[seen.model])
            for seen in self.perception.objects()
            if seen.number is not None and seen.model in self._radii and not seen.placed
        ]

    def _placed(self, seen: DetectedObject) -> DetectedObject:
        place = None if seen.number is None else self.drift.place(seen.number)
        if place is None:
            return seen
        sigma = worst_sigma(*place.covariance)
        return replace(seen, x=place.x, y=place.y, sigma=sigma, covariance=place.covariance)

    def _shift_objects(self) -> None:
        """Move objects, with the readings kept for them, as their landmarks moved since they were entered."""
        if isinstance(self.perception.method, BayesPerception):
            for number, dx, dy in self.drift.moved_landmarks(SHIFT_MIN_M):
                self.perception.method.shift_circle(number, dx, dy)

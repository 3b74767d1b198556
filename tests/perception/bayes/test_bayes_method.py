"""The method's reports and its kernels: objects reported anew only where they changed, and no allocations."""

from __future__ import annotations

import os

import numpy as np
import pytest
from numba.core.errors import NumbaError

from config.load import load_settings
from perception.bayes import naming
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.kernel_settings import make_settings
from perception.bayes.naming import Reported
from perception.bayes.object_report import circle_object, circle_row
from perception.bayes.settings_record import CIRCLES_MAX, POLYGONS_MAX
from perception.bayes.state import ESTABLISHED, Memory
from perception.detected_object import DetectedObject
from perception.kernel import Floats, kernel
from perception.records import records, zeros
from runtime.simulation.scenes import halls, readings

SETTINGS = load_settings("hallway")
BOXES = load_settings("hallway", models=["semicircle", "box"])


def fresh_report(perception: BayesPerception) -> list[DetectedObject]:
    """Report every sure circle from its track, as if for the first time."""
    memory, sure = perception.memory, np.zeros(len(perception.memory.circles), np.int64)
    reported = records(Reported, zeros(Reported, len(sure)))
    n = naming.report_circles(memory.tracks, reported, sure)
    name = SETTINGS.models[0].name
    rows = [t if t >= 0 else ~t for t in sure[:n].tolist()]
    seen = [circle_object(circle_row(memory, t), name, float(memory.circles["probability"][t])) for t in rows]
    return sorted(seen, key=lambda o: o.score, reverse=True)


@pytest.mark.compiled
def test_no_object_is_out_of_date() -> None:
    perception, most = BayesPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes), 0
    for seed in (0, 1):
        for firing in readings(SETTINGS.ring, halls("moved")[seed], seed):
            perception.observe(firing)
            assert list(perception.objects()) == fresh_report(perception)
            while perception.can_refine and perception.refine():
                assert list(perception.objects()) == fresh_report(perception)
            most = max(most, len(perception.objects()))
        perception.reset()
        assert perception.objects() == ()
    assert most == 6


def test_only_what_changed_is_reported_anew() -> None:
    rng, memory = np.random.default_rng(5), Memory(4, 6)
    circles = memory.circles
    last = zeros(Reported, 6)
    last["x"] = np.nan
    reported = records(Reported, last)
    for name in ("x", "y", "covariance_xx", "covariance_xy", "covariance_yy", "hits", "probability"):
        circles[name] = rng.normal(size=6)
    circles["kind"] = rng.integers(0, 3, 6)
    circles["is_named"] = 1

    def report(*tracks: int) -> list[int]:
        circles["status"] = 0
        circles["status"][list(tracks)] = ESTABLISHED
        sure = np.full(8, 99, np.int64)
        n = naming.report_circles(memory.tracks, reported, sure)
        assert sure[n:].tolist() == [99] * (8 - n)
        found: list[int] = sure[:n].tolist()
        return found

    assert report(0, 2, 5) == [~0, ~2, ~5]
    assert report(0, 2, 4, 5) == [0, 2, ~4, 5]
    for name in ("x", "y", "covariance_xx", "covariance_xy", "covariance_yy", "hits", "probability"):
        circles[name][2] += 1e-12
        assert report(0, 2, 5) == [0, ~2, 5], name
        assert report(0, 2, 5) == [0, 2, 5], name
    circles["kind"][5] += 1
    assert report(2, 5) == [2, ~5]
    for name in ("number", "marks"):
        circles[name][2] += 1
        assert report(2, 5) == [~2, 5], name


def test_more_models_than_there_is_room_for_are_refused() -> None:
    round_model, box = BOXES.models
    for model, most in ((round_model, CIRCLES_MAX - 3), (box, POLYGONS_MAX)):
        radii = np.linspace(1.0, 3.0, most + 1).tolist() if model is round_model else [None] * (most + 1)
        models = [model.model_copy(update={"name": f"m{k}", "arc_radius_m": r}) for k, r in enumerate(radii)]
        make_settings(BOXES.ring, models[:-1], BOXES.perception.bayes)
        with pytest.raises(ValueError, match="at a time; leave some out"):
            make_settings(BOXES.ring, models, BOXES.perception.bayes)


@kernel
def allocates(n: int) -> Floats:
    """Make an array, which no kernel may."""
    return np.zeros(n)


@kernel
def divides(a: float, b: float) -> float:
    """Divide."""
    return a / b


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}, reason="nothing is compiled")
def test_a_kernel_that_allocates_is_refused() -> None:
    with pytest.raises(NumbaError):
        allocates(3)


def test_a_kernel_still_raises() -> None:
    assert divides(1.0, 4.0) == 0.25
    with pytest.raises(ZeroDivisionError):
        divides(1.0, 0.0)

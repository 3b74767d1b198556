"""The method as perception calls it: reports, counts, models, meaningless input; and kernels without allocations."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.memory.state import ESTABLISHED, FREE, TENTATIVE
from perception.bayes.reports.object_report import CIRCLE_FIELDS, circle_object
from perception.bayes.segments.segment_list import count_again
from perception.bayes.tracks import naming
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import ConfirmObject, PinSegments, PlaceModel
from perception.kernel import Floats, kernel
from perception.records import Structured, records, zeros
from perception.shared_numbers import FAR
from runtime.simulation.scenes import halls, readings
from tests.perception.bayes.random_tracks import BOXES, NOISES, SENSORS, SETTINGS


def fresh_report(perception: BayesPerception) -> list[DetectedObject]:
    """Return every sure circle as a report from its track, without the reports before."""
    memory, sure = perception.memory, np.zeros(len(perception.memory.circles), np.int64)
    reported = records(naming.Reported, zeros(naming.Reported, len(sure)))
    n = naming.report_circles(memory.tracks, perception.settings, reported, sure)
    name = SETTINGS.models[0].name
    rows = [t if t >= 0 else ~t for t in sure[:n].tolist()]
    circles = memory.circles
    seen = [
        circle_object(
            tuple(circles[field][t].item() for field in CIRCLE_FIELDS), name, float(circles["probability"][t])
        )
        for t in rows
    ]
    return sorted(seen, key=lambda o: o.score, reverse=True)


@pytest.mark.compiled
def test_reported_objects_are_never_out_of_date() -> None:
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


def garbage(rng: np.random.Generator) -> Firing:
    """Return a firing whose pose, time and ranges may be NaN, infinite, negative, zero or huge."""
    values = [math.nan, math.inf, -math.inf, 0.0, -1.0, 1e-300, 1e300, 1e5, 2 * FAR]
    ranges = rng.uniform(0, 5, SENSORS)
    chance = rng.random(SENSORS)
    ranges = np.where(chance < 0.3, rng.choice(values, SENSORS), np.where(chance < 0.5, np.round(ranges, 1), ranges))
    x, y, heading, time_s = rng.normal(0, 0.4, 4).tolist()
    if rng.random() < 0.2:
        x, y, heading, time_s = (float(rng.choice([v, *values])) for v in (x, y, heading, time_s))
    return Firing(time_s * 10.0, Pose(x, y, heading), heading, ranges)


def leaves(array: Structured) -> Iterator[Structured]:
    """Yield the numbers of an array of records, field by field."""
    if array.dtype.names is None:
        yield array
    for name in array.dtype.names or ():
        yield from leaves(array[name])


@pytest.mark.boundscheck
@pytest.mark.parametrize(("tracks", "firings"), [(1, 6), pytest.param(48, 60, marks=pytest.mark.compiled)])
def test_meaningless_firings_leave_a_finite_memory(tracks: int, firings: int) -> None:
    config = SETTINGS.perception.bayes.model_copy(update={"tracks_max": tracks})
    for seed, settings in enumerate((SETTINGS, BOXES)):
        rng, perception = np.random.default_rng(seed), BayesPerception(SETTINGS.ring, settings.models, config)
        memory = perception.memory
        for _ in range(firings):
            perception.observe(garbage(rng))
            while perception.can_refine:
                perception.refine()
            for seen in perception.labelled_objects():
                assert np.isfinite([seen.x, seen.y, seen.theta, seen.sigma, seen.score]).all()
                assert 0.0 <= (seen.probability or 0.0) <= 1.0
        state, circles, polygons = memory.state, memory.circles, memory.polygons
        for array in (circles, polygons, state["roughness_nat"], state["residuals_nat"]):
            assert all(np.isfinite(leaf).all() for leaf in leaves(array))
        for array in (state["sensors"]["history"], state["buckets"]["segments"]):
            assert all(np.isfinite(leaf).all() for leaf in leaves(array))
        assert set(np.unique(circles["status"])) | set(np.unique(polygons["status"])) <= {
            FREE,
            TENTATIVE,
            ESTABLISHED,
        }
        assert len(circles) == tracks
        assert ((circles["kind"] >= 0) & (circles["kind"] < perception.settings[0].circle_count)).all()
        assert 0 <= state["noise_level"][0] < len(NOISES)


def perception_of_both_models(**config: Any) -> BayesPerception:
    """Return an empty perception of drums and boxes."""
    return BayesPerception(BOXES.ring, BOXES.models, BOXES.perception.bayes.model_copy(update=config))


def test_an_empty_map_has_no_objects_and_nothing_to_refine() -> None:
    perception = perception_of_both_models()
    assert perception.objects() == perception.labelled_objects() == ()
    assert (perception.can_refine, perception.converged, perception.refine()) == (False, True, 0)
    assert perception.counts == MapCounts(0, 0, 0)
    assert perception.segments().geometry.shape == (0, 5)


def test_an_object_is_shifted_with_the_readings_kept_for_it() -> None:
    perception = perception_of_both_models()
    assert perception.edit(PlaceModel("drum", 1.0, 0.0, 0.0)) is None
    (number,) = (o.number for o in perception.objects())
    (row,) = np.flatnonzero(perception.memory.circles["number"] == number)
    kept = perception.memory.circles["bins"]["readings"][row]
    kept["x"], kept["y"] = 2.0, 3.0
    perception.shift_object(number or 0, 0.1, -0.2)
    perception.shift_object(99, 5.0, 5.0)
    assert [(o.x, o.y) for o in perception.objects()] == [pytest.approx((1.1, -0.2))]
    kept = perception.memory.circles["bins"]["readings"][row]
    assert np.unique(kept["x"]) == pytest.approx(2.1)
    assert np.unique(kept["y"]) == pytest.approx(2.8)


def test_a_placed_object_is_reported_until_the_map_is_reset() -> None:
    perception = perception_of_both_models()
    assert perception.edit(PlaceModel("drum", 1.0, 0.0, 0.0)) is None
    assert perception.edit(PlaceModel("box", -1.0, 0.0, 0.0)) is None
    assert sorted((o.model, o.x, o.placed) for o in perception.objects()) == [
        ("box", -1.0, True), ("drum", 1.0, True),
    ]  # fmt: skip
    assert perception.counts.hypotheses == 2
    numbers = {o.model: o.number for o in perception.objects()}
    for model, number in numbers.items():
        assert number is not None
        evidence = perception.evidence(number)
        assert evidence is not None
        assert (evidence.object, evidence.model, evidence.arcs) == (number, model, ())
    assert perception.evidence(99) is None
    perception.reset()
    assert perception.objects() == ()
    assert perception.counts.hypotheses == 0


def test_a_changed_object_is_reported_anew_and_an_unchanged_one_is_the_same_object() -> None:
    perception = perception_of_both_models()
    for x in (1.0, 3.0):
        perception.edit(PlaceModel("drum", x, 0.0, 0.0))
    first = {o.number: o for o in perception.objects()}
    perception.edit(ConfirmObject(2))
    second = {o.number: o for o in perception.objects()}
    assert second[1] is first[1]
    assert second[2] == replace(first[2], confirmed=True)


def test_added_models_are_reported_by_their_names() -> None:
    perception = perception_of_both_models()
    keg = BOXES.models[0].model_copy(update={"name": "keg", "arc_radius_m": 0.2})
    perception.edit(PlaceModel("drum", 1.0, 0.0, 0.0))
    assert perception.edit(PlaceModel("keg", 3.0, 0.0, 0.0)) is not None
    perception.set_models((*BOXES.models, keg))
    assert perception.edit(PlaceModel("keg", 3.0, 0.0, 0.0)) is None
    assert sorted((o.model, o.x) for o in perception.objects()) == [("drum", 1.0), ("keg", 3.0)]


def test_a_firing_takes_as_many_quanta_as_configured_and_circles_and_polygons_alternate() -> None:
    """Every track always has unseen evidence, so the quanta of a firing are all used."""
    perception = perception_of_both_models(quanta_per_firing=2, polygon_quanta_per_firing=1)
    perception.edit(PlaceModel("drum", 1.0, 0.0, 0.0))
    perception.edit(PlaceModel("box", -1.0, 0.0, 0.0))
    memory, silence = perception.memory, np.full(SENSORS, np.nan)
    order: list[str] = []
    for k in range(4):
        memory.circles["unseen"][0] = 50
        memory.polygons["unseen"][0] = 50
        perception.observe(Firing(float(k), Pose(0.0, 0.0, 0.0), 0.0, silence))
        assert perception.can_refine
        circles = int(memory.state["refinements"][0])
        while perception.can_refine and perception.refine():
            is_circle = int(memory.state["refinements"][0]) > circles
            order.append("circle" if is_circle else "polygon")
            circles = int(memory.state["refinements"][0])
    assert order.count("polygon") == 4
    assert order.count("circle") >= 4


def test_a_pinned_segment_survives_the_segments_after_it() -> None:
    perception = perception_of_both_models()
    drive = readings(SETTINGS.ring, halls("walls")[0], 0)
    while not len(perception.segments().numbers):
        perception.observe(next(drive))
    number = int(perception.segments().numbers[0])
    assert perception.edit(PinSegments((number,), pinned=True)) is None
    geometry = perception.segments().geometry[0].tolist()
    perception.memory.state["buckets"]["count"] = 0
    count_again(perception.memory)
    perception.observe(Firing(1e3, Pose(0.0, 0.0, 0.0), 0.0, np.full(SENSORS, np.nan)))
    kept = perception.segments()
    assert kept.numbers.tolist() == [number]
    assert kept.pinned.tolist() == [1]
    assert kept.geometry[0].tolist() == geometry
    assert perception.segment_geometry().tolist() == kept.geometry.tolist()
    assert perception.counts.segments == 1


def test_settings_change_while_running_except_the_number_of_tracks() -> None:
    perception = perception_of_both_models()
    changed = BOXES.perception.bayes.model_copy(update={"report_probability": 0.8, "tracks_max": 3})
    tracks = len(perception.memory.circles)
    perception.apply_settings(BOXES.perception.model_copy(update={"bayes": changed}))
    assert perception.settings[0].report_probability == 0.8
    assert len(perception.memory.circles) == tracks


@kernel
def allocates(n: int) -> Floats:
    """Return a new array, which a kernel must not make."""
    return np.zeros(n)


@kernel
def divides(a: float, b: float) -> float:
    """Return a quotient."""
    return a / b


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}, reason="nothing is compiled")
def test_a_kernel_that_allocates_is_refused() -> None:
    """Before it is compiled, as numpy's function is not what a kernel may be made of."""
    with pytest.raises(TypeError, match="zeros"):
        allocates(3)


def test_a_kernel_raises_on_division_by_zero() -> None:
    assert divides(1.0, 4.0) == 0.25
    with pytest.raises(ZeroDivisionError):
        divides(1.0, 0.0)

"""The way in: one handle instead of two named tuples, objects told anew only where they changed, no allocations."""

from __future__ import annotations

import os

import numpy as np
import pytest
from numba.core.errors import NumbaError

from config.load import load_settings
from perception.bayes import entry, observe, polygon_tracks, refine
from perception.bayes import object_report as report
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.object_report import TOLD
from perception.bayes.state import C00, C11, HITS, KIND, MARK, NTF, NTI, NUMBER, PROB, TX, TY, make_state
from perception.detected_object import DetectedObject
from perception.kernel import Floats, kernel
from runtime.simulation.scenes import halls, readings

SETTINGS = load_settings("hallway")
BOXES = load_settings("hallway", models=["semicircle", "box"])
SHARE = SETTINGS.perception.bayes.fresh_share


@pytest.mark.compiled
def test_what_goes_in_by_the_handle_comes_to_the_same() -> None:
    """Two memories, one reached by its handle and one by its arrays, hold the same after every call."""
    method = BayesPerception(BOXES.ring, BOXES.models, BOXES.perception.bayes)
    mounts, p = np.array(BOXES.ring.mounts, dtype=np.float64), method.settings
    direct, held = (make_state(len(mounts), p) for _ in range(2))
    handle, quanta = entry.hold(held, p), 0
    for firing in list(readings(BOXES.ring, halls("boxes_45")[0], seed=3))[:48]:
        at = (firing.pose.x, firing.pose.y, firing.ring_yaw, firing.robot_s, firing.ranges_m, SHARE)
        told = observe.observe(direct, p, mounts, *at)
        assert entry.observe(handle, mounts, *at) == told
        if told[1]:
            assert entry.quantum(handle, SHARE) == refine.quantum(direct, p, SHARE)
            quanta += 1
        assert entry.pquantum(handle, SHARE) == polygon_tracks.pquantum(direct, p, SHARE)
        for name in ("tf", "ti", "bins", "pf", "pi", "lines", "g"):
            np.testing.assert_allclose(getattr(held, name), getattr(direct, name), 1e-9, 1e-12, err_msg=name)
    assert quanta > 10
    assert held.g.any()


def afresh(perception: BayesPerception) -> list[DetectedObject]:
    """Tell every sure circle from its track, as if for the first time."""
    s, p, sure = perception.memory, perception.settings, np.zeros(len(perception.memory.ti), np.int64)
    n = report.sure_circles(s.ti, s.names, sure)
    name = SETTINGS.models[0].name
    told = [report.circle(s, p, t, name, float(s.tf[t, PROB])) for t in sure[:n].tolist()]
    return sorted(told, key=lambda o: o.score, reverse=True)


@pytest.mark.compiled
def test_no_object_is_out_of_date() -> None:
    perception, most = BayesPerception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes), 0
    for seed in (0, 1):
        for firing in readings(SETTINGS.ring, halls("moved")[seed], seed):
            perception.observe(firing)
            assert list(perception.objects()) == afresh(perception)
            while perception.can_refine and perception.refine():
                assert list(perception.objects()) == afresh(perception)
            most = max(most, len(perception.objects()))
        perception.reset()
        assert perception.objects() == ()
    assert most == 6


def test_only_what_changed_is_marked() -> None:
    rng = np.random.default_rng(5)
    ti, tf, told = np.zeros((6, NTI), np.int64), rng.normal(size=(6, NTF)), np.full((6, TOLD), np.nan)
    names = np.zeros((6, 2), np.int64)
    ti[:, KIND] = rng.integers(0, 3, 6)

    def marked(*tracks: int) -> list[int]:
        sure = np.array([*tracks, 99, 99], np.int64)
        report.mark_changed(ti, tf, names, told, len(tracks), sure)
        assert sure[-2:].tolist() == [99, 99]
        return [int(t) for t in sure[:-2]]

    assert marked(0, 2, 5) == [~0, ~2, ~5]
    assert marked(0, 2, 4, 5) == [0, 2, ~4, 5]
    for column in (TX, TY, C00, C00 + 1, C11, HITS, PROB):
        tf[2, column] += 1e-12
        assert marked(0, 2, 5) == [0, ~2, 5], column
        assert marked(0, 2, 5) == [0, 2, 5], column
    ti[5, KIND] += 1
    assert marked(2, 5) == [2, ~5]
    for column in (NUMBER, MARK):
        names[2, column] += 1
        assert marked(2, 5) == [~2, 5], column


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

"""Kind and place of a surface from one stand, against closed forms and the shortest way over sampled surfaces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.echo_kind import KINDS, EchoKind, echo_kind, half_paths_over_circle
from perception.kernel import Floats

RADIUS_M, STEP = 0.381, math.radians(15.0)


def pairs_of() -> tuple[Floats, Floats]:
    """Return emitters and listeners: three sensors that fire, each heard by itself and by four on either side."""
    numbers = [(j, i) for j in (-1, 0, 1) for i in range(j - 4, j + 5)]
    places = RADIUS_M * np.exp(1j * STEP * np.array(numbers))
    t, l = places[:, 0], places[:, 1]  # noqa: E741
    return np.stack((t.real, t.imag), 1), np.stack((l.real, l.imag), 1)


def half_paths(kind: str, bearing: float, range_m: float, radius_m: float = 0.0) -> Floats:
    """Return half paths over a surface, by closed forms in the sensors' own ranges, or by sampling the cylinder."""
    emitters, listeners = pairs_of()
    t, l = emitters @ [1, 1j], listeners @ [1, 1j]  # noqa: E741
    out = complex(math.cos(bearing), math.sin(bearing))
    if kind == "cylinder":
        rim = (range_m + radius_m) * out + radius_m * np.exp(2j * math.pi * np.arange(200_000) / 200_000)
        return np.array([0.5 * (abs(rim - a) + abs(rim - b)).min() for a, b in zip(t, l, strict=True)])
    apart = abs(t - l)
    if kind == "plane":
        a, b = range_m - (t * out.conjugate()).real, range_m - (l * out.conjugate()).real
        return np.asarray(0.5 * np.sqrt(4 * a * b + apart**2))
    a, b = abs(range_m * out - t), abs(range_m * out - l)
    return np.asarray(0.5 * (np.sqrt(2 * (a**2 + b**2) - apart**2) if kind == "corner" else a + b))


def heard(half_paths_m: Floats, noise_m: float = 1e-3, resolution_m: float = 0.0) -> EchoKind:
    found = echo_kind(*pairs_of(), half_paths_m, noise_m, resolution_m)
    assert found is not None
    return found


@pytest.mark.covered
@pytest.mark.parametrize("kind", ["plane", "corner", "edge"])
@pytest.mark.parametrize(("bearing", "range_m"), [(0.1, 0.9), (-0.12, 3.0)])
def test_exact_paths_give_place_and_kind(kind: str, bearing: float, range_m: float) -> None:
    found = heard(half_paths(kind, bearing, range_m), 1e-5)
    assert found.kind == kind
    assert found.bearing == pytest.approx(bearing, abs=1e-6)
    assert found.range_m == pytest.approx(range_m, abs=1e-6)
    assert found.misfit < 1e-3


@pytest.mark.covered
def test_a_cylinder_lies_between_edge_and_plane() -> None:
    found = heard(half_paths("cylinder", 0.05, 1.2, 0.3))
    assert found.kind == "cylinder"
    assert found.radius_m == pytest.approx(0.3, abs=0.1)
    assert found.range_m == pytest.approx(1.2, abs=1e-3)
    assert heard(half_paths("cylinder", 0.05, 3.0, 0.03)).kind == "convex", "as good as an edge"


def test_the_way_over_a_circle_is_the_shortest() -> None:
    rng = np.random.default_rng(3)
    for radius_m in (0.01, 0.3, 2.0):
        centre = (radius_m + 1.0) * np.exp(0.4j)
        t, l = (0.4 * (rng.uniform(-1, 1, 6) + 1j * rng.uniform(-1, 1, 6)) for _ in range(2))  # noqa: E741
        rim = centre + radius_m * np.exp(2j * math.pi * np.arange(100_000) / 100_000)
        least = [0.5 * (abs(rim - a) + abs(rim - b)).min() for a, b in zip(t, l, strict=True)]
        np.testing.assert_allclose(half_paths_over_circle(t, l, complex(centre), radius_m), least, atol=1e-8)


@pytest.mark.covered
def test_places_are_as_far_off_as_the_deviations_say() -> None:
    rng, errors = np.random.default_rng(4), []
    for _ in range(8):
        found = heard(half_paths("plane", 0.1, 2.0) + 1e-3 * rng.standard_normal(27))
        assert found.kind == "plane"
        errors.append(((found.bearing - 0.1) / found.sigma_bearing, (found.range_m - 2.0) / found.sigma_range_m))
    assert 0.5 < np.std(errors) < 1.6


@pytest.mark.covered
def test_coarse_ranges_leave_the_kind_unknown_however_often_they_come() -> None:
    step = 0.03048
    for kind in KINDS:
        rounded = np.rint(half_paths(kind, 0.05, 4.5, 0.3) / step) * step
        one = heard(rounded, 1e-3, step)
        assert one.kind == "unknown"
        emitters, listeners = pairs_of()
        repeated = echo_kind(
            np.tile(emitters, (50, 1)), np.tile(listeners, (50, 1)), np.tile(rounded, 50), 1e-3, step
        )
        assert repeated is not None
        assert repeated.kind == "unknown"
        assert repeated.probabilities == pytest.approx(one.probabilities, abs=0.02)


def test_too_few_paths_and_arrays_that_do_not_fit() -> None:
    emitters, listeners = pairs_of()
    paths = half_paths("plane", 0.0, 1.0)
    assert echo_kind(emitters[:2], listeners[:2], paths[:2], 1e-3) is None
    same = np.tile(emitters[:1], (5, 1))
    assert echo_kind(same, same, paths[:5], 1e-3) is None, "one path, heard five times"
    with pytest.raises(ValueError, match="half paths"):
        echo_kind(emitters, listeners, paths[:5], 1e-3)
    with pytest.raises(ValueError, match="half paths"):
        echo_kind(emitters, listeners, np.full(27, math.inf), 1e-3)
    with pytest.raises(ValueError, match="expected a positive length"):
        echo_kind(emitters, listeners, paths, 0.0)

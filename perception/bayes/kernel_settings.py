"""What the Bayesian method's kernels are told: made once from the ring, the model library and the configuration.

The constants were found on random halls with the Denning's ring and hold for other rings as well, because what
depends on the ring (beam, resolution, reach) and on the models (radius, outline) is taken from there. Lengths that
depend on neither are about how near things stand to one another in a building; they are metres, at a tenth of a foot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import BayesConfig
from config.units import FOOT_M
from perception.bayes.likelihood import BINS, LEVELS, build_levels, build_table
from perception.bayes.state import Settings
from perception.kernel import Floats, Ints
from perception.object_model import ObjectModel

RIVALS_M: Final = (0.0, 0.35 * FOOT_M, 2.2 * FOOT_M)
"""Radii that every circle has to beat: an edge or corner, a post, a barrel."""
RIVAL_APART_M: Final = 0.1 * FOOT_M
"""A rival as near as this to a model's radius is that model."""
SAME_RADIUS_M: Final = 1e-3
"""Models of radii as near as this are one circle, and the first of them lends its name."""
CHORDS: Final = 10

MAY_DEG: Final = 0.4
"""A reading this far outside the beam may match: mounts and headings are not known better."""
MUST_DEG: Final = 1.5
"""A reading must hit only this far inside it: sensitivity fades towards the edge."""
DENSITY_M: Final = 15.0 * FOOT_M
"""Something else answers from anywhere up to here: the background's density is one over it."""
OUTLIERS: Final = 0.03
SIGMAS_M: Final = (0.001 * FOOT_M, 0.6 * FOOT_M)
"""Least and greatest noise of the likelihood's table."""
ABSOLUTE_M: Final = tuple(v * FOOT_M for v in (0.003, 0.012, 0.03, 0.05, 0.08))
RELATIVE: Final = (0.0, 0.005, 0.01, 0.02)
"""The noises between which the method decides: σ² = absolute² + (relative · range)²."""
PER_METRE: Final = 2.0 / FOOT_M
"""Range bins in which a noise is taken as one."""
RANGE_BINS: Final = 64


def polygon_symmetry(vertices: Floats) -> int:
    """Return how often a closed outline looks alike in a turn about the origin; vertices of shape (n, 2), m."""
    n = len(vertices)
    size = float(np.hypot(vertices[:, 0], vertices[:, 1]).max())
    for order in range(n, 1, -1):
        if n % order == 0:
            c, s = math.cos(2.0 * math.pi / order), math.sin(2.0 * math.pi / order)
            turned = vertices @ np.array([[c, s], [-s, c]])
            if np.allclose(turned, np.roll(vertices, -(n // order), axis=0), atol=1e-6 * size + 1e-9):
                return order
    return 1


def circle_models(models: Sequence[ModelConfig]) -> tuple[list[float], list[str]]:
    """Return radii (m, ascending) and names of the round models, one for each radius."""
    radii: list[float] = []
    names: list[str] = []
    for radius, name in [(m.arc_radius_m, m.name) for m in models if m.arc_radius_m is not None]:
        if all(abs(radius - other) > SAME_RADIUS_M for other in radii):
            radii.append(radius)
            names.append(name)
    order = np.argsort(radii, kind="stable")
    return [radii[i] for i in order], [names[i] for i in order]


def _chords(radius: float) -> Floats:
    """Return the chords of a circle as sides; shape (CHORDS, 4)."""
    a = np.linspace(0.0, 2.0 * math.pi, CHORDS + 1)
    p = radius * np.column_stack([np.cos(a), np.sin(a)])
    d = np.diff(p, axis=0)
    return np.column_stack([0.5 * (p[1:] + p[:-1]), np.arctan2(d[:, 1], d[:, 0]), np.hypot(d[:, 0], d[:, 1])])


def least_half_width(corners: Floats) -> float:
    """Return half the width of an outline in the direction in which it is narrowest; vertices of shape (n, 2), m."""
    along = corners[:, None] - corners[None]
    across = np.column_stack([-along[..., 1].ravel(), along[..., 0].ravel()])
    length = np.hypot(across[:, 0], across[:, 1])
    far = corners @ (across[length > 0.0] / length[length > 0.0, None]).T
    return 0.5 * float((far.max(axis=0) - far.min(axis=0)).min())


def _polygons(models: Sequence[ModelConfig]) -> tuple[Floats, Ints, Ints, Ints, Floats, Floats, Floats, Floats]:
    """Return vertices, how many, closed, symmetry, inner and outer radius, sides and faces of the polygon models."""
    many, most = max(1, len(models)), max([4, *(len(m.vertices_m) for m in models)])
    vertices, sides, faces = np.zeros((many, most, 2)), np.zeros((many, most, 4)), np.zeros((many, most, 5))
    count, closed, symmetry = np.zeros(many, np.int64), np.zeros(many, np.int64), np.ones(many, np.int64)
    inner, bound = np.zeros(many), np.zeros(many)
    for i, model in enumerate(models):
        corners = np.array(model.vertices_m, dtype=np.float64)
        following = np.roll(corners, -1, axis=0)
        if model.closed and np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]) < 0.0:
            corners = np.ascontiguousarray(corners[::-1])  # kernels take the outside to lie right of each side
        object_sides = ObjectModel.from_config(model.model_copy(update={"vertices_m": corners.tolist()})).sides
        n, k = len(corners), len(object_sides)
        vertices[i, :n], sides[i, :k], count[i], closed[i] = corners, object_sides, n, model.closed
        x, y, direction = object_sides[:, 0], object_sides[:, 1], object_sides[:, 2]
        tangents = np.column_stack([np.cos(direction), np.sin(direction)])
        faces[i, :k] = np.column_stack([corners[:k], tangents, object_sides[:, 3]])
        # The origin may lie on a side, or outside of a hollow outline; then its width tells how large it is.
        inner[i] = max(np.abs(x * tangents[:, 1] - y * tangents[:, 0]).min(), least_half_width(corners))
        bound[i] = np.hypot(corners[:, 0], corners[:, 1]).max()
        symmetry[i] = polygon_symmetry(corners) if model.closed else 1
    return vertices, count, closed, symmetry, inner, bound, sides, faces


def tuned(p: Settings, config: BayesConfig) -> Settings:
    """Return the kernels' settings with what a running process may change taken from `config`."""
    return p._replace(
        attempts=config.attempts_per_firing,
        report=config.report_probability,
        report_near=min(config.report_probability, config.report_probability_near),
    )


def library(models: Sequence[ModelConfig]) -> dict[str, Any]:
    """Return what of the kernels' settings depends on the models: round ones by their radius, others by outline."""
    known, _ = circle_models(models)
    rivals = [r for r in RIVALS_M if all(abs(r - k) > RIVAL_APART_M for k in known)]
    if not known:
        rivals = [*rivals[1:], rivals[0]]  # hypotheses need a body to lie behind a segment, and a point is none
    radii = np.array([*known, *rivals])
    outlines = [m for m in models if m.arc_radius_m is None]
    vertices, count, closed, symmetry, inner, bound, sides, faces = _polygons(outlines)
    return {
        "merge": 0.9 * float(radii[0]), "radii": radii, "models": len(known),
        "sides": np.array([_chords(r) for r in radii]), "polys": len(outlines), "verts": vertices, "nv": count,
        "closed": closed, "sym": symmetry, "inner": inner, "bound": bound, "psides": sides, "faces": faces,
    }  # fmt: skip


def make_settings(ring: RingConfig, models: Sequence[ModelConfig], config: BayesConfig) -> Settings:
    """Return the kernels' settings.

    Parameters
    ----------
    ring : RingConfig
        Beam, resolution and reach.
    models : sequence of ModelConfig
        The library: round ones by their radius, the others by their outline.
    config : BayesConfig
        What a user may set.
    """
    half_angle = math.radians(ring.beam_half_angle_deg)
    may, must = half_angle + math.radians(MAY_DEG), max(0.5 * half_angle, half_angle - math.radians(MUST_DEG))
    half_box = 0.5 * ring.resolution_m
    table, inv_step, sigmas = np.empty((LEVELS, BINS)), np.empty(LEVELS), np.empty(LEVELS)
    build_table(half_box, *SIGMAS_M, 1.0 / DENSITY_M, OUTLIERS, table, inv_step, sigmas)
    noises = np.array([(a, b) for a in ABSOLUTE_M for b in RELATIVE])
    levels = np.empty((len(noises), max(RANGE_BINS, math.ceil(ring.range_max_m * PER_METRE))), np.int64)
    build_levels(noises, sigmas, levels, PER_METRE)
    untuned = Settings(
        half_angle=half_angle,
        cos_half=math.cos(half_angle),
        cos_opt=math.cos(may),
        cos_in=math.cos(must),
        half_box=half_box,
        gate=0.5 * FOOT_M,
        miss=math.log(0.1),
        short=-1.0,
        unknown=2.0,
        unknown_poly=2.9,
        prior=3.0,
        spread=0.0015,
        far=6.0 * FOOT_M,
        far_price=2.0 / FOOT_M,
        rough_gate=20.0,
        range_max=ring.range_max_m,
        pair_max=12.0 * FOOT_M,
        spacing=0.2 * FOOT_M,
        gap=30.0,
        per_metre=PER_METRE,
        all_until=80,
        claim=4.0 * FOOT_M,
        attempts=0,
        hyp_sigma=0.7 * FOOT_M,
        table=table,
        inv_step=inv_step,
        noises=noises,
        levels=levels,
        inflate=1.1,
        report=0.0,
        report_near=0.0,
        quiet=12,
        polish=6,
        **library(models),
    )
    return tuned(untuned, config)

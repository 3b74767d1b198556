"""Construction of the settings record from the ring, the model library and the configuration.

The method's own numbers come from `perception.bayes.memory.parameters` and
`perception.bayes.memory.polygon_parameters`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import BayesConfig
from perception.bayes.inference.likelihood import build_levels, build_table
from perception.bayes.memory.parameters import (
    BACKGROUND_RANGE_M,
    COMPARE_ALL_BELOW,
    DIFFUSE_SILENCE,
    DISPERSION_MIN,
    FAR_M,
    FAR_NAT_PER_M,
    FINAL_REFINEMENTS,
    GATE_M,
    HISTORY_SPACING_M,
    HYPOTHESIS_SIGMA_MAX_M,
    IDLE_FIRINGS,
    MAY_ANSWER_DEG,
    MERGE_RADII,
    MIRRORS_HEARD,
    MISSED_ECHO_PROBABILITY,
    MODEL_PRIOR_NAT,
    MUST_ANSWER_DEG,
    NOISE_ABSOLUTE_M,
    NOISE_RELATIVE,
    OUTLIER_SHARE,
    PAIR_GAP_S,
    PAIR_RANGE_MAX_M,
    RIVAL_APART_M,
    RIVAL_RADII_M,
    ROUGHNESS_GATE_NAT,
    SHORT_ECHO_NAT,
    TABLE_SIGMAS_M,
    UNKNOWN_NAT,
)
from perception.bayes.memory.polygon_parameters import POLYGON_UNKNOWN_NAT
from perception.bayes.memory.settings_record import (
    CHORDS,
    CIRCLES_MAX,
    POLYGONS_MAX,
    TABLE_LEVELS,
    NoiseModel,
    PolygonModel,
    Settings,
    SettingsRecord,
)
from perception.kernel import Floats
from perception.object_model import ObjectModel
from perception.records import array_of, column, records, zeros

SAME_RADIUS_M: Final = 1e-3
"""Models of radii as near as this are one circle, named after the first of them."""


def polygon_symmetry(vertices: Floats) -> int:
    """Return the order of a closed outline's rotational symmetry about the origin; vertices of shape (n, 2), m."""
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
    """Return half of an outline's least width, m; vertices of shape (n, 2), m."""
    along = corners[:, None] - corners[None]
    across = np.column_stack([-along[..., 1].ravel(), along[..., 0].ravel()])
    length = np.hypot(across[:, 0], across[:, 1])
    far = corners @ (across[length > 0.0] / length[length > 0.0, None]).T
    return 0.5 * float((far.max(axis=0) - far.min(axis=0)).min())


def _enter_polygon(outline: PolygonModel, model: ModelConfig) -> None:
    """Write a polygon model's outline, size and symmetry to its record, which must be zero."""
    corners = np.array(model.vertices_m, dtype=np.float64)
    following = np.roll(corners, -1, axis=0)
    if model.closed and np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]) < 0.0:
        corners = np.ascontiguousarray(corners[::-1])  # kernels expect the outside on the right of each side
    sides = ObjectModel.from_config(model.model_copy(update={"vertices_m": corners.tolist()})).sides
    x, y, direction = sides[:, 0], sides[:, 1], sides[:, 2]
    tangents = np.column_stack([np.cos(direction), np.sin(direction)])
    outline.vertex_count, outline.side_count, outline.is_closed = len(corners), len(sides), int(model.closed)
    outline.relaxation_sides[: len(sides)] = sides
    for k, corner in enumerate(corners.tolist()):
        outline.sides[k].x, outline.sides[k].y = corner
    for k, (tangent, length) in enumerate(zip(tangents.tolist(), sides[:, 3].tolist(), strict=True)):
        outline.sides[k].tangent_x, outline.sides[k].tangent_y = tangent
        outline.sides[k].length = length
    # The origin may lie on a side, or outside of a hollow outline; then the width gives the size.
    nearest = float(np.abs(x * tangents[:, 1] - y * tangents[:, 0]).min())
    outline.inner_radius_m = max(nearest, least_half_width(corners))
    outline.outer_radius_m = float(np.hypot(corners[:, 0], corners[:, 1]).max())
    outline.symmetry = polygon_symmetry(corners) if model.closed else 1


def apply_config(p: SettingsRecord, config: BayesConfig) -> None:
    """Write the settings that may change in a running process."""
    p[0].attempts_per_firing = config.attempts_per_firing
    p[0].report_probability = config.report_probability
    p[0].report_probability_near = min(config.report_probability, config.report_probability_near)


def apply_library(p: SettingsRecord, models: Sequence[ModelConfig]) -> None:
    """Write the models: round ones by their radius, others by their outline.

    Raises
    ------
    ValueError
        There are more models than the record holds.
    """
    known, _ = circle_models(models)
    rivals = [r for r in RIVAL_RADII_M if all(abs(r - k) > RIVAL_APART_M for k in known)]
    if not known:
        rivals = [*rivals[1:], rivals[0]]  # hypotheses need a body behind a segment, and a point has no extent
    radii = [*known, *rivals]
    outlines = [m for m in models if m.arc_radius_m is None]
    if len(radii) > CIRCLES_MAX or len(outlines) > POLYGONS_MAX:
        raise ValueError(
            f"{len(known)} round models and {len(outlines)} polygons are too many: at most "
            f"{CIRCLES_MAX - len(RIVAL_RADII_M)} and {POLYGONS_MAX} can be recognised at a time; leave some out"
        )
    for name in ("circles", "polygons"):
        column(p, name).view(np.uint8)[...] = 0
    p[0].model_count, p[0].circle_count, p[0].polygon_count = len(known), len(radii), len(outlines)
    p[0].merge_m = MERGE_RADII * radii[0]
    for k, radius in enumerate(radii):
        p[0].circles[k].radius_m = radius
        p[0].circles[k].chords[...] = _chords(radius)
    for k, model in enumerate(outlines):
        _enter_polygon(p[0].polygons[k], model)


def copied(p: SettingsRecord) -> SettingsRecord:
    """Return a copy of the settings."""
    return records(Settings, array_of(p).copy())


def make_settings(ring: RingConfig, models: Sequence[ModelConfig], config: BayesConfig) -> SettingsRecord:
    """Return the settings for a ring, a library and a configuration.

    Parameters
    ----------
    ring : RingConfig
        Beam, resolution and range.
    models : sequence of ModelConfig
        The library: round ones by their radius, the others by their outline.
    config : BayesConfig
        The settings that a user may change.

    Raises
    ------
    ValueError
        There are more models than the record holds.
    """
    p = records(Settings, zeros(Settings, 1))
    half_angle = math.radians(ring.beam_half_angle_deg)
    may, must = (
        half_angle + math.radians(MAY_ANSWER_DEG),
        max(0.5 * half_angle, half_angle - math.radians(MUST_ANSWER_DEG)),
    )
    it = p[0]
    it.half_angle_rad = half_angle
    it.cos_half_angle, it.sin_half_angle = math.cos(half_angle), math.sin(half_angle)
    it.cos_may_answer, it.cos_must_answer = math.cos(may), math.cos(must)
    it.sin_must_answer = math.sqrt(1.0 - it.cos_must_answer * it.cos_must_answer)
    it.half_resolution_m = 0.5 * ring.resolution_m
    it.range_min_m, it.range_max_m = ring.range_min_m, ring.range_max_m
    it.gate_m = GATE_M
    it.missed_echo_nat = math.log(MISSED_ECHO_PROBABILITY)
    it.short_echo_nat = SHORT_ECHO_NAT
    it.unknown_nat = UNKNOWN_NAT
    it.unknown_polygon_nat = POLYGON_UNKNOWN_NAT
    it.model_prior_nat = MODEL_PRIOR_NAT
    it.dispersion_min = DISPERSION_MIN
    it.far_m = FAR_M
    it.far_nat_per_m = FAR_NAT_PER_M
    it.roughness_gate_nat = ROUGHNESS_GATE_NAT
    it.pair_range_max_m = PAIR_RANGE_MAX_M
    it.history_spacing_m = HISTORY_SPACING_M
    it.pair_gap_s = PAIR_GAP_S
    it.compare_all_below = COMPARE_ALL_BELOW
    it.hypothesis_sigma_m = HYPOTHESIS_SIGMA_MAX_M
    it.idle_firings = IDLE_FIRINGS
    it.final_refinements = FINAL_REFINEMENTS
    sigmas = np.empty(TABLE_LEVELS)
    build_table(
        float(it.half_resolution_m),
        *TABLE_SIGMAS_M,
        1.0 / BACKGROUND_RANGE_M,
        OUTLIER_SHARE,
        column(p, "table")[0],
        column(p, "table_bins_per_m")[0],
        sigmas,
    )
    it.silent_share_min = DIFFUSE_SILENCE * max(0.0, 1.0 - MIRRORS_HEARD * half_angle / math.pi)
    for noise, (absolute, relative) in zip(
        it.noises, itertools.product(NOISE_ABSOLUTE_M, NOISE_RELATIVE), strict=True
    ):
        noise.absolute_m, noise.relative = absolute, relative
    build_levels(records(NoiseModel, column(p, "noises")[0]), sigmas)
    apply_library(p, models)
    apply_config(p, config)
    return p

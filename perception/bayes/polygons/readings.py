"""Selection of the raw readings that bear on a polygon, and their collection from the sensors' histories."""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import CROSS_HISTORY, HISTORY, Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.kernel import kernel


@kernel
def bears_on_polygon(q: Reading, cx: float, cy: float, bound: float, p: SettingsRecord) -> bool:
    """Return whether a reading is evidence for or against a body within a circle.

    Parameters
    ----------
    q : Reading
        The reading.
    cx, cy, bound : float
        Centre and radius of the circle, m.
    p : (1,) Settings
        The beam; a range that ends farther than the gate before the circle is not evidence, nor is one of a sensor
        farther off than `pair_range_max_m`.
    """
    reach = p[0].pair_range_max_m
    dx = cx - q.x
    dy = cy - q.y
    dot = dx * q.axis_x + dy * q.axis_y
    if dot <= 0.0 or dot > reach:
        return False
    # by how much the centre lies outside the nearer edge of the beam
    if abs(dx * q.axis_y - dy * q.axis_x) * p[0].cos_half_angle - dot * p[0].sin_half_angle > bound:
        return False
    d = math.sqrt(dx * dx + dy * dy)
    if is_crossed(q) and q.range_m > d + bound + p[0].gate_m:
        return False
    return d <= reach and q.range_m >= d - bound - p[0].gate_m


@kernel
def gather_polygon_history(s: StateRecord, p: SettingsRecord, model: int, cx: float, cy: float) -> int:
    """Copy the remembered readings that bear on a polygon at (cx, cy) to the scratch; return their number.

    Parameters
    ----------
    s, p
        Memory and settings.
    model : int
        Which polygon.
    cx, cy : float
        m.
    """
    readings = s[0].scratch.readings
    bound = p[0].polygons[model].outer_radius_m
    n = 0
    for i in range(s[0].sensor_count):
        sensor = s[0].sensors[i]
        for k in range(min(sensor.kept, HISTORY)):
            if bears_on_polygon(sensor.history[k], cx, cy, bound, p):
                if n >= len(readings):
                    return n
                copy_reading(sensor.history[k], readings[n])
                n += 1
    kept = s[0].crosses_kept
    for k in range(min(kept, CROSS_HISTORY)):
        q = s[0].crosses[(kept - 1 - k) % CROSS_HISTORY]
        if bears_on_polygon(q, cx, cy, bound, p):
            if n >= len(readings):
                return n
            copy_reading(q, readings[n])
            n += 1
    return n

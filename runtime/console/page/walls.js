// @ts-check
// Walls are lines among the objects: how far they are from a point, and what stands behind them as the robot sees it.

import { counted } from "./units.js";

const BEHIND_M = 0.1; // an object in front of a wall may touch it

/** @template {{ ends: Quad | null }} T @param {T} object @returns {object is T & { ends: Quad }} */
export const isWall = (object) => Boolean(object.ends);

// "6", "6, and 2 walls"
/** @param {ShownObject[]} objects */
export function countObjects(objects) {
  const walls = objects.filter(isWall).length,
    others = objects.length - walls;
  return walls > 0 ? `${others}, and ${counted(walls, "wall")}` : `${others}`;
}

// The distance of a point from a line x1, y1, x2, y2, in m.
/** @param {Quad} line @param {number} x @param {number} y */
export function distanceToLine([x1, y1, x2, y2], x, y) {
  const dx = x2 - x1,
    dy = y2 - y1,
    square = dx * dx + dy * dy;
  const along = square > 0 ? Math.max(0, Math.min(1, ((x - x1) * dx + (y - y1) * dy) / square)) : 0;
  return Math.hypot(x - x1 - along * dx, y - y1 - along * dy);
}

// The wall that hides an object from the robot, null if none does: the sight line to its middle crosses the wall, and
// the whole object (radius in m) lies beyond it.
/** @param {{ pose: Triple; objects: ShownObject[] }} state @param {ShownObject} object @param {number} radius */
export function hidingWall({ pose: [rx, ry], objects }, object, radius) {
  if (isWall(object)) return null;
  const { x, y } = object;
  for (const wall of objects) {
    if (!isWall(wall)) continue;
    const [x1, y1, x2, y2] = wall.ends;
    /** @param {number} px @param {number} py */
    const side = (px, py) => (x2 - x1) * (py - y1) - (y2 - y1) * (px - x1);
    /** @param {number} px @param {number} py */
    const across = (px, py) => (x - rx) * (py - ry) - (y - ry) * (px - rx);
    const crosses = side(rx, ry) * side(x, y) < 0 && across(x1, y1) * across(x2, y2) < 0;
    if (crosses && distanceToLine(wall.ends, x, y) > radius + BEHIND_M) return wall;
  }
  return null;
}

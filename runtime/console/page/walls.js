// Walls are lines among the objects: how far they are from a point, and what stands behind them as the robot sees it.

const BEHIND_M = 0.1; // an object in front of a wall may touch it

export const isWall = ({ ends }) => Boolean(ends);

// "6", "6, and 2 walls"
export function countObjects(objects) {
  const walls = objects.filter(isWall).length,
    others = objects.length - walls;
  return walls > 0 ? `${others}, and ${walls} wall${walls > 1 ? "s" : ""}` : `${others}`;
}

// The distance of a point from a line x1, y1, x2, y2, in m.
export function distanceToLine([x1, y1, x2, y2], x, y) {
  const dx = x2 - x1,
    dy = y2 - y1,
    square = dx * dx + dy * dy;
  const along = square > 0 ? Math.max(0, Math.min(1, ((x - x1) * dx + (y - y1) * dy) / square)) : 0;
  return Math.hypot(x - x1 - along * dx, y - y1 - along * dy);
}

// The wall that hides an object from the robot, null if none does: the sight line to its middle crosses the wall, and
// the
// whole object (radius in m) lies beyond it.
export function hidingWall({ pose: [rx, ry], objects }, object, radius) {
  if (isWall(object)) return null;
  const { x, y } = object;
  for (const wall of objects) {
    if (!isWall(wall)) continue;
    const [x1, y1, x2, y2] = wall.ends;
    const side = (px, py) => (x2 - x1) * (py - y1) - (y2 - y1) * (px - x1);
    const across = (px, py) => (x - rx) * (py - ry) - (y - ry) * (px - rx);
    const crosses = side(rx, ry) * side(x, y) < 0 && across(x1, y1) * across(x2, y2) < 0;
    if (crosses && distanceToLine(wall.ends, x, y) > radius + BEHIND_M) return wall;
  }
  return null;
}

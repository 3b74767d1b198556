// Places of the plane, which is odometry's, in the map frame and back.

// A place of the plane in the map frame where the robot's place there is known, so that it stays in the room. A robot
// that is lost had one: a goal waits in the map until it is found, and is not driven to by a place that is wrong.
export function inMap(localized, x, y) {
  if (localized?.status !== "tracking" && localized?.status !== "lost") return { x, y };
  const [x0, y0, turn] = localized.frame,
    c = Math.cos(turn),
    s = Math.sin(turn);
  return { x: c * (x - x0) + s * (y - y0), y: c * (y - y0) - s * (x - x0), frame: "map" };
}

// A place and direction of a frame in the plane; null where the map frame is not known.
export function inPlane(localized, frame, x, y, heading) {
  if (frame !== "map") return [x, y, heading];
  if (!localized) return null;
  const [x0, y0, turn] = localized.frame,
    c = Math.cos(turn),
    s = Math.sin(turn);
  return [x0 + c * x - s * y, y0 + s * x + c * y, heading === null ? null : heading + turn];
}

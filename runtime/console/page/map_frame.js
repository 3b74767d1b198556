// @ts-check
// Places of the plane, which is odometry's, in the map frame and back.

// A place of the plane in the map frame where the robot's place there is known, so that it stays in the room. A robot
// that is lost had one: a goal waits in the map until it is found, and is not driven to by a place that is wrong.
/** @param {Localized} localized @param {number} x @param {number} y @returns {Point & { frame?: Frame }} */
export function inMap(localized, x, y) {
  if (localized?.status !== "tracking" && localized?.status !== "lost") return { x, y };
  const [mapX, mapY] = ofPlane(localized.frame, x, y);
  return { x: mapX, y: mapY, frame: "map" };
}

// A place of the plane in a frame, which is given by its origin and turn in the plane.
/** @param {Triple} frame @param {number} x @param {number} y @returns {Pair} */
export function ofPlane([x0, y0, turn], x, y) {
  const c = Math.cos(turn),
    s = Math.sin(turn);
  return [c * (x - x0) + s * (y - y0), c * (y - y0) - s * (x - x0)];
}

// A place and direction of a frame in the plane; null where the map frame is not known.
/**
 * @param {Localized} localized @param {Frame} frame
 * @param {number} x @param {number} y @param {number | null} heading @returns {[number, number, number | null] | null}
 */
export function inPlane(localized, frame, x, y, heading) {
  if (frame !== "map") return [x, y, heading];
  if (!localized) return null;
  const [x0, y0, turn] = localized.frame,
    c = Math.cos(turn),
    s = Math.sin(turn);
  return [x0 + c * x - s * y, y0 + s * x + c * y, heading === null ? null : heading + turn];
}

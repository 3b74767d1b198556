// @ts-check
// The waypoint tool: a click adds a waypoint, a drag from it gives its final heading; a waypoint can be dragged
// elsewhere, and its heading by the end of its line.

import { drawTape } from "./tool_overlays.js";
import { addLine, textWithHalo } from "./scene.js";

export const DOT_PX = 9;
export const HEADING_PX = 24;
const REACH_PX = 13;
const TOUCH_PX = 22;
const DRAG_PX = 12;
const TURN_RAD = Math.PI / 12;

// Presses and drags of tools that take a place and, by a drag from it, a direction.
/** @param {Spot | null} from @param {Spot | null} to */
export function pressedHeading(from, to) {
  return from && to && Math.hypot(to.sx - from.sx, to.sy - from.sy) > DRAG_PX
    ? Math.atan2(to.y - from.y, to.x - from.x)
    : null;
}

/** @param {Pick<Parts, "route" | "view" | "redraw">} parts @returns {Tool} */
export function routeTool({ route, view, redraw }) {
  let from = /** @type {Spot | null} */ (null),
    to = /** @type {Spot | null} */ (null);
  // The waypoint that is dragged: its index, and whether by the end of its heading.
  let grip = /** @type {{ i: number; turns: boolean } | null} */ (null);

  /** @param {number} i */
  const shown = (i) => {
    const at = route.inPlane(route.waypoints[i]);
    if (at === null) return null;
    const [sx, sy] = view.toScreen(at[0], at[1]);
    return { sx, sy, heading: at[2] };
  };
  /** @param {Spot} at */
  const gripAt = ({ sx, sy, touch }) => {
    const reach = touch ? TOUCH_PX : REACH_PX;
    for (let i = route.waypoints.length - 1; i >= route.behind; i--) {
      const dot = shown(i);
      if (dot === null) continue;
      if (Math.hypot(dot.sx - sx, dot.sy - sy) <= reach) return { i, turns: false };
      if (dot.heading === null) continue;
      const ex = dot.sx + HEADING_PX * Math.cos(dot.heading),
        ey = dot.sy - HEADING_PX * Math.sin(dot.heading);
      if (Math.hypot(ex - sx, ey - sy) <= reach) return { i, turns: true };
    }
    return null;
  };
  const stop = () => {
    from = to = grip = null;
    redraw();
  };
  const moved = () => from !== null && to !== null && Math.hypot(to.sx - from.sx, to.sy - from.sy) > 4;
  return {
    id: "route",
    sends: true,
    name: "Waypoints: click to add, drag for the final heading, drag one to move it",
    icon: "i-route",
    down(at) {
      from = to = at;
      grip = gripAt(at);
    },
    move(at) {
      to = at;
      redraw();
    },
    up(at) {
      if (!from) return;
      to = at;
      if (grip === null) route.add(from.x, from.y, pressedHeading(from, to));
      else if (!moved()) route.select(grip.i === route.selected ? null : grip.i);
      else if (grip.turns) {
        const dot = shown(grip.i);
        if (dot !== null) route.turn(grip.i, Math.atan2(dot.sy - at.sy, at.sx - dot.sx));
      } else route.move(grip.i, at.x, at.y);
      stop();
    },
    // Of the selected waypoint: delete it, turn its final heading.
    key(event) {
      const i = route.selected;
      if (i === null) return false;
      if (event.key === "Delete" || event.key === "Backspace") route.remove(i);
      else if (event.key === "[" || event.key === "]") {
        route.turn(i, (route.inPlane(route.waypoints[i])?.[2] ?? 0) + (event.key === "[" ? TURN_RAD : -TURN_RAD));
      } else return false;
      return true;
    },
    none: () => route.select(null),
    cancel: stop,
    draw(f) {
      const isPressed = (grip !== null && moved()) || pressedHeading(from, to) !== null;
      if (isPressed && from !== null && to !== null) drawTape(f, from, to);
    },
    drawAlways: (f) => drawRoute(f, route),
  };
}

// The waypoints that the robot does not drive yet, and the selected one. Those that it drives are a layer of the map.
/** @param {Drawing} f @param {Route} route */
function drawRoute(f, route) {
  const { ctx, theme, view } = f;
  const places = route.waypoints.map((waypoint) => route.inPlane(waypoint)).filter((place) => place !== null);
  if (places.length === 0 || places.length < route.waypoints.length) return;
  f.onScreen();
  ctx.save();
  const points = places.map(([x, y, heading]) => /** @type {const} */ ([...view.toScreen(x, y), heading]));
  ctx.strokeStyle = ctx.fillStyle = theme.drive;
  ctx.lineWidth = 2;
  if (!route.isDriven) {
    ctx.setLineDash([3, 4]);
    ctx.beginPath();
    addLine(ctx, points);
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.font = theme.font(11, 700);
    ctx.textBaseline = "middle";
    for (const [i, [x, y, heading]] of points.entries()) {
      if (heading !== null) {
        const ex = x + HEADING_PX * Math.cos(heading),
          ey = y - HEADING_PX * Math.sin(heading);
        ctx.lineWidth = 3;
        ctx.beginPath();
        ctx.moveTo(x, y);
        ctx.lineTo(ex, ey);
        ctx.stroke();
        ctx.beginPath();
        ctx.arc(ex, ey, 3.5, 0, 2 * Math.PI);
        ctx.fill();
        ctx.lineWidth = 2;
      }
      ctx.beginPath();
      ctx.arc(x, y, DOT_PX, 0, 2 * Math.PI);
      ctx.fillStyle = theme.paper;
      ctx.fill();
      ctx.stroke();
      ctx.fillStyle = theme.drive;
      ctx.textAlign = "center";
      ctx.fillText(String(i + 1), x, y);
    }
  }
  if (route.selected !== null && route.selected < points.length) {
    const [x, y] = points[route.selected],
      [px, py, turn] = route.waypoints[route.selected];
    ctx.lineWidth = 3;
    ctx.strokeStyle = theme.accent;
    ctx.beginPath();
    ctx.arc(x, y, DOT_PX + 4, 0, 2 * Math.PI);
    ctx.stroke();
    ctx.font = theme.font(11.5, 600);
    ctx.textAlign = "left";
    textWithHalo(f, `${f.units.place(px, py)}${turn === null ? "" : `, ${turn}°`}`, x + 16, y + 18, theme.ink);
  }
  ctx.restore();
}

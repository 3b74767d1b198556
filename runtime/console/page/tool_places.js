// @ts-check
// The places tool: clicks draw a place, a line or an area, corner by corner; a corner can be dragged elsewhere. A click
// on the first corner of an area, or on the last one of a line, ends it, and so does Enter there.

import { cornersOf, CORNERS_MIN, KIND_NAMES } from "./places.js";
import { addLine } from "./scene.js";
import { drawTape } from "./tool_overlays.js";
import { pressedHeading } from "./tool_route.js";

const DOT_PX = 4;
const REACH_PX = 11;
const TOUCH_PX = 22;

/** @param {Pick<Parts, "places" | "view" | "redraw">} parts */
export function placesTool({ places, view, redraw }) {
  let kind = /** @type {PlaceKind} */ ("place"),
    draft = /** @type {Pair[]} */ ([]); // corners in the frame of the places
  let from = /** @type {Spot | null} */ (null),
    to = /** @type {Spot | null} */ (null),
    grip = /** @type {[PlaceKind, number, number] | null} */ (null); // the corner that is dragged: kind, index, corner

  /** @param {Pair} corner */
  const screen = (corner) => {
    const at = places.inPlane(corner);
    return at && view.toScreen(at[0], at[1]);
  };
  /** @param {Pair | undefined} corner @param {Spot} at */
  const isAt = (corner, { sx, sy, touch }) => {
    const at = corner && screen(corner);
    return at !== null && at !== undefined && Math.hypot(at[0] - sx, at[1] - sy) <= (touch ? TOUCH_PX : REACH_PX);
  };
  /** @param {Spot} at @returns {[PlaceKind, number, number] | null} */
  const gripAt = (at) => {
    for (const one of KIND_NAMES) {
      for (const [i, row] of places.all[one].entries()) {
        const corner = cornersOf(row).findIndex((place) => isAt(place, at));
        if (corner >= 0) return [one, i, corner];
      }
    }
    return null;
  };
  const changed = () => {
    places.emit("changed");
    redraw();
  };
  const stop = () => {
    from = to = grip = null;
    redraw();
  };
  const moved = () => from !== null && to !== null && Math.hypot(to.sx - from.sx, to.sy - from.sy) > 4;
  const tool = {
    id: "places",
    sends: true,
    name: "Places and no-go areas: click the corners, on the last one to end; drag a corner to move it",
    icon: "i-places",
    get kind() {
      return kind;
    },
    set kind(/** @type {PlaceKind} */ chosen) {
      kind = chosen;
      draft = [];
      changed();
    },
    get isDrawing() {
      return draft.length > 0;
    },
    get canFinish() {
      return draft.length >= CORNERS_MIN[kind];
    },
    async finish() {
      if (!tool.canFinish) return;
      const drawn = draft,
        drawnKind = kind;
      draft = [];
      changed();
      const refused = (await places.add(kind, drawn)) !== null;
      if (!refused || draft.length > 0 || kind !== drawnKind) return;
      draft = drawn; // to be mended by taking corners back
      changed();
    },
    // Takes back the last corner of what is being drawn; false where nothing is.
    dropCorner() {
      if (draft.length === 0) return false;
      draft = draft.slice(0, -1);
      changed();
      return true;
    },
    undo() {
      if (!tool.dropCorner()) places.undo();
    },
    /** @param {Spot} at */
    down(at) {
      from = to = at;
      grip = draft.length > 0 ? null : gripAt(at);
    },
    /** @param {Spot} at */
    move(at) {
      to = at;
      redraw();
    },
    /** @param {Spot} at */
    hover(at) {
      to = at;
      redraw();
    },
    /** @param {Spot} at */
    up(at) {
      if (!from) return;
      to = at;
      if (grip !== null) {
        const corner = moved() ? places.ofPlane(at.x, at.y) : null;
        if (corner) places.moveCorner(...grip, [corner[0], corner[1]]);
        else places.select([grip[0], grip[1]]);
      } else if (kind === "place") {
        const there = places.ofPlane(from.x, from.y, pressedHeading(from, to));
        if (there) places.add("place", [[there[0], there[1]]], there[2]);
      } else if (tool.canFinish && (isAt(draft.at(-1), at) || (kind !== "no_go_line" && isAt(draft[0], at)))) {
        tool.finish();
      } else if (draft.length === 0 || !isAt(draft.at(-1), at)) {
        const there = places.ofPlane(at.x, at.y);
        if (there) draft = [...draft, [there[0], there[1]]];
        changed();
      }
      stop();
    },
    /** @param {KeyboardEvent} event */
    key(event) {
      if (!["Delete", "Backspace"].includes(event.key)) return false;
      if (!tool.dropCorner() && places.selected) places.remove(...places.selected);
      return true;
    },
    // Escape: what is being drawn is dropped, then nothing is selected.
    none() {
      if (draft.length === 0) places.select(null);
      draft = [];
      changed();
    },
    end() {
      draft = [];
      changed();
    },
    cancel: stop,
    /** @param {Drawing} f */
    draw(f) {
      const { ctx, theme } = f;
      f.onScreen();
      ctx.save();
      ctx.fillStyle = theme.paper;
      ctx.strokeStyle = theme.stop;
      ctx.lineWidth = 1.5;
      for (const one of KIND_NAMES.filter((name) => name !== "place"))
        for (const row of places.all[one]) for (const at of cornersOf(row).map(screen)) if (at) dot(ctx, at);
      const points = draft.map(screen).filter((at) => at !== null);
      if (points.length > 0) {
        ctx.strokeStyle = kind === "speed_area" ? theme.warning : theme.stop;
        ctx.lineWidth = 2;
        ctx.setLineDash([5, 4]);
        ctx.beginPath();
        addLine(ctx, points);
        if (to) ctx.lineTo(to.sx, to.sy);
        ctx.stroke();
        ctx.setLineDash([]);
        for (const at of points) dot(ctx, at);
      }
      ctx.restore();
      const isPressed = grip !== null ? moved() : kind === "place" && pressedHeading(from, to) !== null;
      if (isPressed && from !== null && to !== null) drawTape(f, from, to);
    },
  };
  return tool;
}

/** @param {CanvasRenderingContext2D} ctx @param {Pair} at */
function dot(ctx, [x, y]) {
  ctx.beginPath();
  ctx.arc(x, y, DOT_PX, 0, 2 * Math.PI);
  ctx.fill();
  ctx.stroke();
}

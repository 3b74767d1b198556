// @ts-check
// Tools that move and rotate an object, or place a model, which then relaxes from there.

import { byId, byKey, el } from "./dom.js";
import { ofPlane } from "./map_frame.js";
import { drawPreview } from "./tool_overlays.js";
import { objectAt } from "./tool_select.js";
import { isWall } from "./walls.js";

const HANDLE_PX = 20;
const ARM_PX = 30;
const NUDGE_M = 0.01;
const TURN = Math.PI / 36;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const TURNS = { "[": TURN, "]": -TURN };

/** @param {ModelRow | null} model */
const radiusOf = (model) => {
  if (!model) return 0.1;
  return model.arc_radius_m ?? Math.max(...model.vertices.map(([x, y]) => Math.hypot(x, y)));
};

/** @param {View} view @param {ModelRow | null} model @param {Pose} pose */
function handleOf(view, model, { x, y, theta }) {
  const reach = radiusOf(model) + ARM_PX / view.scale;
  return { x: x + reach * Math.cos(theta), y: y + reach * Math.sin(theta) };
}

/** @param {Pick<Parts, "run" | "view" | "selection" | "mapEdits" | "redraw">} parts @returns {Tool} */
export function moveTool({ run, view, selection, mapEdits, redraw }) {
  /** @type {{ pose: Pose; dx: number; dy: number; turning: boolean; model: string; moved: boolean } | null} */
  let held = null;

  /** @param {ShownObject | null} object */
  const standing = (object) => (object === null || isWall(object) ? null : object); // walls are not moved
  const picked = () => (selection.object === null ? null : standing(run.object(selection.object)));
  /** @param {Pose} object */
  const poseOf = ({ x, y, theta }) => ({ x, y, theta });
  const drop = () => {
    held = null;
    redraw();
  };
  return {
    id: "move",
    sends: true,
    name: "Move and turn an object",
    icon: "i-move",
    down(at) {
      const object = picked();
      if (object !== null) {
        const handle = handleOf(view, run.model(object.model), object);
        if (Math.hypot(handle.x - at.x, handle.y - at.y) < HANDLE_PX / view.scale) {
          held = { pose: poseOf(object), dx: 0, dy: 0, turning: true, model: object.model, moved: false };
          return;
        }
      }
      const hit = standing(objectAt(run, view, at));
      selection.pick(hit?.number ?? null);
      held =
        hit === null
          ? null
          : { pose: poseOf(hit), dx: hit.x - at.x, dy: hit.y - at.y, turning: false, model: hit.model, moved: false };
      redraw();
    },
    move(at) {
      if (held === null) return;
      if (held.turning) held.pose.theta = Math.atan2(at.y - held.pose.y, at.x - held.pose.x);
      else Object.assign(held.pose, { x: at.x + held.dx, y: at.y + held.dy });
      held.moved = true;
      redraw();
    },
    up() {
      if (held?.moved && selection.object !== null) mapEdits.move(selection.object, held.pose);
      drop();
    },
    cancel: drop,
    none: () => selection.pick(null),
    // Arrows nudge the picked object by a centimetre (with Shift ten), brackets turn it by 5°.
    key(event, spot) {
      const object = picked();
      if (event.key === "Enter") {
        selection.pick(standing(objectAt(run, view, spot()))?.number ?? null);
        return true;
      }
      if (object === null || object.number === null) return false;
      const by = byKey(event, ARROWS),
        turn = byKey(event, TURNS);
      const step = NUDGE_M * (event.shiftKey ? 10 : 1);
      const pose = poseOf(object);
      if (by) mapEdits.move(object.number, { ...pose, x: pose.x + by[0] * step, y: pose.y + by[1] * step });
      else if (turn) mapEdits.move(object.number, { ...pose, theta: pose.theta + turn });
      return Boolean(by ?? turn);
    },
    draw(f) {
      const object = picked();
      if (held) drawPreview(f, run.model(held.model), held.pose, handleOf(view, run.model(held.model), held.pose));
      else if (object) drawPreview(f, run.model(object.model), object, handleOf(view, run.model(object.model), object));
    },
  };
}

// "I am here": a drag from the robot's place in the known room, as it is drawn, towards where it looks.
/**
 * @param {Pick<Parts, "run" | "connection" | "notifications" | "redraw"> & { choose: (id: string) => void }} parts
 * @returns {Tool}
 */
export function hereTool({ run, connection, notifications, redraw, choose }) {
  /** @type {(Pose & { dragged: boolean }) | null} */
  let pose = null;

  run.on("session", ({ known_room: room }) => {
    byId("tool-here").hidden = !room;
  });
  const discard = () => {
    pose = null;
    redraw();
  };
  // From odometry's frame, in which the page draws, to the map's.
  /** @param {Pose} pose @returns {Pose} */
  const inMap = (pose) => {
    const frame = run.state.localized?.frame ?? [0, 0, 0];
    const [x, y] = ofPlane(frame, pose.x, pose.y);
    return { x, y, theta: pose.theta - frame[2] };
  };
  return {
    id: "here",
    sends: true,
    name: "Say where the robot is in the known room",
    icon: "i-here",
    down(at) {
      pose = { x: at.x, y: at.y, theta: 0, dragged: false };
      redraw();
    },
    move(at) {
      if (pose === null) return;
      Object.assign(pose, { theta: Math.atan2(at.y - pose.y, at.x - pose.x), dragged: true });
      redraw();
    },
    up() {
      if (pose?.dragged) {
        connection
          .request({ type: "place_robot", ...inMap(pose) })
          .then(() => notifications.toast("The next readings check this place"), notifications.showError);
        choose("pan");
      }
      discard();
    },
    cancel: discard,
    draw(f) {
      if (pose === null) return;
      const radius = run.session?.body?.radius ?? 0.2,
        reach = radius + ARM_PX * f.px;
      const disc = { name: "", vertices: [], closed: true, arc_radius_m: radius };
      drawPreview(f, disc, pose, {
        x: pose.x + reach * Math.cos(pose.theta),
        y: pose.y + reach * Math.sin(pose.theta),
      });
    },
  };
}

/** @param {Pick<Parts, "run" | "view" | "connection" | "notifications" | "redraw">} parts @returns {Tool} */
export function placeTool({ run, view, connection, notifications, redraw }) {
  const chooser = byId("placing-model");
  /** @type {(Pose & { pressed?: boolean }) | null} */
  let pose = null;
  let last = 0; // the previous heading, for placing a row of equal objects

  run.on("session", ({ models }) => {
    const chosen = chooser.value;
    chooser.replaceChildren(...models.map(({ name }) => el("option", { value: name }, name)));
    if (models.some(({ name }) => name === chosen)) chooser.value = chosen;
  });
  /** @param {Pose} pose */
  const put = ({ x, y, theta }) =>
    connection
      .request({ type: "place_model", model: chooser.value, x, y, theta })
      .then(() => notifications.toast(`${chooser.value} placed; it relaxes from there`), notifications.showError);
  const discard = () => {
    pose = null;
    redraw();
  };
  return {
    id: "place",
    sends: true,
    name: "Place a model",
    icon: "i-place",
    begin: () => {
      byId("placing").hidden = false;
    },
    end: () => {
      byId("placing").hidden = true;
      pose = null;
    },
    hover(at) {
      pose = { x: at.x, y: at.y, theta: last };
      redraw();
    },
    leave: discard,
    down(at) {
      pose = { x: at.x, y: at.y, theta: last, pressed: true };
      redraw();
    },
    move(at) {
      if (!pose?.pressed) return;
      if (Math.hypot(at.x - pose.x, at.y - pose.y) * view.scale > 10)
        pose.theta = Math.atan2(at.y - pose.y, at.x - pose.x);
      redraw();
    },
    up() {
      if (pose?.pressed) {
        last = pose.theta;
        put(pose);
      }
      discard();
    },
    key(event) {
      const turn = byKey(event, TURNS);
      if (!turn) return false;
      last += turn;
      if (pose) pose.theta = last;
      return true;
    },
    cancel: discard,
    draw(f) {
      const model = run.model(chooser.value);
      if (pose && model) drawPreview(f, model, pose, pose.pressed ? handleOf(view, model, pose) : null);
    },
  };
}

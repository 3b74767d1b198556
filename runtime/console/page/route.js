// @ts-check
// The route that the operator sets: its waypoints in one frame, a history for undo, and what of it the robot drives.
// While the robot drives the route, each change is sent at once; what lies behind the robot cannot be changed.

import { Emitter } from "./emitter.js";
import { inPlane, ofPlane } from "./map_frame.js";
import { radians } from "./units.js";

const HISTORY = 50;
const WAYPOINTS_MAX = 64; // config.mission_step.STEPS_MAX
/** @param {number} rad */
const degrees = (rad) => Math.round((rad * 180) / Math.PI) % 360;
/** @param {unknown} a @param {unknown} b */
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** @extends {Emitter<{ changed: [] }>} */
export class Route extends Emitter {
  /** @type {Waypoint[]} */
  waypoints = []; // x, y, final heading in degrees or null
  /** @type {Frame} */
  frame = "odom";
  /** @type {number | null} */
  selected = null;
  /** @type {Array<{ waypoints: Waypoint[]; frame: Frame }>} */
  #history = [];
  /** @type {Waypoint[] | null} */
  #sent = null; // waypoints that the robot does not show yet

  /** @param {Pick<Parts, "run" | "connection" | "notifications">} parts */
  constructor({ run, connection, notifications }) {
    super();
    this.run = run;
    this.connection = connection;
    this.notifications = notifications;
    run.on("state", () => this.#follow());
    connection.on("closed", () => {
      this.#sent = null;
    });
  }

  // The robot's mission if that is a route; null otherwise.
  get #shown() {
    const { drive_request: mission } = this.run.state;
    return mission?.kind === "mission" && mission.name === "route" ? mission : null;
  }

  // The same, if it goes on.
  get #driven() {
    const shown = this.#shown;
    return shown?.status === "running" || shown?.status === "held" ? shown : null;
  }

  get isDriven() {
    return this.#sent !== null || this.#driven !== null;
  }

  // How many waypoints lie behind the robot.
  get behind() {
    return this.#driven?.step ?? 0;
  }

  get canUndo() {
    return this.#history.length > 0;
  }

  // A waypoint in the plane: [x, y, heading in radians or null]; null where the map frame is not known.
  /** @param {Waypoint} waypoint */
  inPlane([x, y, turn]) {
    return inPlane(this.run.state.localized, this.frame, x, y, radians(turn));
  }

  // Adds a waypoint of the plane at the end; heading in radians, null for any.
  /** @param {number} x @param {number} y @param {number | null} heading */
  add(x, y, heading) {
    if (this.waypoints.length === 0) this.frame = this.run.state.localized?.status === "tracking" ? "map" : "odom";
    if (this.waypoints.length >= WAYPOINTS_MAX)
      return this.notifications.toast(`A route has at most ${WAYPOINTS_MAX} waypoints`);
    const there = this.#ofPlane(x, y, heading);
    return there && this.#change([...this.waypoints, there], this.waypoints.length);
  }

  /** @param {number} i @param {number} x @param {number} y */
  move(i, x, y, heading = this.inPlane(this.waypoints[i])?.[2] ?? null) {
    const there = this.#ofPlane(x, y, heading);
    return there && this.set(i, heading === null ? there : [there[0], there[1], this.waypoints[i][2] ?? there[2]]);
  }

  // Gives a waypoint its final heading in the plane, radians; null for any.
  /** @param {number} i @param {number | null} heading */
  turn(i, heading) {
    const [x, y] = this.waypoints[i],
      frame = this.frame === "map" ? (this.run.state.localized?.frame[2] ?? 0) : 0;
    return this.set(i, [x, y, heading === null ? null : degrees(heading - frame)]);
  }

  /** @param {number} i @param {Waypoint} waypoint */
  set(i, waypoint) {
    return this.#change(
      this.waypoints.map((one, k) => (k === i ? waypoint : one)),
      i,
    );
  }

  /** @param {number} i */
  remove(i) {
    const rest = this.waypoints.filter((_, k) => k !== i);
    return this.#change(rest, rest.length === 0 ? null : Math.min(i, rest.length - 1));
  }

  // Moves a waypoint earlier (-1) or later (1).
  /** @param {number} i @param {number} by */
  reorder(i, by) {
    const to = i + by;
    if (to < this.behind || to >= this.waypoints.length || i < this.behind) return undefined;
    const order = [...this.waypoints];
    [order[i], order[to]] = [order[to], order[i]];
    return this.#change(order, to);
  }

  clear() {
    return this.#change(this.waypoints.slice(0, this.behind), null);
  }

  /** @param {Waypoint[]} waypoints @param {Frame} frame */
  load(waypoints, frame) {
    return this.#change(waypoints, null, frame);
  }

  undo() {
    const before = this.#history.pop();
    if (before === undefined) return this.notifications.toast("There is no change of the route to undo");
    [this.waypoints, this.frame] = [before.waypoints, before.frame];
    return this.#changed(null);
  }

  /** @param {number | null} i */
  select(i) {
    this.selected = i;
    this.emit("changed");
  }

  // Begins to drive the route, from its first waypoint unless it goes on from one that was done.
  drive() {
    if (this.waypoints.length > 0) return this.#send();
    return this.notifications.toast("There is no waypoint yet: choose the tool and click on the map");
  }

  /** @param {number} x @param {number} y @param {number | null} heading @returns {Waypoint | null} */
  #ofPlane(x, y, heading) {
    const { localized } = this.run.state;
    if (this.frame === "odom") return [x, y, heading === null ? null : degrees(heading)];
    if (!localized) {
      this.notifications.toast(
        "The robot does not know its place in the map, and the route's waypoints are places there",
      );
      return null;
    }
    const turned = heading === null ? null : degrees(heading - localized.frame[2]);
    return [...ofPlane(localized.frame, x, y), turned];
  }

  /** @param {Waypoint[]} waypoints @param {number | null} selected */
  #change(waypoints, selected, frame = this.frame) {
    if (this.isDriven && !same(waypoints.slice(0, this.behind), this.waypoints.slice(0, this.behind))) {
      return this.notifications.toast(
        "The robot is past this waypoint: change the ones ahead of it, or HALT and drive another route",
      );
    }
    this.#history = [...this.#history, { waypoints: this.waypoints, frame: this.frame }].slice(-HISTORY);
    [this.waypoints, this.frame] = [waypoints, frame];
    return this.#changed(selected);
  }

  /** @param {number | null} selected */
  #changed(selected) {
    this.selected = selected;
    this.emit("changed");
    return this.isDriven ? this.#send() : undefined;
  }

  async #send() {
    const { waypoints, frame } = this;
    this.#sent = waypoints;
    try {
      if (waypoints.length === 0) await this.connection.request({ type: "skip_step" });
      else await this.connection.request({ type: "set_route", waypoints, frame });
    } catch (error) {
      if (this.#sent === waypoints) this.#sent = null;
      this.notifications.showError(error);
    }
  }

  // Takes over the route that the robot drives, unless a change of it is on its way.
  #follow() {
    const mission = this.#shown;
    const driven = mission?.steps.map(({ places }) => places[0]) ?? [];
    if (this.#sent !== null) {
      if (this.#sent.length > 0 && !same(driven, this.#sent)) return;
      this.#sent = null;
      this.emit("changed");
    }
    if (mission === null || this.#driven === null || same(driven, this.waypoints)) return;
    if (this.waypoints.length > 0) this.#history.push({ waypoints: this.waypoints, frame: this.frame });
    [this.waypoints, this.frame, this.selected] = [driven, mission.steps[0].frame, null];
    this.emit("changed");
  }
}

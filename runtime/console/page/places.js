// @ts-check
// Named places, no-go lines and areas, and speed areas: what the run has of them, and how the operator changes it.
// The process holds them and their undo, so that they outlive a reload of the page.

import { Emitter } from "./emitter.js";
import { messageOf } from "./connection.js";
import { inPlane, ofPlane } from "./map_frame.js";

/** @type {Record<PlaceKind, string>} */
export const KINDS = { place: "place", no_go_line: "no-go line", no_go_area: "no-go area", speed_area: "speed area" };
/** @type {Record<PlaceKind, number>} */
export const CORNERS_MIN = { place: 1, no_go_line: 2, no_go_area: 3, speed_area: 3 };
const SPEED_M_S = 0.15; // of a new speed area
/** @type {Omit<PlacesMessage, "type">} */
const NONE = { frame: "odom", place: [], no_go_line: [], no_go_area: [], speed_area: [] };
/** @param {number} rad */
const degrees = (rad) => Math.round((rad * 180) / Math.PI) % 360;
/** @param {number} value */
const millimetres = (value) => Math.round(value * 1000) / 1000;

export const KIND_NAMES = /** @type {PlaceKind[]} */ (Object.keys(KINDS));

/** @param {PlaceRow} row @returns {Pair[]} */
export const cornersOf = (row) =>
  "x_m" in row ? [[row.x_m, row.y_m]] : "points_m" in row ? row.points_m : row.vertices_m;
/** @param {PlaceRow} row @param {Pair[]} corners @returns {PlaceRow} */
const withCorners = (row, corners) =>
  "x_m" in row
    ? { ...row, x_m: corners[0][0], y_m: corners[0][1] }
    : "points_m" in row
      ? { ...row, points_m: corners }
      : { ...row, vertices_m: corners };

// Rows and those read that are none of them, whatever the order of their keys.
/** @template {PlaceRow} Row @param {Row[]} rows @param {Row[]} read @returns {Row[]} */
function withNew(rows, read) {
  /** @param {Row} row */
  const text = (row) => JSON.stringify(Object.entries(row).sort());
  const known = new Set(rows.map(text));
  return [...rows, ...read.filter((row) => !known.has(text(row)))];
}

/** @extends {Emitter<{ changed: [] }>} */
export class Places extends Emitter {
  all = NONE;
  /** @type {[PlaceKind, number] | null} */
  selected = null;

  /** @param {Pick<Parts, "run" | "connection" | "notifications">} parts */
  constructor({ run, connection, notifications }) {
    super();
    this.run = run;
    this.connection = connection;
    this.notifications = notifications;
    run.places = this;
    run.on("session", ({ places }) => this.#show(places ?? NONE));
    connection.on("places", (message) => this.#show(message));
  }

  get frameIsKnown() {
    return this.all.frame === "odom" || this.run.state.localized?.status === "tracking";
  }

  // A corner in the plane, [x, y, heading]; null while the map frame is not known.
  /** @param {Pair} corner @param {number | null} heading */
  inPlane([x, y], heading = null) {
    return inPlane(this.run.state.localized, this.all.frame, x, y, heading);
  }

  // A place of the plane in the frame of the places; null where that is not known, which is said.
  /**
   * @param {number} x @param {number} y @param {number | null} heading
   * @returns {[number, number, number | null] | null}
   */
  ofPlane(x, y, heading = null) {
    const { localized } = this.run.state;
    if (this.all.frame === "odom") return [millimetres(x), millimetres(y), heading];
    if (localized?.status !== "tracking") {
      this.notifications.toast(
        "The robot does not know its place in the map, in which places lie: say where it is, or drive on",
      );
      return null;
    }
    const [mapX, mapY] = ofPlane(localized.frame, x, y);
    return [millimetres(mapX), millimetres(mapY), heading === null ? null : heading - localized.frame[2]];
  }

  // Adds what was drawn: corners in the frame of the places; a heading in radians for a place.
  /** @param {PlaceKind} kind @param {Pair[]} corners @param {number | null} heading */
  add(kind, corners, heading = null) {
    const [[x_m, y_m]] = corners;
    /** @type {Record<PlaceKind, PlaceRow>} */
    const rows = {
      place: { name: this.#freeName(), x_m, y_m, heading_deg: heading === null ? null : degrees(heading) },
      no_go_line: { name: "", points_m: corners },
      no_go_area: { name: "", vertices_m: corners },
      speed_area: { name: "", vertices_m: corners, speed_max_m_s: SPEED_M_S },
    };
    return this.#change(kind, [...this.all[kind], rows[kind]], this.all[kind].length);
  }

  /** @param {PlaceKind} kind @param {number} i @param {number} corner @param {Pair} to */
  moveCorner(kind, i, corner, to) {
    const row = this.all[kind][i];
    const corners = cornersOf(row).map((one, k) => (k === corner ? to : one));
    return this.set(kind, i, withCorners(row, corners));
  }

  /** @param {PlaceKind} kind @param {number} i @param {PlaceRow} row */
  set(kind, i, row) {
    return this.#change(
      kind,
      this.all[kind].map((one, k) => (k === i ? row : one)),
      i,
    );
  }

  /** @param {PlaceKind} kind @param {number} i */
  remove(kind, i) {
    return this.#change(
      kind,
      this.all[kind].filter((_, k) => k !== i),
      null,
    );
  }

  /** @param {[PlaceKind, number] | null} selected */
  select(selected) {
    this.selected = selected;
    this.emit("changed");
  }

  async undo() {
    this.selected = null;
    await this.connection.request({ type: "undo_places" }).catch(this.notifications.showError);
  }

  // Adds all places of a map file to those that there are; one of the same name is replaced, an equal line or area is
  // not added again.
  /** @param {string} text */
  async load(text) {
    const read = await this.connection.request({ type: "read_places", text });
    const names = new Set(read.place.map(({ name }) => name));
    const kept = { ...this.all, place: this.all.place.filter(({ name }) => !names.has(name)) };
    await this.#send({
      place: [...kept.place, ...read.place],
      no_go_line: withNew(kept.no_go_line, read.no_go_line),
      no_go_area: withNew(kept.no_go_area, read.no_go_area),
      speed_area: withNew(kept.speed_area, read.speed_area),
    });
  }

  #freeName() {
    const names = new Set(this.all.place.map(({ name }) => name));
    let n = 1;
    while (names.has(`place-${n}`)) n += 1;
    return `place-${n}`;
  }

  /** @param {PlaceKind} kind @param {PlaceRow[]} rows @param {number | null} selected */
  async #change(kind, rows, selected) {
    try {
      await this.#send({ ...this.all, [kind]: rows });
      this.selected = selected === null ? null : [kind, selected];
      this.emit("changed");
      return null;
    } catch (error) {
      this.notifications.showError(error);
      return messageOf(error);
    }
  }

  /** @param {PlacesConfig} all */
  #send({ place, no_go_line, no_go_area, speed_area }) {
    const places = { place, no_go_line, no_go_area, speed_area };
    return this.connection.request({ type: "set_places", places });
  }

  /** @param {Omit<PlacesMessage, "type">} message */
  #show(message) {
    this.all = { ...NONE, ...message };
    if (this.selected && this.selected[1] >= this.all[this.selected[0]].length) this.selected = null;
    this.emit("changed");
  }
}

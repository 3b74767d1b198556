// @ts-check
// Undo of map edits, and the list of vacant areas: places of which the operator said that nothing stands there.

import { button, byId, el, setText } from "./dom.js";
import { Panel } from "./panel.js";

/** @type {Record<string, string>} */
const DONE = {
  delete_segments: "The deleted segments are back",
  pin_segments: "The pins are as before",
  place_model: "The placed object is gone",
  move_object: "The object is back where it was",
  confirm_object: "The object is not confirmed any more",
  reject_object: "The object is reported again",
  lift_area: "The area is vacant again",
  clear_map: "Segments, objects and walls are back",
};
const SETTLED_MS = 1500; // by then the readings have moved an object that was placed badly
const STRAYED_M = 0.03;

export class MapEdits extends Panel {
  /** @type {number | undefined} */
  #timer = undefined;
  #list = byId("areas");
  #shown = "";

  /** @param {Panels} parts */
  constructor(parts) {
    super(parts);
    const { run, units, connection, notifications } = parts;
    byId("undo-edit").addEventListener("click", () => this.undo());
    connection.on("waiting", (count) =>
      notifications.banner(
        "waiting",
        count === 0
          ? null
          : `Paused: ${count} edit${count === 1 ? " of the map waits" : "s of the map wait"} for the next cycle.`,
        {
          buttons: [
            ["One cycle", () => this.ask({ type: "single_step" })],
            ["Resume", () => this.ask({ type: "resume" })],
          ],
        },
      ),
    );
    run.on("state", () => this.#refresh());
    units.on("changed", () => this.#refresh());
  }

  async undo() {
    const kind = await this.ask({ type: "undo_edit" });
    if (kind !== undefined) this.notifications.toast(DONE[kind] ?? "The last edit is undone");
  }

  // Moves an object, and says so if the readings have moved it away again.
  /** @param {number} number @param {Pose} pose */
  async move(number, { x, y, theta }) {
    if ((await this.ask({ type: "move_object", object: number, x, y, theta })) === undefined) return;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      const object = this.run.object(number);
      const off = object === null ? 0 : Math.hypot(object.x - x, object.y - y);
      if (off > STRAYED_M)
        this.notifications.toast(`The readings put object ${number} ${this.units.length(off)} from where you moved it`);
    }, SETTLED_MS);
  }

  #refresh() {
    const { areas } = this.run.state;
    const { enabled } = this;
    const shown = JSON.stringify([areas, this.units.name, enabled]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    byId("areas-part").hidden = areas.length === 0;
    setText(byId("areas-count"), `${areas.length}`);
    this.#list.replaceChildren(
      ...areas.map(([number, x, y, radius]) => {
        const more = { class: "control", "aria-label": `Lift area ${number}`, disabled: !enabled };
        const lift = button("Lift", () => this.ask({ type: "lift_area", area: number }), more);
        const text = `${number}  ${this.units.place(x, y)}, radius ${this.units.length(radius)}`;
        return el("li", { class: "line" }, el("span", {}, text), lift);
      }),
    );
  }
}

// @ts-check
// The route in the panel: every waypoint as a row, with what a pointer can do on the map done by buttons and numbers.

import { messageOf } from "./connection.js";
import { button, byId, download, el, setText } from "./dom.js";
import { Panel } from "./panel.js";
import { counted, numberIn } from "./units.js";

export class RoutePanel extends Panel {
  #shown = "";

  /** @param {Panels & Pick<Parts, "route" | "tools">} parts */
  constructor(parts) {
    super(parts);
    const { route, run, units, tools } = parts;
    this.route = route;
    byId("route-add").addEventListener("click", () => tools.choose("route", { focus: true }));
    byId("route-drive").addEventListener("click", () => route.drive());
    byId("route-undo").addEventListener("click", () => route.undo());
    byId("route-clear").addEventListener("click", () => route.clear());
    byId("route-form").addEventListener("submit", (event) => this.#set(event));
    byId("route-save").addEventListener("submit", (event) => this.#save(event));
    byId("route-file").addEventListener("change", () => this.#load(byId("route-file")));
    route.on("changed", () => this.#refresh());
    run.on("state", () => this.#refresh());
    units.on("changed", () => this.#refresh());
  }

  #refresh() {
    const { route, units, enabled } = this,
      { behind, isDriven, waypoints, selected } = route;
    const shown = JSON.stringify([
      waypoints,
      route.frame,
      selected,
      behind,
      isDriven,
      units.name,
      enabled,
      route.canUndo,
    ]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const focused = document.activeElement?.id;
    setText(byId("route-text"), text(route));
    byId("route-list").replaceChildren(...waypoints.map((waypoint, i) => this.#row(waypoint, i, enabled)));
    byId("route-drive").disabled = !enabled || waypoints.length === 0 || isDriven;
    byId("route-undo").disabled = !enabled || !route.canUndo;
    byId("route-clear").disabled = !enabled || waypoints.length === behind;
    byId("route-keep").disabled = waypoints.length === 0;
    byId("route-form").hidden = selected === null || selected < behind;
    if (selected !== null && selected >= behind) {
      const [x, y, heading] = waypoints[selected];
      setText(byId("route-form-number"), `Waypoint ${selected + 1}`);
      byId("route-x").value = units.number(x);
      byId("route-y").value = units.number(y);
      byId("route-heading").value = heading === null ? "" : String(heading);
      setText(byId("route-unit"), units.name);
    }
    if (focused && document.activeElement?.id !== focused) document.getElementById(focused)?.focus();
  }

  /** @param {Waypoint} waypoint @param {number} i @param {boolean} enabled */
  #row([x, y, heading], i, enabled) {
    const { route, units } = this,
      number = i + 1,
      isBehind = i < route.behind;
    /** @param {string} name @param {string} sign @param {() => void} act @param {boolean} off */
    const small = (name, sign, act, off) =>
      button(sign, act, {
        class: "small",
        id: `route-${name.toLowerCase()}-${i}`,
        "aria-label": `${name} waypoint ${number}`,
        title: name,
        disabled: !enabled || isBehind || off,
      });
    const isSelected = route.selected === i;
    const name = button(
      [el("strong", {}, String(number)), ` ${units.place(x, y)}${heading === null ? "" : `, ${heading}°`}`],
      () => route.select(isSelected ? null : i),
      { class: "place", id: `route-row-${i}`, "aria-pressed": String(isSelected), disabled: isBehind },
    );
    return el(
      "li",
      {},
      name,
      small("Earlier", "↑", () => route.reorder(i, -1), i <= route.behind),
      small("Later", "↓", () => route.reorder(i, 1), i === route.waypoints.length - 1),
      small("Remove", "✕", () => route.remove(i), false),
    );
  }

  /** @param {SubmitEvent} event */
  #set(event) {
    event.preventDefault();
    const { selected, waypoints } = this.route,
      was = selected === null ? null : waypoints[selected];
    const x = this.units.parse(byId("route-x").value, was?.[0]),
      y = this.units.parse(byId("route-y").value, was?.[1]);
    const heading = numberIn(byId("route-heading").value);
    const isWrong = x === null || y === null || (heading !== null && !(Math.abs(heading) <= 360));
    setText(
      byId("route-error"),
      isWrong ? "two numbers are wanted, and a heading from -360 to 360 degrees or none" : "",
    );
    if (x !== null && y !== null && !isWrong && selected !== null) void this.route.set(selected, [x, y, heading]);
  }

  /** @param {SubmitEvent} event */
  async #save(event) {
    event.preventDefault();
    const { waypoints, frame } = this.route,
      name = byId("route-name").value.trim() || "my-route";
    try {
      const toml = await this.connection.request({ type: "save_route", name, waypoints, frame });
      download(`${name}.toml`, new Blob([toml], { type: "application/toml" }));
      setText(byId("route-error"), "");
    } catch (error) {
      setText(byId("route-error"), messageOf(error));
    }
  }

  // A route goes into the editor; a mission that does more is started as it is, if the operator confirms.
  /** @param {HTMLInputElement} input */
  async #load(input) {
    const file = input.files?.[0];
    if (!file) return;
    try {
      const toml = await file.text();
      const { name, about, waypoints, frame } = await this.connection.request({ type: "read_mission", toml });
      setText(byId("route-error"), "");
      if (waypoints !== null && frame !== null) {
        this.route.load(waypoints, frame);
        if (!this.route.isDriven) byId("route-name").value = name;
      } else {
        this.notifications.confirm(
          `Start the mission ${name}?`,
          el("p", {}, about || "It does more than follow a route."),
          [
            ["Leave it", null],
            ["Start it", () => void this.ask({ type: "run_mission", toml })],
          ],
        );
      }
    } catch (error) {
      setText(byId("route-error"), messageOf(error));
    }
    input.value = "";
  }
}

/** @param {Route} route */
function text({ waypoints, behind, isDriven, frame }) {
  const where = frame === "map" && waypoints.length > 0 ? ", in the map" : "";
  const count = `${counted(waypoints.length, "waypoint")}${where}`;
  if (isDriven) return `Under way: ${count}, ${behind} behind the robot. Changes ahead of it count at once.`;
  if (waypoints.length === 0) return "No waypoint yet: click on the map, or load a file.";
  return `${count}. Press Drive the route to start.`;
}

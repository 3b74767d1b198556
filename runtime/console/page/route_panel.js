// The route in the panel: every waypoint as a row, with what a pointer can do on the map done by buttons and numbers.

import { byId, download, el, setText } from "./dom.js";

export class RoutePanel {
  #shown = "";

  constructor({ route, run, units, connection, notifications, tools }) {
    Object.assign(this, { route, run, units, connection, notifications });
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("route-add", () => tools.choose("route", { focus: true }));
    on("route-drive", () => route.drive());
    on("route-undo", () => route.undo());
    on("route-clear", () => route.clear());
    byId("route-form").addEventListener("submit", (event) => this.#set(event));
    byId("route-save").addEventListener("submit", (event) => this.#save(event));
    byId("route-file").addEventListener("change", (event) => this.#load(event.target));
    route.on("changed", () => this.#refresh());
    run.on("state", () => this.#refresh());
    units.on("changed", () => this.#refresh());
  }

  #refresh() {
    const { route, units } = this,
      { behind, isDriven, waypoints, selected } = route;
    const enabled = this.run.state.controller && !this.run.watchesRecording;
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
      for (const [id, value] of [
        ["x", units.number(x)],
        ["y", units.number(y)],
        ["heading", heading === null ? "" : String(heading)],
      ])
        byId(`route-${id}`).value = value;
      setText(byId("route-unit"), units.name);
    }
    if (focused && document.activeElement?.id !== focused) byId(focused)?.focus();
  }

  #row([x, y, heading], i, enabled) {
    const { route, units } = this,
      number = i + 1,
      isBehind = i < route.behind;
    const button = (name, sign, act, off) => {
      const made = el(
        "button",
        {
          type: "button",
          class: "small",
          id: `route-${name.replace(" ", "-").toLowerCase()}-${i}`,
          "aria-label": `${name} waypoint ${number}`,
          title: name,
          onclick: act,
        },
        sign,
      );
      made.disabled = !enabled || isBehind || off;
      return made;
    };
    const name = el(
      "button",
      {
        type: "button",
        class: "place",
        id: `route-row-${i}`,
        "aria-pressed": String(route.selected === i),
        onclick: () => route.select(route.selected === i ? null : i),
      },
      el("strong", {}, String(number)),
      ` ${units.place(x, y)}${heading === null ? "" : `, ${heading}°`}`,
    );
    name.disabled = isBehind;
    return el(
      "li",
      {},
      name,
      button("Earlier", "↑", () => route.reorder(i, -1), i <= route.behind),
      button("Later", "↓", () => route.reorder(i, 1), i === route.waypoints.length - 1),
      button("Remove", "✕", () => route.remove(i), false),
    );
  }

  #set(event) {
    event.preventDefault();
    const [x, y] = ["route-x", "route-y"].map((id) => this.units.parse(byId(id).value));
    const given = byId("route-heading").value.trim(),
      heading = given === "" ? null : Number(given.replace("−", "-"));
    const isWrong = x === null || y === null || (heading !== null && !(Math.abs(heading) <= 360));
    setText(
      byId("route-error"),
      isWrong ? "two numbers are wanted, and a heading from -360 to 360 degrees or none" : "",
    );
    if (!isWrong) this.route.set(this.route.selected, [x, y, heading]);
  }

  async #save(event) {
    event.preventDefault();
    const { waypoints, frame } = this.route,
      name = byId("route-name").value.trim() || "my-route";
    try {
      const toml = await this.connection.request({ type: "save_route", name, waypoints, frame });
      download(`${name}.toml`, new Blob([toml], { type: "application/toml" }));
      setText(byId("route-error"), "");
    } catch (error) {
      setText(byId("route-error"), error.message);
    }
  }

  // A route goes into the editor; a mission that does more is started as it is, if the operator confirms.
  async #load(input) {
    const [file] = input.files;
    if (!file) return;
    try {
      const toml = await file.text();
      const { name, about, waypoints, frame } = await this.connection.request({ type: "read_mission", toml });
      setText(byId("route-error"), "");
      if (waypoints !== null) {
        this.route.load(waypoints, frame);
        if (!this.route.isDriven) byId("route-name").value = name;
      } else {
        this.notifications.confirm(`Start the mission ${name}?`, el("p", {}, about || "It is more than a route."), [
          ["Leave it", null],
          [
            "Start it",
            () => void this.connection.request({ type: "run_mission", toml }).catch(this.notifications.showError),
          ],
        ]);
      }
    } catch (error) {
      setText(byId("route-error"), error.message);
    }
    input.value = "";
  }
}

function text({ waypoints, behind, isDriven, frame }) {
  const count = `${waypoints.length} waypoint${waypoints.length === 1 ? "" : "s"}${frame === "map" && waypoints.length > 0 ? ", in the map" : ""}`;
  if (isDriven) return `Under way: ${count}, ${behind} behind the robot. Changes ahead of it count at once.`;
  if (waypoints.length === 0) return "No waypoint yet: click on the map, or load a file.";
  return `${count}; nothing is driven before you say so.`;
}

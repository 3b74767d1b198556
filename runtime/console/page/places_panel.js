// Places in the panel: what to draw, a row for each, the numbers of the selected one, and files.

import { byId, download, el, setText } from "./dom.js";
import { cornersOf, KINDS } from "./places.js";

const HINTS = {
  place: "Click on the map; drag from there for the heading.",
  no_go_line: "Click the corners; click the last one again to end. The robot does not cross the line.",
  no_go_area: "Click the corners; click the first one again to end. The robot does not enter the area.",
  speed_area: "Click the corners; click the first one again to end. The robot drives no faster in the area.",
};

export class PlacesPanel {
  #shown = "";

  constructor({ places, tool, run, units, connection, notifications, tools }) {
    Object.assign(this, { places, tool, run, units, connection, notifications });
    const kind = el(
      "select",
      {
        id: "places-kind",
        "aria-label": "What to draw",
        onchange: () => {
          tool.kind = kind.value;
          tools.choose("places");
        },
      },
      ...Object.entries(KINDS).map(([value, name]) => el("option", { value }, name)),
    );
    const button = (id, text, act, how = {}) =>
      el("button", { type: "button", id: `places-${id}`, onclick: act, ...how }, text);
    const field = (id, name, unit = "", how = {}) =>
      el(
        "label",
        { id: `places-${id}-field` },
        `${name} `,
        el("input", { id: `places-${id}`, class: "number", inputmode: "decimal", autocomplete: "off", ...how }),
        unit,
      );
    byId("places").append(
      el("h3", {}, "Places and no-go areas"),
      el(
        "div",
        { class: "row" },
        kind,
        button("draw", "Draw on the map", () => tools.choose("places", { focus: true }), { class: "control" }),
        button("finish", "Finish", () => tool.finish()),
      ),
      el("p", { class: "hint", id: "places-text" }),
      el("ol", { class: "route", id: "places-list", "aria-label": "Places and no-go areas" }),
      el(
        "form",
        { class: "row", id: "places-form", hidden: true, onsubmit: (event) => this.#set(event) },
        field("name", "Name", "", { class: "", inputmode: "text", maxlength: "40", size: "14" }),
        field("x", "x"),
        field("y", "y"),
        field("heading", "heading", "°", { placeholder: "any" }),
        field("speed", "at most", "m/s"),
        el("button", { type: "submit", class: "control" }, "Set"),
      ),
      el(
        "div",
        { class: "row" },
        button("undo", "Undo", () => places.undo(), { class: "control" }),
        button("save", "Save the map", () => this.#save("toml")),
        button("geojson", "Save as GeoJSON", () => this.#save("geojson")),
      ),
      el(
        "label",
        { class: "line", for: "places-file" },
        el("span", {}, "Add the places of a map file"),
        " ",
        el("input", {
          type: "file",
          id: "places-file",
          accept: ".toml,.geojson,.json",
          class: "control",
          onchange: (event) => this.#load(event.target),
        }),
      ),
      el("output", { class: "error", id: "places-error" }),
    );
    for (const part of [places, run, units]) part.on(part === run ? "state" : "changed", () => this.#refresh());
    this.#refresh();
  }

  #refresh() {
    const { places, tool, units } = this,
      { all, selected } = places;
    const enabled = this.run.state.controller && !this.run.watchesRecording;
    const shown = JSON.stringify([
      all,
      selected,
      tool.kind,
      tool.isDrawing,
      tool.canFinish,
      units.name,
      enabled,
      places.frameIsKnown,
    ]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const focused = document.activeElement?.id;
    setText(byId("places-text"), this.#text());
    byId("places-finish").disabled = !tool.canFinish;
    byId("places-kind").value = tool.kind;
    byId("places-list").replaceChildren(
      ...Object.keys(KINDS).flatMap((kind) => all[kind].map((row, i) => this.#row(kind, row, i, enabled))),
    );
    for (const id of ["draw", "undo", "file"]) byId(`places-${id}`).disabled = !enabled;
    const row = selected === null ? null : all[selected[0]][selected[1]];
    byId("places-form").hidden = !row;
    if (row) this.#fill(selected[0], row);
    if (focused && document.activeElement?.id !== focused) byId(focused)?.focus();
  }

  #text() {
    const { places, tool, run } = this;
    const where =
      places.all.frame === "map"
        ? "They lie in the map."
        : "There is no map: they lie in the odometry of this run, and the next run does not know them.";
    const limits = ["no_go_line", "no_go_area", "speed_area"].some((kind) => places.all[kind].length > 0);
    if (limits && !places.frameIsKnown && run.session)
      return "The robot does not know its place in the map, so no-go areas and speed limits are not kept: it stands, and teleoperation is slow.";
    return `${HINTS[tool.kind]} ${where}`;
  }

  #row(kind, row, i, enabled) {
    const { places } = this,
      isSelected = places.selected?.[0] === kind && places.selected[1] === i;
    const name = row.name || `${KINDS[kind]} ${i + 1}`;
    const what =
      kind === "place"
        ? this.units.place(row.x_m, row.y_m)
        : kind === "speed_area"
          ? `at most ${row.speed_max_m_s} m/s`
          : `${KINDS[kind]}, ${cornersOf(kind, row).length} corners`;
    const choose = el(
      "button",
      {
        type: "button",
        class: "place",
        id: `places-row-${kind}-${i}`,
        "aria-pressed": String(isSelected),
        onclick: () => places.select(isSelected ? null : [kind, i]),
      },
      el("strong", {}, name),
      ` ${what}`,
    );
    const go =
      kind !== "place"
        ? null
        : el(
            "button",
            {
              type: "button",
              class: "small",
              id: `places-go-${i}`,
              "aria-label": `Go to ${name}`,
              onclick: () => this.#go(row.name),
            },
            "Go",
          );
    const remove = el(
      "button",
      {
        type: "button",
        class: "small",
        id: `places-remove-${kind}-${i}`,
        "aria-label": `Remove ${name}`,
        title: "Remove",
        onclick: () => places.remove(kind, i),
      },
      "✕",
    );
    for (const one of [go, remove]) if (one) one.disabled = !enabled;
    return el("li", {}, choose, go, remove);
  }

  #fill(kind, row) {
    const { units } = this,
      given = { name: row.name };
    if (kind === "place")
      Object.assign(given, {
        x: units.number(row.x_m),
        y: units.number(row.y_m),
        heading: row.heading_deg === null ? "" : String(row.heading_deg),
      });
    if (kind === "speed_area") given.speed = String(row.speed_max_m_s);
    for (const id of ["name", "x", "y", "heading", "speed"]) {
      byId(`places-${id}-field`).hidden = !(id in given);
      byId(`places-${id}`).value = given[id] ?? "";
    }
  }

  async #set(event) {
    event.preventDefault();
    const [kind, i] = this.places.selected,
      value = (id) => byId(`places-${id}`).value.trim().replace("−", "-");
    const row = { ...this.places.all[kind][i], name: value("name") };
    if (kind === "place") {
      [row.x_m, row.y_m] = ["x", "y"].map((id) => this.units.parse(byId(`places-${id}`).value));
      row.heading_deg = value("heading") === "" ? null : Number(value("heading"));
    }
    if (kind === "speed_area") row.speed_max_m_s = Number(value("speed"));
    const isWrong =
      Object.values(row).some((one) => one !== null && typeof one === "number" && !Number.isFinite(one)) ||
      (kind === "place" && (row.x_m === null || row.y_m === null));
    if (isWrong) return setText(byId("places-error"), "numbers are wanted here");
    if (kind === "place" && !/^[a-z0-9][a-z0-9_-]{0,39}$/.test(row.name))
      return setText(byId("places-error"), "the name of a place has small letters, digits, - and _, 40 at most");
    return setText(byId("places-error"), (await this.places.set(kind, i, row)) ?? "");
  }

  #go(name) {
    this.connection
      .request({ type: "go_to_place", name })
      .then(() => this.notifications.toast(`Goal: ${name}`), this.notifications.showError);
  }

  async #save(format) {
    try {
      const text = await this.connection.request({ type: "save_map", format });
      download(
        `map.${format}`,
        new Blob([text], { type: format === "toml" ? "application/toml" : "application/geo+json" }),
      );
    } catch (error) {
      setText(byId("places-error"), error.message);
    }
  }

  async #load(input) {
    const [file] = input.files;
    if (!file) return;
    try {
      await this.places.load(await file.text());
      setText(byId("places-error"), "");
    } catch (error) {
      setText(byId("places-error"), error.message);
    }
    input.value = "";
  }
}

// @ts-check
// Places in the panel: what to draw, a row for each, the numbers of the selected one, and files.

import { messageOf } from "./connection.js";
import { button, byId, disable, download, el, setText } from "./dom.js";
import { Panel } from "./panel.js";
import { cornersOf, KINDS, KIND_NAMES } from "./places.js";
import { numberIn } from "./units.js";

const FIELDS = /** @type {const} */ (["name", "x", "y", "heading", "speed"]);

/** @type {Record<PlaceKind, string>} */
const HINTS = {
  place: "Click on the map; drag from there for the heading.",
  no_go_line: "Click the corners; click the last one again to end. The robot does not cross the line.",
  no_go_area: "Click the corners; click the first one again to end. The robot does not enter the area.",
  speed_area: "Click the corners; click the first one again to end. The robot drives no faster in the area.",
};

export class PlacesPanel extends Panel {
  #shown = "";
  #filled = "";

  /** @param {Panels & Pick<Parts, "places" | "tools"> & { tool: PlacesTool }} parts */
  constructor(parts) {
    super(parts);
    const { places, tool, run, units, tools } = parts;
    this.places = places;
    this.tool = tool;
    const kind = el(
      "select",
      {
        id: "places-kind",
        "aria-label": "What to draw",
        onchange: () => {
          tool.kind = /** @type {PlaceKind} */ (kind.value);
          tools.choose("places");
        },
      },
      ...Object.entries(KINDS).map(([value, name]) => el("option", { value }, name)),
    );
    /** @param {string} id @param {string} text @param {() => unknown} act @param {Properties} how */
    const named = (id, text, act, how = {}) => button(text, act, { id: `places-${id}`, ...how });
    /** @param {string} id @param {string} name @param {string} unit @param {Properties} how */
    const field = (id, name, unit = "", how = {}) =>
      el(
        "label",
        { id: `places-${id}-field` },
        `${name} `,
        el("input", { id: `places-${id}`, class: "number", inputmode: "decimal", autocomplete: "off", ...how }),
        el("span", { id: `places-${id}-unit` }, unit),
      );
    byId("places").append(
      el("h3", {}, "Places and no-go areas"),
      el(
        "div",
        { class: "row" },
        kind,
        named("draw", "Draw on the map", () => tools.choose("places", { focus: true }), { class: "control" }),
        named("finish", "Finish", () => tool.finish()),
      ),
      el("p", { class: "hint", id: "places-text" }),
      el("ol", { class: "route", id: "places-list", "aria-label": "Places and no-go areas" }),
      el(
        "form",
        {
          class: "row",
          id: "places-form",
          hidden: true,
          onsubmit: (/** @type {SubmitEvent} */ event) => this.#set(event),
        },
        field("name", "Name", "", { class: "", inputmode: "text", maxlength: "40", size: "14" }),
        field("x", "x"),
        field("y", "y"),
        field("heading", "heading", "°", { placeholder: "any" }),
        field("speed", "at most"),
        el("button", { type: "submit", class: "control" }, "Set"),
      ),
      el(
        "div",
        { class: "row" },
        named("undo", "Undo", () => places.undo(), { class: "control" }),
        named("save", "Save the map", () => this.#save("toml")),
        named("geojson", "Save as GeoJSON", () => this.#save("geojson")),
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
          onchange: () => this.#load(byId("places-file")),
        }),
      ),
      el("output", { class: "error", id: "places-error" }),
    );
    places.on("changed", () => {
      setText(byId("places-error"), ""); // it was about what has changed since
      this.#refresh();
    });
    run.on("state", () => this.#refresh());
    units.on("changed", () => this.#refresh());
    this.#refresh();
  }

  #refresh() {
    const { places, tool, units, enabled } = this,
      { all, selected } = places;
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
      ...KIND_NAMES.flatMap((kind) => [...all[kind].entries()].map(([i, row]) => this.#row(kind, row, i, enabled))),
    );
    disable([byId("places-draw"), byId("places-undo"), byId("places-file")], !enabled);
    const row = selected === null ? null : all[selected[0]][selected[1]];
    byId("places-form").hidden = !row;
    // What is being typed stays while only something else has changed.
    const filled = row ? JSON.stringify([selected, row, units.name]) : "";
    if (row && filled !== this.#filled) this.#fill(row);
    this.#filled = filled;
    if (focused && document.activeElement?.id !== focused) document.getElementById(focused)?.focus();
  }

  #text() {
    const { places, tool, run } = this;
    const where =
      places.all.frame === "map"
        ? `They lie in the map${places.frameIsKnown ? "" : ", where the robot does not know its place: say where it is first"}.`
        : "There is no map: they lie in the odometry of this run, and the next run does not know them.";
    const limits = KIND_NAMES.some((kind) => kind !== "place" && places.all[kind].length > 0);
    if (limits && !places.frameIsKnown && run.session)
      return (
        "The robot does not know its place in the map, so no-go areas and speed limits are not kept: " +
        "it stands, and teleoperation is slow."
      );
    return `${HINTS[tool.kind]} ${where}`;
  }

  /** @param {PlaceKind} kind @param {PlaceRow} row @param {number} i @param {boolean} enabled */
  #row(kind, row, i, enabled) {
    const { places } = this,
      isSelected = places.selected?.[0] === kind && places.selected[1] === i;
    const name = row.name || `${KINDS[kind]} ${i + 1}`;
    const what =
      "x_m" in row
        ? `${this.units.place(row.x_m, row.y_m)}${row.heading_deg === null ? "" : `, ${row.heading_deg}°`}`
        : "speed_max_m_s" in row
          ? `at most ${this.units.number(row.speed_max_m_s)} ${this.units.name}/s`
          : `${row.name ? `${KINDS[kind]}, ` : ""}${cornersOf(row).length} corners`;
    const choose = button([el("strong", {}, name), ` ${what}`], () => places.select(isSelected ? null : [kind, i]), {
      class: "place",
      id: `places-row-${kind}-${i}`,
      "aria-pressed": String(isSelected),
    });
    const small = { class: "small", disabled: !enabled };
    const goes = { ...small, id: `places-go-${i}`, "aria-label": `Go to ${name}` };
    const go = kind === "place" ? button("Go", () => this.#go(row.name), goes) : null;
    const removes = { ...small, id: `places-remove-${kind}-${i}`, "aria-label": `Remove ${name}`, title: "Remove" };
    return el(
      "li",
      {},
      choose,
      go,
      button("✕", () => places.remove(kind, i), removes),
    );
  }

  /** @param {PlaceRow} row */
  #fill(row) {
    const { units } = this;
    /** @type {Record<string, string>} */
    const given = { name: row.name };
    if ("x_m" in row)
      Object.assign(given, {
        x: units.number(row.x_m),
        y: units.number(row.y_m),
        heading: row.heading_deg === null ? "" : String(row.heading_deg),
      });
    if ("speed_max_m_s" in row) given.speed = units.number(row.speed_max_m_s);
    setText(byId("places-speed-unit"), `${units.name}/s`);
    for (const id of FIELDS) {
      byId(`places-${id}-field`).hidden = !(id in given);
      byId(`places-${id}`).value = given[id] ?? "";
    }
  }

  /** @param {SubmitEvent} event */
  async #set(event) {
    event.preventDefault();
    if (this.places.selected === null) return undefined;
    const [kind, i] = this.places.selected;
    const row = { ...this.places.all[kind][i], name: byId("places-name").value.trim() };
    if ("x_m" in row) {
      row.x_m = this.units.parse(byId("places-x").value, row.x_m) ?? Number.NaN;
      row.y_m = this.units.parse(byId("places-y").value, row.y_m) ?? Number.NaN;
      row.heading_deg = numberIn(byId("places-heading").value);
    }
    if ("speed_max_m_s" in row)
      row.speed_max_m_s = this.units.parse(byId("places-speed").value, row.speed_max_m_s) ?? Number.NaN;
    if (Object.values(row).some((one) => typeof one === "number" && !Number.isFinite(one)))
      return setText(byId("places-error"), "numbers are wanted here");
    if (kind === "place" && !/^[a-z0-9][a-z0-9_-]{0,39}$/.test(row.name))
      return setText(byId("places-error"), "the name of a place has small letters, digits, - and _, 40 at most");
    return setText(byId("places-error"), (await this.places.set(kind, i, row)) ?? "");
  }

  /** @param {string} name */
  #go(name) {
    this.connection
      .request({ type: "go_to_place", name })
      .then(() => this.notifications.toast(`Goal: ${name}`), this.notifications.showError);
  }

  /** @param {"toml" | "geojson"} format */
  async #save(format) {
    try {
      const text = await this.connection.request({ type: "save_map", format });
      download(
        `map.${format}`,
        new Blob([text], { type: format === "toml" ? "application/toml" : "application/geo+json" }),
      );
    } catch (error) {
      setText(byId("places-error"), messageOf(error));
    }
  }

  /** @param {HTMLInputElement} input */
  async #load(input) {
    const file = input.files?.[0];
    if (!file) return;
    try {
      await this.places.load(await file.text());
      setText(byId("places-error"), "");
    } catch (error) {
      setText(byId("places-error"), messageOf(error));
    }
    input.value = "";
  }
}

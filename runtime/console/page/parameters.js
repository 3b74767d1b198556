// @ts-check
// The live settings: each is validated by the robot's process, and its error is shown beside its field. The schemas'
// gains appear in the drive panel as well; both places show the same value.

import { messageOf, RequestError } from "./connection.js";
import { byId, download, el, setText } from "./dom.js";
import { makeField, refuse, showIn, valueIn } from "./fields.js";
import { Panel } from "./panel.js";

const GAIN = /^behaviors\.(?!arbiter)[a-z_]+\.[a-z_]*gain$/;
const MODEL_BYTES_MAX = 60_000;
/** @param {Element} field */
const pathOf = (field) => field.getAttribute("data-path") ?? "";
const LOADING_MAX_MS = 600_000; // the first model with corners may have to wait for its kernels to compile

export class Parameters extends Panel {
  /** @type {Map<string, Field[]>} */
  #fields = new Map(); // those that show a setting, by its path

  /** @param {Panels} parts */
  constructor(parts) {
    super(parts);
    const { run } = parts;
    run.on("session", ({ parameters }) => this.#list(parameters ?? []));
    byId("tune-filter").addEventListener("input", () => this.#filter());
    byId("tune-undo").addEventListener("click", () => this.undo());
    byId("tune-save").addEventListener("click", () => this.#save());
    byId("model-file").addEventListener("change", () => this.#loadModel());
  }

  /** @param {Parameter[]} parameters */
  #list(parameters) {
    const typing =
      document.activeElement?.closest(".field") !== null &&
      parameters.length > 0 &&
      parameters.every(({ path }) => this.#fields.has(path)) &&
      parameters.length === this.#fields.size;
    if (typing) {
      // the same parameters again: another client may have changed a value, but text being typed is kept
      this.show(parameters);
      return;
    }
    this.#fields.clear();
    /** @type {Map<string, HTMLElement>} */
    const sections = new Map();
    for (const parameter of parameters) {
      const section = parameter.path.split(".").slice(0, -1).join(".");
      if (!sections.has(section))
        sections.set(
          section,
          el("fieldset", {}, el("legend", {}, section.replaceAll("_", " ").replaceAll(".", " › "))),
        );
      sections.get(section)?.append(this.#field(parameter, "tune"));
    }
    byId("tune-fields").replaceChildren(...sections.values());
    const gains = parameters.filter(({ path }) => GAIN.test(path)).map((parameter) => this.#field(parameter, "gain"));
    byId("drive-gains").replaceChildren(
      ...(gains.length > 0 ? gains : [el("p", { class: "hint" }, "no gains to set")]),
    );
    this.#filter();
  }

  /** @param {Parameter} parameter @param {string} place */
  #field(parameter, place) {
    const field = makeField(parameter, place, (changed) => void this.#set(changed));
    this.#fields.set(parameter.path, [...(this.#fields.get(parameter.path) ?? []), field]);
    return field.element;
  }

  // Shows the values now in force in every field that displays them.
  /** @param {ChangedValue[]} parameters */
  show(parameters) {
    for (const { path, value } of parameters) {
      for (const field of this.#fields.get(path) ?? []) {
        field.parameter.value = value;
        if (document.activeElement !== field.input) showIn(field, value);
      }
    }
  }

  /** @param {Field} field */
  async #set(field) {
    const { path } = field.parameter,
      value = valueIn(field);
    if (value === undefined) return;
    try {
      const data = await this.connection.request({ type: "set_parameter", path, value });
      for (const one of this.#fields.get(path) ?? []) {
        one.parameter.value = value;
        showIn(one, value);
      }
      this.show(data); // more may have changed with it
    } catch (error) {
      const at = error instanceof RequestError ? error.field : null;
      const isOther = at !== null && at !== path && this.#fields.has(at);
      refuse(field, isOther ? `${at}: ${messageOf(error)}` : messageOf(error));
    }
  }

  async undo() {
    const data = await this.ask({ type: "undo_parameter" });
    if (data === undefined) return;
    this.show(Array.isArray(data) ? data : [data]);
    this.notifications.toast(Array.isArray(data) ? "The last change is undone" : `${data.path} is ${data.value} again`);
  }

  #filter() {
    const text = byId("tune-filter").value.trim().toLowerCase();
    for (const section of byId("tune-fields").children) {
      let some = false;
      for (const field of section.querySelectorAll(".field")) {
        const found = text === "" || `${pathOf(field)} ${field.textContent}`.toLowerCase().includes(text);
        field.toggleAttribute("hidden", !found);
        some ||= found;
      }
      section.toggleAttribute("hidden", !some);
    }
  }

  async #save() {
    const text = await this.ask({ type: "save_toml" });
    if (text === undefined) return;
    const area = el("textarea", { readonly: true, "aria-label": "The settings in force, as TOML", id: "toml" });
    area.value = text;
    this.notifications.confirm("Settings as TOML", area, [
      ["Close", null],
      ["Save as a file", () => download("echolocate.toml", new Blob([text], { type: "application/toml" }))],
    ]);
  }

  async #loadModel() {
    const input = byId("model-file"),
      error = byId("model-error");
    const file = input.files?.[0];
    if (!file) return;
    setText(error, "");
    if (file.size > MODEL_BYTES_MAX) {
      setText(error, `${file.name} is ${Math.round(file.size / 1000)} kB long; a model file has less than 60`);
      return;
    }
    try {
      await this.connection.request({ type: "load_model", toml: await file.text() }, LOADING_MAX_MS);
      this.notifications.toast(`${file.name} is loaded`);
    } catch (problem) {
      setText(error, messageOf(problem));
    }
    input.value = ""; // so that the same file can be chosen again after it was mended
  }
}

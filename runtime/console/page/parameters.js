// The live settings: each is validated by the robot's process, and its error is shown beside its field. The schemas'
// gains
// appear in the drive panel as well; both places show the same value.

import { byId, download, el, setAttribute, setText } from "./dom.js";

const GAIN = /^behaviors\.(?!arbiter)[a-z_]+\.[a-z_]*gain$/;
const MODEL_BYTES_MAX = 60_000;
const LOADING_MAX_MS = 600_000; // the first model with corners may have to wait for its kernels to compile

export class Parameters {
  #fields = new Map(); // path → the fields that show it

  constructor({ run, connection, notifications }) {
    Object.assign(this, { run, connection, notifications });
    run.on("session", ({ parameters }) => this.#list(parameters ?? []));
    byId("tune-filter").addEventListener("input", () => this.#filter());
    byId("tune-undo").addEventListener("click", () => this.undo());
    byId("tune-save").addEventListener("click", () => this.#save());
    byId("model-file").addEventListener("change", () => this.#loadModel());
  }

  #list(parameters) {
    const typing =
      document.activeElement?.closest?.(".field") !== null &&
      parameters.length > 0 &&
      parameters.every(({ path }) => this.#fields.has(path)) &&
      parameters.length === this.#fields.size;
    if (typing) {
      // the same parameters again: another client may have changed a value, but text being typed is kept
      this.show(parameters);
      return;
    }
    this.#fields.clear();
    const sections = new Map();
    for (const parameter of parameters) {
      const section = parameter.path.split(".").slice(0, -1).join(".");
      if (!sections.has(section))
        sections.set(
          section,
          el("fieldset", {}, el("legend", {}, section.replaceAll("_", " ").replaceAll(".", " › "))),
        );
      sections.get(section).append(this.#field(parameter, "tune"));
    }
    byId("tune-fields").replaceChildren(...sections.values());
    const gains = parameters.filter(({ path }) => GAIN.test(path)).map((parameter) => this.#field(parameter, "gain"));
    byId("drive-gains").replaceChildren(
      ...(gains.length > 0 ? gains : [el("p", { class: "hint" }, "no gains to set")]),
    );
    this.#filter();
  }

  #field(parameter, place) {
    const { path, label, kind, choices, low, high, help } = parameter;
    const id = `${place}-${path.replaceAll(".", "-")}`;
    let input;
    if (kind === "choice" || choices)
      input = el(
        "select",
        { id },
        ...(parameter.optional ? ["", ...choices] : choices).map((choice) =>
          el("option", { value: String(choice) }, String(choice)),
        ),
      );
    else if (kind === "bool") input = el("input", { id, type: "checkbox" });
    else
      input = el("input", {
        id,
        type: "text",
        inputmode: kind === "float" ? "decimal" : kind === "int" ? "numeric" : null,
        autocomplete: "off",
        spellcheck: "false",
      });
    input.className = "control";
    const error = el("output", { class: "error", id: `${id}-error`, for: id });
    const range = describeRange(low, high);
    const text = [help, range, parameter.optional ? "Empty: none." : ""].filter(Boolean).join(" ");
    setAttribute(input, "aria-describedby", `${id}-help ${id}-error`);
    const element = el(
      "div",
      { class: "field", "data-path": path },
      el("label", { for: id }, label || path.split(".").at(-1).replaceAll("_", " ")),
      input,
      error,
      el("span", { class: "help", id: `${id}-help` }, text),
    );
    const field = { parameter, element, input, error };
    input.addEventListener("change", () => this.#set(field));
    input.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.#showIn(field, parameter.value);
    });
    if (!this.#fields.has(path)) this.#fields.set(path, []);
    this.#fields.get(path).push(field);
    this.#showIn(field, parameter.value);
    return element;
  }

  #showIn({ parameter, input, error, element }, value) {
    if (input.type === "checkbox") input.checked = value === true;
    else input.value = value === null || value === undefined ? "" : String(value);
    setText(error, "");
    input.removeAttribute("aria-invalid");
    parameter.first ??= { value };
    element.classList.toggle("changed", value !== parameter.first.value);
  }

  // Shows the values now in force in every field that displays them.
  show(parameters) {
    for (const { path, value } of parameters) {
      for (const field of this.#fields.get(path) ?? []) {
        field.parameter.value = value;
        if (document.activeElement !== field.input) this.#showIn(field, value);
      }
    }
  }

  async #set(field) {
    const {
      parameter: { path, kind, optional = false },
      input,
    } = field;
    const value = read(kind, input, optional);
    if (value === undefined) {
      this.#refuse(field, kind === "int" ? "a whole number is wanted" : "a number is wanted");
      return;
    }
    try {
      const data = await this.connection.request({ type: "set_parameter", path, value });
      for (const one of this.#fields.get(path) ?? []) {
        one.parameter.value = value;
        this.#showIn(one, value);
      }
      this.#onMode(data); // more may have changed with it
    } catch (error) {
      const other = error.field && error.field !== path ? this.#fields.get(error.field) : null;
      this.#refuse(field, other ? `${error.field}: ${error.message}` : error.message);
    }
  }

  #refuse({ input, error }, text) {
    setText(error, text);
    setAttribute(input, "aria-invalid", "true");
  }

  #onMode(data) {
    if (Array.isArray(data)) this.show(data);
    else if (Array.isArray(data?.parameters)) this.show(data.parameters);
    else if (data?.path !== undefined) this.show([data]);
  }

  undo() {
    return this.connection.request({ type: "undo_parameter" }).then((data) => {
      this.#onMode(data);
      this.notifications.toast(data?.path ? `${data.path} is ${data.value} again` : "The last change is undone");
    }, this.notifications.showError);
  }

  #filter() {
    const text = byId("tune-filter").value.trim().toLowerCase();
    for (const section of byId("tune-fields").children) {
      let some = false;
      for (const field of section.querySelectorAll(".field")) {
        const found = text === "" || `${field.dataset.path} ${field.textContent}`.toLowerCase().includes(text);
        field.hidden = !found;
        some ||= found;
      }
      section.hidden = !some;
    }
  }

  async #save() {
    let text;
    try {
      const data = await this.connection.request({ type: "save_toml" });
      text = typeof data === "string" ? data : (data?.toml ?? "");
    } catch (error) {
      this.notifications.showError(error);
      return;
    }
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
    const [file] = input.files;
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
      setText(error, problem.message);
    }
    input.value = ""; // so that the same file can be chosen again after it was mended
  }
}

// What a field says: undefined where that is no value of its kind, null where it is empty and may be.
function read(kind, input, optional) {
  if (input.type === "checkbox") return input.checked;
  const text = input.value.trim();
  if (text === "" && optional) return null;
  if (kind !== "float" && kind !== "int") return text;
  if (text === "") return undefined;
  const value = Number(text.replace(",", "."));
  return Number.isFinite(value) && (kind === "float" || Number.isInteger(value)) ? value : undefined;
}

function describeRange(low, high) {
  const known = (bound) => bound !== null && bound !== undefined;
  if (known(low) && known(high)) return `${low} to ${high}.`;
  if (known(low)) return `${low} or more.`;
  return known(high) ? `${high} or less.` : "";
}

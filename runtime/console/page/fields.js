// @ts-check
// A setting as a field of a form: its label, an input that fits its kind, what it means, and what is wrong with it.

import { el, setAttribute, setText } from "./dom.js";
import { numberIn } from "./units.js";

/** @param {Input} input @returns {input is HTMLInputElement} */
const isBox = (input) => input.type === "checkbox";

// A field that calls `act` when its value was changed.
/** @param {Parameter} parameter @param {string} place @param {(field: Field) => void} act @returns {Field} */
export function makeField(parameter, place, act) {
  const { path, label, kind, choices, low, high, help } = parameter;
  const id = `${place}-${path.replaceAll(".", "-")}`;
  /** @type {Input} */
  let input;
  if (choices !== null)
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
  const text = [help, describeRange(low, high), parameter.optional ? "Empty: none." : ""].filter(Boolean).join(" ");
  setAttribute(input, "aria-describedby", `${id}-help ${id}-error`);
  const element = el(
    "div",
    { class: "field", "data-path": path },
    el("label", { for: id }, label),
    input,
    error,
    el("span", { class: "help", id: `${id}-help` }, text),
  );
  const field = { parameter, first: parameter.value, element, input, error };
  input.addEventListener("change", () => act(field));
  element.addEventListener("keydown", (event) => {
    if (event.key === "Escape") showIn(field, parameter.value);
  });
  showIn(field, parameter.value);
  return field;
}

/** @param {Field} field @param {Parameter["value"]} value */
export function showIn({ first, input, error, element }, value) {
  if (isBox(input)) input.checked = value === true;
  else input.value = value === null ? "" : String(value);
  setText(error, "");
  input.removeAttribute("aria-invalid");
  element.classList.toggle("changed", value !== first);
}

/** @param {Field} field @param {string} text */
export function refuse({ input, error }, text) {
  setText(error, text);
  setAttribute(input, "aria-invalid", "true");
}

// What a field says, null where it is empty and may be; undefined, and said beside it, where that is no value of its kind.
/** @param {Field} field */
export function valueIn(field) {
  const {
    input,
    parameter: { kind, optional },
  } = field;
  if (isBox(input)) return input.checked;
  const text = input.value.trim();
  if (text === "" && (optional || kind === "toml")) return null;
  if (kind !== "float" && kind !== "int") return text;
  const value = text === "" ? Number.NaN : (numberIn(text) ?? 0);
  if (Number.isFinite(value) && (kind === "float" || Number.isInteger(value))) return value;
  refuse(field, kind === "int" ? "a whole number is wanted" : "a number is wanted");
  return undefined;
}

/** @param {number | null} low @param {number | null} high */
function describeRange(low, high) {
  if (low !== null && high !== null) return `${low} to ${high}.`;
  if (low !== null) return `${low} or more.`;
  return high !== null ? `${high} or less.` : "";
}

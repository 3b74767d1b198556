// @ts-check
// The tables that installed packages have in a settings file, as a form beside the file's text: a changed field changes
// the text, which is checked and saved as if it had been typed.

import { byId, el } from "./dom.js";
import { makeField, showIn, valueIn } from "./fields.js";

export class SettingsForm {
  /** @type {Field[]} */
  #fields = [];
  #shape = "";

  /** @param {(field: Field, value: Parameter["value"]) => void} act called with a field and the value that it says */
  constructor(act) {
    this.act = act;
  }

  // Shows the tables of a text. A field that is being typed in keeps what it has.
  /** @param {SettingsTable[]} tables @param {boolean} readOnly */
  show(tables, readOnly) {
    const parameters = tables.flatMap(({ fields }) => fields);
    const shape = JSON.stringify([readOnly, parameters.map(({ path }) => path)]);
    if (shape !== this.#shape) {
      this.#shape = shape;
      this.#fields = [];
      byId("settings-form").replaceChildren(...tables.map((table) => this.#table(table, readOnly)));
      byId("settings-form").hidden = parameters.length === 0;
      return;
    }
    this.#fields.forEach((field, i) => {
      field.parameter.value = parameters[i].value;
      if (document.activeElement !== field.input) showIn(field, parameters[i].value);
    });
  }

  /** @param {SettingsTable} table @param {boolean} readOnly */
  #table({ title, help, fields }, readOnly) {
    const made = fields.map((parameter) =>
      makeField(parameter, "settings-form", (field) => {
        const value = valueIn(field);
        if (value !== undefined) this.act(field, value);
      }),
    );
    this.#fields.push(...made);
    return el(
      "fieldset",
      { disabled: readOnly },
      el("legend", {}, title),
      el("p", { class: "hint" }, help),
      ...made.map(({ element }) => element),
    );
  }
}

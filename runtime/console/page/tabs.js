// @ts-check
// Panels behind tabs, with the keys that tab lists have: arrows, Home, End.

import { byId, byKey } from "./dom.js";

export class Tabs {
  /** @type {HTMLElement[]} */
  #tabs = [...byId("tabs").querySelectorAll('[role="tab"]')].filter((tab) => tab instanceof HTMLElement);
  /** @type {(name: string) => void} */
  #changed;
  beside = ""; // the panel that is shown beside the chosen one
  taken = () => {}; // called when that is to be the chosen one

  /** @param {(name: string) => void} changed */
  constructor(changed) {
    this.#changed = changed;
    for (const tab of this.#tabs) {
      tab.addEventListener("click", () => this.show(tab.id.slice(4)));
      tab.addEventListener("keydown", (event) => this.#key(event, tab));
    }
  }

  /** @param {string} name */
  show(name, { focus = false } = {}) {
    if (name === this.beside) this.taken();
    for (const tab of this.#tabs) {
      const chosen = tab.id === `tab-${name}`;
      tab.setAttribute("aria-selected", String(chosen));
      tab.tabIndex = chosen ? 0 : -1;
      byId(String(tab.getAttribute("aria-controls"))).hidden = !chosen && tab.id !== `tab-${this.beside}`;
      if (chosen && focus) tab.focus();
    }
    this.#changed(name);
  }

  // Shows the panel of the last visit, if this screen has a tab for it.
  /** @param {string} name */
  restore(name) {
    if (this.#tabs.some((tab) => tab.id === `tab-${name}` && tab.offsetParent !== null)) this.show(name);
  }

  get names() {
    return this.#tabs.map((tab) => tab.id.slice(4));
  }

  /** @param {string} name */
  label(name) {
    return byId(`tab-${name}`).firstChild?.textContent ?? "";
  }

  // Whether a panel is on the screen.
  /** @param {string} name */
  shows(name) {
    return name === this.shown || name === this.beside;
  }

  get shown() {
    return this.#tabs.find((tab) => tab.getAttribute("aria-selected") === "true")?.id.slice(4) ?? "";
  }

  /** @param {KeyboardEvent} event @param {HTMLElement} tab */
  #key(event, tab) {
    const seen = this.#tabs.filter((one) => one.offsetParent !== null);
    const at = seen.indexOf(tab);
    const to = byKey(event, { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: seen.length - 1 });
    if (to === undefined) return;
    event.preventDefault();
    this.show(seen[(to + seen.length) % seen.length].id.slice(4), { focus: true });
  }
}

// @ts-check
// A second panel beside the first, on screens that are wide enough for two. Which one, and its width, are kept.

import { byId, el, setText } from "./dom.js";
import { prefer, preferred } from "./preferences.js";

const KEPT = "panel beside";
const WIDE = "(min-width: 1280px) and (min-height: 640px)";
const ALONE = new Set(["cycle"]); // below the map already

export class Beside {
  #wide = matchMedia(WIDE);
  #main = /** @type {HTMLElement} */ (document.querySelector("main"));
  #wanted = preferred(KEPT, "");

  /** @param {Pick<Parts, "tabs"> & { shown: (name: string) => void }} parts */
  constructor({ tabs, shown }) {
    this.tabs = tabs;
    this.shown = shown;
    const chooser = byId("beside-panel");
    chooser.append(
      ...tabs.names.filter((name) => !ALONE.has(name)).map((name) => el("option", { value: name }, tabs.label(name))),
    );
    chooser.addEventListener("change", () => this.set(chooser.value));
    byId("beside-close").addEventListener("click", () => this.set(""));
    tabs.taken = () => this.set(""); // the panel beside is shown as the first one
    this.#wide.addEventListener("change", () => this.#place());
    this.#place();
  }

  /** @param {string} name */
  set(name) {
    this.#wanted = name;
    prefer(KEPT, name);
    this.#place();
  }

  #place() {
    const { tabs } = this,
      before = tabs.beside,
      name = this.#wide.matches && tabs.names.includes(this.#wanted) ? this.#wanted : "";
    byId("beside-panel").value = name;
    if (name === before) return;
    if (before !== "") byId(`panel-${before}`).classList.remove("is-beside");
    tabs.beside = name;
    if (name !== "") byId(`panel-${name}`).classList.add("is-beside");
    if (name === "") delete this.#main.dataset.beside;
    else this.#main.dataset.beside = name;
    byId("beside").hidden = name === "";
    setText(byId("beside-name"), name === "" ? "" : tabs.label(name));
    tabs.show(tabs.shown === name ? (tabs.names.find((one) => one !== name) ?? "") : tabs.shown);
    if (name !== "") this.shown(name);
  }
}

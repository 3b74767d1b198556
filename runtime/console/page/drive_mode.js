// @ts-check
// Drive mode, for a phone in one's hands: the map, and below it the pad beside HALT under the thumbs. The same pad and
// the same HALT as ever, moved; without drive mode they return to where they were.

import { byId } from "./dom.js";
import { prefer, preferred } from "./preferences.js";

export class DriveMode {
  #dock = byId("dock");
  /** @type {Array<{ element: HTMLElement; mark: Comment }>} */
  #moved = [];

  /** @param {Pick<Parts, "teleoperation"> & { changed: () => void }} parts */
  constructor({ teleoperation, changed }) {
    this.teleoperation = teleoperation;
    this.changed = changed;
    byId("drive-mode").addEventListener("click", () => this.set(true, { focus: true }));
    byId("dock-close").addEventListener("click", () => this.set(false, { focus: true }));
    if (preferred("drive mode", false)) this.set(true);
  }

  get on() {
    return this.#moved.length > 0;
  }

  /** @param {boolean} on */
  set(on, { focus = false } = {}) {
    if (on === this.on) return;
    this.teleoperation.stop("the layout changes"); // what is moved loses the pointer that held it
    if (on) {
      for (const [id, place] of /** @type {const} */ ([
        ["pad", "dock-pad"],
        ["teleop-facts", "dock-facts"],
        ["arm-row", "dock-facts"],
        ["halt", "dock-halt"],
      ])) {
        const element = byId(id),
          mark = document.createComment(id);
        element.replaceWith(mark);
        byId(place).append(element);
        this.#moved.push({ element, mark });
      }
    } else for (const { element, mark } of this.#moved.splice(0)) mark.replaceWith(element);
    this.#dock.hidden = !on;
    document.body.classList.toggle("drives", on);
    prefer("drive mode", on);
    if (focus) byId(on ? "pad" : "drive-mode").focus();
    this.changed();
  }
}

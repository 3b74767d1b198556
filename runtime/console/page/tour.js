// @ts-check
// Five steps through the page for a first visit, beside what they explain. Never in the way of HALT, never shown again
// once it was left; a button brings it back.

import { byId, setText } from "./dom.js";
import { prefer, preferred } from "./preferences.js";

const SEEN = "tour seen";
/** @type {Array<[keyof PageElements, string, string | ((mayAct: boolean) => string)]>} */
const STEPS = [
  [
    "halt",
    "HALT",
    (mayAct) =>
      mayAct
        ? "Stops the robot at once; so does the space bar. It stands until you arm it again."
        : "This page has no token, so it only watches: HALT does nothing here. " +
          "Use the robot's own stop, or open the address with its token.",
  ],
  ["mode", "One state", "What the robot does now, and why. NO DATA, grey and dashed, means that what you see is old."],
  [
    "map-front",
    "The map",
    "What the ring hears and what was recognised. Drag to move it, turn the wheel to zoom. " +
      "The tools at its edge select, measure, place objects and set goals.",
  ],
  [
    "tabs",
    "Panels",
    "The objects with their evidence, layers, settings, recordings, plots, the log. " +
      "A number on Log counts new warnings.",
  ],
  [
    "tab-drive",
    "To drive",
    (mayAct) =>
      mayAct
        ? "Open Drive, press Arm and hold the pad. Let go, and the robot stops. The key ? lists all keys."
        : "Only a page with the run's token drives. The key ? lists all keys.",
  ],
];

export class Tour {
  #card = byId("tour");
  #step = 0;
  /** @type {Element | null} */
  #marked = null;

  // `mayAct` says whether the page has the run's token.
  /** @param {{ mayAct: () => boolean }} parts */
  constructor({ mayAct }) {
    this.mayAct = mayAct;
    byId("tour-next").addEventListener("click", () =>
      this.#step + 1 < STEPS.length ? this.#show(this.#step + 1) : this.end(),
    );
    byId("tour-back").addEventListener("click", () => this.#show(this.#step - 1));
    byId("tour-skip").addEventListener("click", () => this.end());
    byId("tour-again").addEventListener("click", () => this.begin());
    this.#card.addEventListener("keydown", (event) => event.key === "Escape" && this.end());
    addEventListener("resize", () => this.#card.hidden || this.#place());
  }

  beginOnce() {
    if (!preferred(SEEN, false)) this.begin();
  }

  begin() {
    this.#card.hidden = false;
    this.#show(0);
    byId("tour-next").focus();
  }

  end() {
    prefer(SEEN, true);
    this.#mark(null);
    this.#card.hidden = true;
    byId("map-front").focus();
  }

  /** @param {number} step */
  #show(step) {
    this.#step = step;
    const [target, title, text] = STEPS[step];
    setText(byId("tour-title"), title);
    setText(byId("tour-text"), typeof text === "function" ? text(this.mayAct()) : text);
    setText(byId("tour-count"), `${step + 1} of ${STEPS.length}`);
    setText(byId("tour-next"), step + 1 < STEPS.length ? "Next" : "Done");
    byId("tour-back").disabled = step === 0;
    this.#mark(byId(target));
    this.#place();
  }

  // What a step says depends on what the page may do, which is known once it is connected.
  refresh() {
    if (!this.#card.hidden) this.#show(this.#step);
  }

  /** @param {Element | null} element */
  #mark(element) {
    this.#marked?.classList.remove("toured");
    element?.classList.add("toured");
    this.#marked = element;
  }

  // Below what is explained, above it, or in the middle of something large; always within the window.
  #place() {
    if (this.#marked === null) return;
    const { left, right, top, bottom } = this.#marked.getBoundingClientRect();
    const { offsetWidth: width, offsetHeight: height } = this.#card;
    const room = 12;
    /** @param {number} at @param {number} size @param {number} all */
    const clamp = (at, size, all) => Math.max(room, Math.min(at, all - size - room));
    let y = bottom + room;
    if (y + height > innerHeight) y = top - height - room;
    if (y < room) y = (top + bottom - height) / 2;
    this.#card.style.left = `${clamp((left + right - width) / 2, width, innerWidth)}px`;
    this.#card.style.top = `${clamp(y, height, innerHeight)}px`;
  }
}

// @ts-check
// Buttons of one's own over the map: missions, places and whatever else offers actions, each with a key if one wants.
// They are kept in this browser.

import { button, byId, el, setText, writesText } from "./dom.js";
import { prefer, preferred } from "./preferences.js";

const KEPT = "buttons";
// Keys that the page uses itself, see keyboard.js; letters of the drive keys among them.
const TAKEN = new Set([..."+-=−fulpkwasd[]?123456789 "]);

/**
 * @typedef {{ action: string; key: string }} Kept
 * @typedef {{ id: string; name: string; did: string; act: () => Promise<unknown> }} Offer
 */

export class Buttons {
  /** @type {Map<string, () => Offer[]>} */
  #offers = new Map(); // by kind
  #shown = "";
  #kept = preferred(KEPT, /** @type {Kept[]} */ ([])).filter((one) => typeof one?.action === "string");

  /** @param {Pick<Parts, "run" | "notifications">} parts */
  constructor({ run, notifications }) {
    this.run = run;
    this.notifications = notifications;
    byId("button-form").addEventListener("submit", (event) => this.#add(event));
    run.on("session", () => this.refresh());
    run.on("state", () => this.refresh());
    addEventListener("keydown", (event) => this.#key(event));
  }

  // Offers actions of a kind, as "mission" or "place": `list` returns what there is now; `did` begins what the page
  // reports of it.
  /** @param {string} kind @param {() => Offer[]} list */
  offer(kind, list) {
    this.#offers.set(kind, list);
    this.refresh();
  }

  get #actions() {
    return [...this.#offers].flatMap(([kind, list]) =>
      list().map((one) => ({ ...one, kind, key: `${kind}:${one.id}` })),
    );
  }

  refresh() {
    const actions = this.#actions,
      kept = this.#kept;
    const enabled = this.run.state.controller && !this.run.watchesRecording;
    const shown = JSON.stringify([kept, enabled, actions.map(({ key, name }) => [key, name])]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const bar = byId("own-buttons"),
      chooser = byId("button-action"),
      chosen = chooser.value;
    bar.hidden = kept.length === 0;
    bar.replaceChildren(
      ...kept.map(({ action, key }) => {
        const found = actions.find((one) => one.key === action);
        const name = found?.name ?? action.slice(action.indexOf(":") + 1);
        const content = [el("span", {}, name), key ? el("kbd", {}, key.toUpperCase()) : null];
        const title = found ? `${found.kind} ${name}` : "not available now";
        const disabled = !enabled || found === undefined;
        return button(content, () => this.#act(action), { "data-action": action, title, disabled });
      }),
    );
    chooser.replaceChildren(...actions.map(({ key, kind, name }) => el("option", { value: key }, `${kind} ${name}`)));
    if (actions.some(({ key }) => key === chosen)) chooser.value = chosen;
    byId("button-list").replaceChildren(
      ...kept.map(({ action, key }) =>
        el(
          "li",
          { class: "line" },
          el("span", {}, `${action.replace(":", " ")}${key ? `, key ${key.toUpperCase()}` : ""}`),
          button("Remove", () => this.#keep(this.#kept.filter((one) => one.action !== action)), {
            "aria-label": `Remove the button ${action.replace(":", " ")}`,
          }),
        ),
      ),
    );
  }

  /** @param {Kept[]} buttons */
  #keep(buttons) {
    this.#kept = buttons;
    prefer(KEPT, buttons);
    this.refresh();
  }

  /** @param {SubmitEvent} event */
  #add(event) {
    event.preventDefault();
    const action = byId("button-action").value,
      key = byId("button-key").value.trim().toLowerCase();
    const others = this.#kept.filter((one) => one.action !== action);
    const taken = TAKEN.has(key)
      ? "the page itself"
      : others.find((one) => one.key === key && key !== "")?.action.replace(":", " ");
    setText(
      byId("button-error"),
      action === ""
        ? "there is no mission or place for a button yet"
        : taken === undefined
          ? ""
          : `the key ${key.toUpperCase()} belongs to ${taken}: choose another`,
    );
    if (action === "" || taken !== undefined) return;
    byId("button-key").value = "";
    this.#keep([...others, { action, key }]);
  }

  /** @param {string} action */
  async #act(action) {
    const found = this.#actions.find(({ key }) => key === action);
    if (found === undefined || !this.run.state.controller || this.run.watchesRecording) return;
    try {
      await found.act();
      this.notifications.toast(`${found.did}: ${found.name}`);
    } catch (error) {
      this.notifications.showError(error);
    }
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (
      event.defaultPrevented ||
      event.repeat ||
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      event.shiftKey ||
      writesText(event.target) ||
      event.target instanceof HTMLSelectElement
    )
      return;
    const found = this.#kept.find(({ key }) => key !== "" && key === event.key.toLowerCase());
    if (found === undefined || TAKEN.has(found.key)) return;
    event.preventDefault();
    this.#act(found.action);
  }
}

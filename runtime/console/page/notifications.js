// @ts-check
// Banners on the map, toasts and dialogs. Dialogs are never modal: HALT must stay reachable by pointer and keyboard.

import { messageOf } from "./connection.js";
import { button, byId, el, setText } from "./dom.js";

const TOAST_MS = 7000;

export class Notifications {
  #banners = byId("banners");
  #toasts = byId("toasts");
  #dialog = byId("dialog");
  /** @type {Map<string, { key: string; element: HTMLElement }>} */
  #shown = new Map();
  /** @type {Element | null} */
  #before = null;

  constructor() {
    this.#dialog.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.close();
    });
  }

  // A banner stays until it is removed; the same text again changes nothing.
  /** @param {string} name @param {string | null} text @param {{ bad?: boolean; buttons?: Choice[] }} more */
  banner(name, text, { bad = false, buttons = [] } = {}) {
    const key = `${text}|${bad}|${buttons.map(([label]) => label)}`;
    const shown = this.#shown.get(name);
    if (text === null) {
      shown?.element.remove();
      this.#shown.delete(name);
      return;
    }
    if (shown?.key === key) return;
    const element = el(
      "div",
      { class: bad ? "banner bad" : "banner", id: `banner-${name}`, role: "group", "aria-label": name },
      el("span", {}, text),
      ...buttons.map(([label, act]) => button(label, act)),
    );
    if (shown) shown.element.replaceWith(element);
    else this.#banners.append(element);
    this.#shown.set(name, { key, element });
  }

  // Replaces the text of a banner that counts, without a new element each time.
  /** @param {string} name @param {string} text */
  updateBanner(name, text) {
    const shown = this.#shown.get(name);
    if (shown?.element.firstChild) setText(shown.element.firstChild, text);
  }

  /** @param {string} text */
  toast(text) {
    const element = el("p", { class: "toast" }, text);
    this.#toasts.append(element);
    while (this.#toasts.children.length > 3) this.#toasts.firstElementChild?.remove();
    setTimeout(() => element.remove(), TOAST_MS);
  }

  // For rejected requests that belong to no input field.
  /** @param {unknown} error */
  showError = (error) => this.toast(messageOf(error));

  /** @param {string} title @param {Node} body @param {Choice[]} buttons */
  confirm(title, body, buttons) {
    this.#before ??= document.activeElement;
    setText(byId("dialog-title"), title);
    byId("dialog-body").replaceChildren(body);
    byId("dialog-buttons").replaceChildren(
      ...buttons.map(([label, act]) => {
        const answer = button(label, () => {
          if (act?.() !== false && answer.isConnected) this.close(); // an answer may have asked the next question
        });
        return answer;
      }),
    );
    if (!this.#dialog.open) this.#dialog.show();
    const last = byId("dialog-buttons").lastElementChild;
    if (last instanceof HTMLElement) last.focus();
  }

  close() {
    if (!this.#dialog.open) return;
    this.#dialog.close();
    if (this.#before instanceof HTMLElement) this.#before.focus();
    this.#before = null;
  }
}

// What the page has to say to the person in front of it: banners on the map, short notes, questions. Dialogs are never
// modal, because HALT must stay within reach of pointer and keyboard whatever is open.

import { byId, el, say } from "./dom.js";

const TOAST_MS = 7000;

export class Notices {
  #banners = byId("banners");
  #toasts = byId("toasts");
  #dialog = byId("dialog");
  #shown = new Map();
  #before = null;

  constructor() {
    this.#dialog.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.close();
    });
  }

  // A banner stays until it is taken away; the same words again change nothing.
  banner(name, text, { bad = false, buttons = [] } = {}) {
    const key = `${text}|${bad}|${buttons.map(([label]) => label)}`;
    const shown = this.#shown.get(name);
    if (text === null) {
      shown?.element.remove();
      this.#shown.delete(name);
      return;
    }
    if (shown?.key === key) return;
    const element = el("div", { class: bad ? "banner bad" : "banner", id: `banner-${name}`, role: "group", "aria-label": name },
      el("span", {}, text), ...buttons.map(([label, act]) => el("button", { type: "button", onclick: act }, label)));
    if (shown) shown.element.replaceWith(element);
    else this.#banners.append(element);
    this.#shown.set(name, { key, element });
  }

  // The words of a banner that counts, without a new element each time.
  retell(name, text) {
    const shown = this.#shown.get(name);
    if (shown) say(shown.element.firstChild, text);
  }

  toast(text) {
    const element = el("p", { class: "toast" }, text);
    this.#toasts.append(element);
    while (this.#toasts.children.length > 3) this.#toasts.firstChild.remove();
    setTimeout(() => element.remove(), TOAST_MS);
  }

  // For promises whose refusal belongs to no field.
  refused = (error) => this.toast(error.message);

  ask(title, body, buttons) {
    this.#before ??= document.activeElement;
    say(byId("dialog-title"), title);
    byId("dialog-body").replaceChildren(body);
    byId("dialog-buttons").replaceChildren(...buttons.map(([label, act]) => el("button", { type: "button", onclick: () => {
      if (act?.() !== false) this.close();
    } }, label)));
    if (!this.#dialog.open) this.#dialog.show();
    byId("dialog-buttons").lastChild?.focus();
  }

  close() {
    if (!this.#dialog.open) return;
    this.#dialog.close();
    this.#before?.focus?.();
    this.#before = null;
  }
}

// @ts-check
// The run's token: taken from the address, kept for a reload, and asked for where the page has none or a wrong one.

import { el } from "./dom.js";

const KEY = "token";

// Remove the token from the address bar, where a projector would show it; session storage keeps it for a reload.
export function takeToken(key = KEY) {
  const given = new URLSearchParams(location.search).get(KEY);
  if (given !== null) {
    sessionStorage.setItem(key, given);
    history.replaceState(null, "", location.pathname);
  }
  return given ?? sessionStorage.getItem(key) ?? "";
}

// Shows a field for the token, or for the whole address that the run printed, and loads the page again with it.
/** @param {Notifications} notifications */
export function askForToken(notifications) {
  const input = el("input", {
    id: "token-given",
    type: "text",
    size: 34,
    autocomplete: "off",
    spellcheck: "false",
    placeholder: "token, or the whole address",
  });
  const form = el(
    "form",
    { class: "row" },
    el("label", {}, "Token ", input),
    el("button", { type: "submit", class: "primary" }, "Use it"),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const token = tokenIn(input.value);
    if (token === "") return;
    sessionStorage.setItem(KEY, token);
    location.reload();
  });
  notifications.confirm(
    "The token of this run",
    el(
      "div",
      {},
      el("p", { class: "hint" }, "The run prints an address with it when it starts: http://…/?token=…"),
      form,
    ),
    [["Cancel", null]],
  );
  input.focus();
}

/** @param {string} text */
function tokenIn(text) {
  const [, after] = /[?&]token=([^&#\s]+)/.exec(text) ?? [];
  return after === undefined ? text.trim() : decodeURIComponent(after);
}

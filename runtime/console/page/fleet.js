// The fleet page: a card for each run, HALT for one and for all. The server of `echolocate fleet` holds the
// connections.

import { byId, el, setAttribute, setText } from "./dom.js";
import { takeToken } from "./token.js";

const EVERY_MS = 200;
const LOST_MS = 1000;
const UNSENT_MS = 700; // with EVERY_MS less than a second
const HALT_WORDS = {
  none: "",
  sent: "HALT is sent",
  confirmed: "HALT confirmed",
  unconfirmed: "HALT not confirmed: use the robot's own stop",
};

const token = takeToken("fleet token");
const cards = new Map();
let rows = [],
  heard_ms = performance.now(),
  halt_ms = -Infinity,
  problem = "connecting";

async function ask(path, body = undefined) {
  const how = body === undefined ? {} : { method: "POST", body: JSON.stringify(body) };
  const answer = await fetch(path, {
    ...how,
    headers: { "X-Echolocate-Token": token },
    signal: AbortSignal.timeout(5000),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

function halt(address) {
  halt_ms = performance.now();
  ask("/halt", { address }).then(refresh, (error) => {
    problem = `HALT was not sent (${error.message}): use the robots' own stops`;
    show();
  });
}

function card(address) {
  const part = (name, properties = {}) => el(name, properties);
  const parts = {
    name: part("h2"),
    mode: part("dd", { class: "mode-word" }),
    reason: part("dd"),
    battery: part("dd"),
    place: part("dd"),
    address: part("dd"),
    problem: part("p", { class: "error" }),
    halt: part("p", { class: "halt-state", role: "status" }),
    page: el("a", { target: "_blank", rel: "noopener" }, "its page"),
  };
  const facts = [
    ["mode", "mode"],
    ["reason", "reason"],
    ["battery", "battery"],
    ["place", "place"],
    ["address", "address"],
  ];
  parts.remove = el(
    "button",
    { type: "button", class: "small", onclick: () => ask("/remove", { address }).then(refresh, () => {}) },
    "Remove",
  );
  parts.root = el(
    "li",
    {},
    parts.name,
    el("dl", {}, ...facts.flatMap(([name, key]) => [el("dt", {}, name), parts[key]])),
    parts.problem,
    el(
      "div",
      { class: "row" },
      el(
        "button",
        { type: "button", class: "halt", "aria-label": `HALT ${address}`, onclick: () => halt(address) },
        "HALT",
      ),
      parts.page,
      parts.remove,
    ),
    parts.halt,
  );
  return parts;
}

function show() {
  const list = byId("fleet-runs");
  for (const [address, { root }] of cards) {
    if (!rows.some((row) => row.address === address)) {
      root.remove();
      cards.delete(address);
    }
  }
  for (const row of rows) {
    if (!cards.has(row.address)) {
      cards.set(row.address, card(row.address));
      list.append(cards.get(row.address).root);
    }
    const parts = cards.get(row.address);
    setText(parts.name, row.name || row.address);
    for (const key of ["mode", "reason", "battery", "place", "address", "problem"]) setText(parts[key], row[key]);
    setText(parts.mode, row.mode || "not known");
    setText(parts.halt, HALT_WORDS[row.halt]);
    setAttribute(parts.halt, "data-halt", row.halt);
    setAttribute(parts.root, "data-mode", row.problem ? "none" : row.mode);
    setAttribute(parts.root, "data-alarm", row.halt === "unconfirmed");
    setAttribute(parts.page, "href", row.url);
    parts.remove.hidden = row.is_local;
  }
  byId("fleet-none").hidden = rows.length > 0;
  const silent =
    performance.now() - heard_ms > LOST_MS ? "nothing comes from `echolocate fleet`: what is shown is old" : "";
  const open = rows
    .filter(({ halt }) => halt === "unconfirmed")
    .map(({ name, address }) => (name ? `${name} (${address})` : address));
  const unsent =
    performance.now() - halt_ms > UNSENT_MS && halt_ms > heard_ms
      ? "HALT not confirmed: use the robots' own stops"
      : "";
  const alarm = [
    open.length > 0 ? `HALT not confirmed: use the own stop of ${open.join(", ")}` : "",
    unsent,
    silent || problem,
  ]
    .filter(Boolean)
    .join(". ");
  setText(byId("fleet-alarm"), alarm);
  byId("fleet-alarm").hidden = alarm === "";
  const driving = rows.filter(({ mode, problem: lost }) => mode === "DRIVE" && !lost).length;
  setText(
    byId("fleet-summary"),
    `${rows.length} run${rows.length === 1 ? "" : "s"}, ${driving} driving${rows.some((row) => row.problem) ? `, ${rows.filter((row) => row.problem).length} not reached` : ""}`,
  );
}

async function refresh() {
  try {
    rows = await ask("/runs");
    [heard_ms, problem] = [performance.now(), ""];
  } catch (error) {
    problem = error.message;
  }
  show();
}

byId("halt-all").addEventListener("click", () => halt(null));
byId("fleet-add").addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await ask("/add", { url: byId("fleet-url").value });
    byId("fleet-url").value = "";
    setText(byId("fleet-error"), "");
    refresh();
  } catch (error) {
    setText(byId("fleet-error"), error.message);
  }
});
addEventListener(
  "keydown",
  (event) => {
    if (event.key !== " " || event.target instanceof HTMLInputElement || event.ctrlKey || event.metaKey || event.altKey)
      return;
    event.preventDefault();
    if (!event.repeat) halt(null);
  },
  { capture: true },
);
addEventListener(
  "keyup",
  (event) => {
    if (event.key === " " && !(event.target instanceof HTMLInputElement)) event.preventDefault();
  },
  { capture: true },
);
setInterval(show, EVERY_MS);
(async function follow() {
  for (;;) {
    await refresh();
    await new Promise((done) => setTimeout(done, EVERY_MS));
  }
})();

// @ts-check
// The fleet page: a card for each run, HALT for one and for all. The server of `echolocate fleet` holds the
// connections.

import { messageOf } from "./connection.js";
import { button, byId, el, setAttribute, setText } from "./dom.js";
import { takeToken } from "./token.js";
import { counted } from "./units.js";

const EVERY_MS = 200;
const LOST_MS = 1000;
const UNSENT_MS = 700; // with EVERY_MS less than a second
const HALT_WORDS = {
  none: "",
  sent: "HALT is sent",
  confirmed: "HALT confirmed",
  unconfirmed: "HALT not confirmed: use the robot's own stop",
};

const FACTS = /** @type {const} */ (["mode", "reason", "battery", "place", "address"]);

const token = takeToken("fleet token");
/** @type {Map<string, ReturnType<typeof card>>} */
const cards = new Map();
let rows = /** @type {FleetRow[]} */ ([]),
  heard_ms = performance.now(),
  halt_ms = -Infinity,
  problem = "connecting",
  refused = ""; // why the last HALT was not sent: it stays until another one is

/** @param {string} path @param {object} [body] @returns {Promise<unknown>} */
async function ask(path, body) {
  const how = body === undefined ? {} : { method: "POST", body: JSON.stringify(body) };
  const answer = await fetch(path, {
    ...how,
    headers: { "X-Echolocate-Token": token },
    signal: AbortSignal.timeout(5000),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

/** @param {string | null} address */
function halt(address) {
  halt_ms = performance.now();
  ask("/halt", { address }).then(
    () => {
      refused = "";
      return refresh();
    },
    (error) => {
      refused = `HALT was not sent (${error.message}): use the robots' own stops`;
      show();
    },
  );
}

/** @param {string} address */
function card(address) {
  const parts = {
    name: el("h2"),
    mode: el("dd", { class: "mode-word" }),
    reason: el("dd"),
    battery: el("dd"),
    place: el("dd"),
    address: el("dd"),
    problem: el("p", { class: "error" }),
    halt: el("p", { class: "halt-state", role: "status" }),
    page: el("a", { target: "_blank", rel: "noopener" }, "its page"),
  };
  const remove = button("Remove", () => ask("/remove", { address }).then(refresh, () => {}), { class: "small" });
  const root = el(
    "li",
    {},
    parts.name,
    el("dl", {}, ...FACTS.flatMap((name) => [el("dt", {}, name), parts[name]])),
    parts.problem,
    el(
      "div",
      { class: "row" },
      button("HALT", () => halt(address), { class: "halt", "aria-label": `HALT ${address}` }),
      parts.page,
      remove,
    ),
    parts.halt,
  );
  return { ...parts, remove, root };
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
    const parts = cards.get(row.address) ?? card(row.address);
    if (!cards.has(row.address)) list.append(parts.root);
    cards.set(row.address, parts);
    setText(parts.name, row.name || row.address);
    for (const key of FACTS) if (key !== "mode") setText(parts[key], row[key]);
    setText(parts.mode, (row.mode || "not known").replace("_", " ")); // as on the run's own page
    setText(parts.problem, row.problem);
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
    refused || unsent,
    silent || problem,
  ]
    .filter(Boolean)
    .join(". ");
  setText(byId("fleet-alarm"), alarm);
  byId("fleet-alarm").hidden = alarm === "";
  const driving = rows.filter(({ mode, problem: lost }) => mode === "DRIVE" && !lost).length;
  const lost = rows.filter((row) => row.problem).length;
  const summary = `${counted(rows.length, "run")}, ${driving} driving${lost > 0 ? `, ${lost} not reached` : ""}`;
  setText(byId("fleet-summary"), summary);
}

async function refresh() {
  try {
    rows = /** @type {FleetRow[]} */ (await ask("/runs"));
    [heard_ms, problem] = [performance.now(), ""];
  } catch (error) {
    problem = messageOf(error);
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
    setText(byId("fleet-error"), messageOf(error));
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

// @ts-check
// The object list and the selected object: pose, uncertainty, evidence for and against. Screen readers read it in place
// of the map.

import { byId, byKey, el, setAttribute, setText } from "./dom.js";
import { certainty, ellipseOf } from "./draw_objects.js";
import { Panel } from "./panel.js";
import { degrees, percent, times } from "./units.js";
import { countObjects, isWall } from "./walls.js";

const EVIDENCE_EVERY_MS = 1000;

/** @typedef {Record<"element" | "number" | "name" | "sure" | "where" | "off", HTMLElement>} Row */

export class Objects extends Panel {
  #list = byId("objects");
  /** @type {Map<string | number, Row>} */
  #rows = new Map();
  #asked_ms = -Infinity;
  #asking = false;
  // the object whose evidence was refused: an answer that would not change, and a warning in the log each time
  /** @type {number | null} */
  #refused = null;

  /** @param {Panels & Pick<Parts, "selection" | "tools">} parts */
  constructor(parts) {
    super(parts);
    const { run, units, selection, connection, notifications, tools } = parts;
    this.selection = selection;
    run.on("state", () => this.refresh());
    run.on("evidence", () => this.#refreshEvidence());
    units.on("changed", () => this.refresh());
    selection.on("object", () => this.#onSelected());
    this.#list.addEventListener("keydown", (event) => this.#key(event));
    /** @param {"confirm_object" | "reject_object"} type @param {string} done */
    const act = (type, done) => () => {
      const { object } = selection;
      if (object === null) return;
      connection.request({ type, object }).then(() => {
        if (type === "reject_object" && selection.object === object) selection.pick(null);
        notifications.toast(`Object ${object}: ${done}`);
      }, notifications.showError);
    };
    byId("object-confirm").addEventListener(
      "click",
      act("confirm_object", "confirmed; it is reported whatever the readings say"),
    );
    byId("object-reject").addEventListener(
      "click",
      act("reject_object", "rejected; nothing is reported there until you lift the area"),
    );
    byId("object-move").addEventListener("click", () => tools.choose("move", { focus: true }));
  }

  refresh() {
    const { objects, waiting } = this.run.state;
    const counted = countObjects(objects);
    setText(byId("objects-count"), waiting > 0 ? `${counted}, ${waiting} near objects wait for room` : counted);
    byId("objects-empty").hidden = objects.length > 0;
    const seen = new Set();
    objects.forEach((object, index) => {
      const key = object.number ?? `-${index}`;
      seen.add(key);
      const row = this.#rows.get(key) ?? this.#row(object.number);
      this.#rows.set(key, row);
      setText(row.number, object.number === null ? "–" : `${object.number}`);
      setText(row.name, object.model);
      setText(row.sure, certainty(object));
      setText(
        row.where,
        object.ends
          ? this.#between(object.ends)
          : [this.units.place(object.x, object.y), ...this.#turn(object, null)].join(", "),
      );
      setText(row.off, object.ends ? `${this.#long(object.ends)} long` : this.units.spread(object.sigma));
      const picked = object.number !== null && object.number === this.selection.object;
      setAttribute(row.element, "aria-selected", picked);
      if (this.#list.children[index] !== row.element)
        this.#list.insertBefore(row.element, this.#list.children[index] ?? null);
    });
    for (const [key, row] of this.#rows) {
      if (seen.has(key)) continue;
      row.element.remove();
      this.#rows.delete(key);
    }
    this.#refreshSelected();
    this.#askEvidence();
  }

  /** @param {number | null} number */
  #row(number) {
    const parts = {
      number: el("span", { class: "number" }),
      name: el("span", { class: "name" }),
      sure: el("span", { class: "sure" }),
      where: el("span", { class: "where" }),
      off: el("span", { class: "off" }),
    };
    const element = el(
      "li",
      {
        role: "option",
        id: `object-${number ?? "x"}`,
        "aria-selected": "false",
        onclick: () => number !== null && this.selection.pick(number),
      },
      ...Object.values(parts),
    );
    return { element, ...parts };
  }

  // Its heading; a disc has none.
  /** @param {ObjectRow} object @param {number | null} sigma */
  #turn({ model, theta }, sigma) {
    const { arc_radius_m: radius = null, closed = false } = this.run.model(model) ?? {};
    return radius !== null && closed ? [] : [degrees(theta, sigma)];
  }

  // The ends of a wall, and how long it is.
  /** @param {Quad} ends */
  #between([x1, y1, x2, y2]) {
    return `${this.units.number(x1)}, ${this.units.number(y1)} to ${this.units.place(x2, y2)}`;
  }

  /** @param {Quad} ends */
  #long([x1, y1, x2, y2]) {
    return this.units.length(Math.hypot(x2 - x1, y2 - y1));
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const numbers = this.run.state.objects.map(({ number }) => number).filter((number) => number !== null);
    const at = this.selection.object === null ? -1 : numbers.indexOf(this.selection.object);
    const last = numbers.length - 1;
    const to = byKey(event, { ArrowDown: at + 1, ArrowUp: at < 0 ? last : at - 1, Home: 0, End: last });
    if (event.key === "Escape") this.selection.pick(null);
    if (to === undefined || numbers.length === 0) return;
    event.preventDefault();
    this.selection.pick(numbers[Math.max(0, Math.min(to, numbers.length - 1))]);
  }

  #onSelected() {
    this.run.evidence = this.#refused = null;
    this.#asked_ms = -Infinity;
    const picked = this.run.object(this.selection.object);
    const why = this.run.watchesRecording
      ? "The readings are shown in the live run only."
      : picked !== null && isWall(picked)
        ? "The outline segments along a wall are its readings."
        : null;
    byId("evidence").replaceChildren(...(why === null ? [] : [el("p", { class: "hint" }, why)]));
    this.refresh();
    const { object } = this.selection;
    if (object === null) this.#list.removeAttribute("aria-activedescendant");
    else {
      this.#list.setAttribute("aria-activedescendant", `object-${object}`);
      document.getElementById(`object-${object}`)?.scrollIntoView({ block: "nearest" });
    }
  }

  #refreshSelected() {
    const object = this.run.object(this.selection.object);
    byId("object").hidden = this.selection.object === null;
    if (this.selection.object === null) return;
    if (object === null) {
      setText(byId("object-name"), `Object ${this.selection.object} no longer exists`);
      byId("object-facts").replaceChildren();
      return;
    }
    setText(byId("object-name"), `${object.number} ${object.model}`);
    const chance =
      object.probability === null ? `fit ${percent(object.score)}` : `probability ${percent(object.probability)}`;
    const facts = [
      [
        "state",
        object.confirmed
          ? "confirmed by an operator"
          : object.placed
            ? "placed by an operator; no reading supports it yet"
            : "recognised",
      ],
      [
        "certainty",
        object.hidden_by === null
          ? chance
          : `behind wall ${object.hidden_by}, where no reading checks it; before: ${chance}`,
      ],
      ["place", isWall(object) ? this.#between(object.ends) : this.units.place(object.x, object.y, 3)],
      ...this.#turn(object, object.sigma_theta).map((turn) => ["turned by", turn]),
      isWall(object) ? ["length", this.#long(object.ends)] : ["uncertainty", this.units.spread(object.sigma)],
    ];
    if (object.covariance && !isWall(object)) {
      const { major, minor, angle } = ellipseOf(object.covariance);
      facts.push([
        "95 % ellipse",
        `${this.units.number(major, 3)} × ${this.units.length(minor, 3)} at ${degrees(angle)}`,
      ]);
    }
    facts.push(["readings", `${object.support}`]);
    // a wall is where its readings are
    byId("object-confirm").hidden = byId("object-move").hidden = isWall(object);
    const list = byId("object-facts");
    if (list.children.length !== 2 * facts.length) list.replaceChildren(...facts.flatMap(() => [el("dt"), el("dd")]));
    facts.forEach(([name, text], i) => {
      setText(list.children[2 * i], name);
      setText(list.children[2 * i + 1], text);
    });
  }

  #askEvidence() {
    const now = performance.now();
    const { object } = this.selection;
    const picked = this.run.object(object);
    if (
      object === null ||
      picked === null ||
      isWall(picked) ||
      object === this.#refused ||
      this.run.watchesRecording ||
      this.#asking ||
      now - this.#asked_ms < EVIDENCE_EVERY_MS
    )
      return;
    this.#asking = true;
    this.#asked_ms = now;
    this.connection
      .request({ type: "evidence", object })
      .then(
        (data) => this.#takeEvidence(data),
        (error) => {
          if (error.answered) this.#refused = object;
          byId("evidence").replaceChildren(el("p", { class: "hint" }, error.message));
        },
      )
      .finally(() => {
        this.#asking = false;
      });
  }

  /** @param {EvidenceAnswer} message */
  #takeEvidence(message) {
    const readings = message.readings.map(([x, y, range, angle, nats, ...listener]) => ({
      x,
      y,
      range,
      angle,
      nats,
      listener,
    }));
    const lines = message.lines.map(([number, x1, y1, x2, y2, supports]) => ({ number, x1, y1, x2, y2, supports }));
    this.run.evidence = {
      object: message.object,
      pro: message.for,
      contra: message.against,
      readings,
      lines,
      rivals: message.rivals,
    };
    this.run.emit("evidence");
  }

  #refreshEvidence() {
    const { evidence } = this.run;
    if (evidence === null || evidence.object !== this.selection.object) return;
    const most = Math.max(evidence.pro, evidence.contra, 1e-9);
    /** @param {string} kind @param {string} name @param {number} nats */
    const bar = (kind, name, nats) => {
      const fill = el("span", { class: "fill" });
      fill.style.width = `${(100 * nats) / most}%`;
      return el(
        "div",
        { class: `scale ${kind}` },
        el("span", {}, name),
        el("span", { class: "track" }, fill),
        el("b", {}, evidence.lines.length > 0 ? `${nats.toFixed(1)} segments` : `odds × ${times(nats)}`),
      );
    };
    const { readings, lines, rivals } = evidence;
    const against = readings.filter(({ nats }) => nats < 0).length + lines.filter(({ supports }) => !supports).length;
    const others = rivals
      .map(([name, lead]) => `${name} ${times(Math.abs(lead))} times ${lead > 0 ? "likelier" : "less likely"}`)
      .join(", ");
    byId("evidence").replaceChildren(
      ...[
        bar("for", "for it", evidence.pro),
        bar("against", "against", evidence.contra),
        el(
          "p",
          { class: "hint" },
          `${readings.length + lines.length} ${lines.length > 0 ? "segments" : "readings"} on the map, `,
          `${against} of them against (dashed, ✕)`,
        ),
        others === "" ? null : el("p", { class: "hint" }, `Other explanations: ${others}`),
      ].filter((part) => part !== null),
    );
  }
}

// Describes the map in a sentence, for screen readers.
/** @param {RunState} run @param {Units} units */
export function describeMap(run, units) {
  const { objects, pose } = run.state;
  const named = objects
    .filter((object) => !isWall(object))
    .slice(0, 12)
    .map((object) => `${object.model} at ${units.place(object.x, object.y, 1)}`)
    .join("; ");
  const robot = `Robot at ${units.place(pose[0], pose[1], 1)}, heading ${degrees(pose[2])}`;
  return `${robot}. Objects: ${countObjects(objects)}${named ? `; ${named}` : ""}. ${run.segments.size} segments.`;
}

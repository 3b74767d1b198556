// The object list and the selected object: pose, uncertainty, evidence for and against. Screen readers read it in place
// of the map.

import { byId, el, setAttribute, setText } from "./dom.js";
import { certainty, ellipseOf } from "./draw_objects.js";
import { degrees, percent, times } from "./units.js";
import { countObjects, isWall } from "./walls.js";

const EVIDENCE_EVERY_MS = 1000;

export class Objects {
  #list = byId("objects");
  #rows = new Map();
  #asked_ms = -Infinity;
  #asking = false;
  // the object whose evidence was refused: an answer that would not change, and a warning in the log each time
  #refused = null;

  constructor({ run, units, selection, connection, notifications, tools }) {
    Object.assign(this, { run, units, selection, connection, notifications });
    run.on("state", () => this.refresh());
    run.on("evidence", () => this.#refreshEvidence());
    units.on("changed", () => this.refresh());
    selection.on("object", () => this.#onSelected());
    this.#list.addEventListener("keydown", (event) => this.#key(event));
    const act = (type, done) => () => {
      const { object } = selection;
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
      if (!this.#rows.has(key)) this.#rows.set(key, this.#row(object.number));
      const row = this.#rows.get(key);
      setText(row.number, object.number === null || object.number === undefined ? "–" : `${object.number}`);
      setText(row.name, object.model);
      setText(row.sure, certainty(object));
      const [x1, y1, x2, y2] = object.ends ?? [];
      setText(
        row.where,
        object.ends
          ? `${this.units.number(x1)}, ${this.units.number(y1)} to ${this.units.place(x2, y2)}`
          : `${this.units.place(object.x, object.y)}, ${degrees(object.theta)}`,
      );
      setText(
        row.off,
        object.ends ? `${this.units.length(Math.hypot(x2 - x1, y2 - y1))} long` : this.units.spread(object.sigma),
      );
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
        onclick: () => number !== null && number !== undefined && this.selection.pick(number),
      },
      ...Object.values(parts),
    );
    return { element, ...parts };
  }

  #key(event) {
    const numbers = this.run.state.objects.map(({ number }) => number).filter((number) => number !== null);
    const at = numbers.indexOf(this.selection.object);
    const to = { ArrowDown: at + 1, ArrowUp: at < 0 ? numbers.length - 1 : at - 1, Home: 0, End: numbers.length - 1 }[
      event.key
    ];
    if (event.key === "Escape") this.selection.pick(null);
    if (to === undefined || numbers.length === 0) return;
    event.preventDefault();
    this.selection.pick(numbers[Math.max(0, Math.min(to, numbers.length - 1))]);
  }

  #onSelected() {
    this.run.evidence = this.#refused = null;
    this.#asked_ms = -Infinity;
    const picked = this.selection.object === null ? null : this.run.object(this.selection.object);
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
      byId(`object-${object}`)?.scrollIntoView({ block: "nearest" });
    }
  }

  #refreshSelected() {
    const object = this.selection.object === null ? null : this.run.object(this.selection.object);
    byId("object").hidden = this.selection.object === null;
    if (this.selection.object === null) return;
    if (object === null) {
      setText(byId("object-name"), `Object ${this.selection.object} no longer exists`);
      byId("object-facts").replaceChildren();
      return;
    }
    setText(byId("object-name"), `${object.number} ${object.model}`);
    const [x1, y1, x2, y2] = object.ends ?? [];
    const chance =
      object.probability === null || object.probability === undefined
        ? `fit ${percent(object.score)}`
        : `probability ${percent(object.probability)}`;
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
      [
        "place",
        isWall(object)
          ? `${this.units.number(x1)}, ${this.units.number(y1)} to ${this.units.place(x2, y2)}`
          : this.units.place(object.x, object.y, 3),
      ],
      ["turned by", degrees(object.theta)],
      isWall(object)
        ? ["length", this.units.length(Math.hypot(x2 - x1, y2 - y1))]
        : ["uncertainty", this.units.spread(object.sigma)],
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
    for (const id of ["object-confirm", "object-move"]) byId(id).hidden = isWall(object);
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
    const picked = object === null ? null : this.run.object(object);
    if (
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
        (data) => {
          if (data?.readings) this.showEvidence({ object, ...data });
        },
        (error) => {
          if (error.answered) this.#refused = object;
          this.#showEvidenceError(error);
        },
      )
      .finally(() => {
        this.#asking = false;
      });
  }

  // Evidence arrives as an answer, or as a message of its own.
  showEvidence(message) {
    const readings = message.readings.map(([x, y, range, angle, nats, ...listener]) => ({
      x,
      y,
      range,
      angle,
      nats,
      listener,
    }));
    const lines = (message.lines ?? []).map(([number, x1, y1, x2, y2, supports]) => ({
      number,
      x1,
      y1,
      x2,
      y2,
      supports,
    }));
    this.run.evidence = {
      object: message.object,
      pro: message.for,
      contra: message.against,
      readings,
      lines,
      rivals: message.rivals ?? [],
    };
    this.run.emit("evidence");
  }

  #showEvidenceError(error) {
    byId("evidence").replaceChildren(el("p", { class: "hint" }, error.message));
  }

  #refreshEvidence() {
    const { evidence } = this.run;
    if (evidence === null || evidence.object !== this.selection.object) return;
    const most = Math.max(evidence.pro, evidence.contra, 1e-9);
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
          `${readings.length + lines.length} ${lines.length > 0 ? "segments" : "readings"} on the map, ${against} of them against (dashed, ✕)`,
        ),
        others === "" ? null : el("p", { class: "hint" }, `Other explanations: ${others}`),
      ].filter((part) => part !== null),
    );
  }
}

// Describes the map in a sentence, for screen readers.
export function describeMap(run, units) {
  const { objects, pose } = run.state;
  const named = objects
    .filter((object) => !isWall(object))
    .slice(0, 12)
    .map((object) => `${object.model} at ${units.place(object.x, object.y, 1)}`)
    .join("; ");
  return `Robot at ${units.place(pose[0], pose[1], 1)}, heading ${degrees(pose[2])}. Objects: ${countObjects(objects)}${named ? `; ${named}` : ""}. ${run.segments.size} segments.`;
}

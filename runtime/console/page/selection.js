// @ts-check
// What is selected: segments, and the one object that is picked.

import { Emitter } from "./emitter.js";

/** @extends {Emitter<{ segments: []; object: [number | null] }>} */
export class Selection extends Emitter {
  /** @type {Set<number>} */
  segments = new Set();
  /** @type {number | null} */
  object = null;

  /** @param {RunState} run */
  constructor(run) {
    super();
    run.on("state", () => this.#dropDeleted(run));
  }

  /** @param {Iterable<number>} numbers */
  choose(numbers) {
    this.segments = new Set(numbers);
    this.emit("segments");
  }

  /** @param {number} number */
  toggle(number) {
    if (!this.segments.delete(number)) this.segments.add(number);
    this.emit("segments");
  }

  /** @param {Iterable<number>} numbers */
  add(numbers) {
    for (const number of numbers) this.segments.add(number);
    this.emit("segments");
  }

  /** @param {number | null} number */
  pick(number) {
    if (this.object === number) return;
    this.object = number;
    this.emit("object", number);
  }

  /** @param {RunState} run */
  #dropDeleted(run) {
    const gone = [...this.segments].filter((number) => !run.segments.has(number));
    for (const number of gone) this.segments.delete(number);
    if (gone.length > 0) this.emit("segments");
  }
}

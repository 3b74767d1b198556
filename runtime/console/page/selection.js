// What is selected: segments, and the one object that is picked.

import { Emitter } from "./emitter.js";

export class Selection extends Emitter {
  segments = new Set();
  object = null;

  constructor(run) {
    super();
    run.on("state", () => this.#dropDeleted(run));
  }

  choose(numbers) {
    this.segments = new Set(numbers);
    this.emit("segments");
  }

  toggle(number) {
    if (!this.segments.delete(number)) this.segments.add(number);
    this.emit("segments");
  }

  add(numbers) {
    for (const number of numbers) this.segments.add(number);
    this.emit("segments");
  }

  pick(number) {
    if (this.object === number) return;
    this.object = number;
    this.emit("object", number);
  }

  #dropDeleted(run) {
    const gone = [...this.segments].filter((number) => !run.segments.has(number));
    for (const number of gone) this.segments.delete(number);
    if (gone.length > 0) this.emit("segments");
  }
}

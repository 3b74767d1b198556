// @ts-check
// A minimal event emitter: `Events` says what is emitted with each name.

/** @template {Record<keyof Events, unknown[]>} Events */
export class Emitter {
  /** @type {{ [K in keyof Events]?: Array<(...update: Events[K]) => unknown> }} */
  #listeners = {};

  /** @template {keyof Events} K @param {K} name @param {(...update: Events[K]) => unknown} listener */
  on(name, listener) {
    const known = this.#listeners[name];
    if (known === undefined) this.#listeners[name] = [listener];
    else known.push(listener);
  }

  /** @template {keyof Events} K @param {K} name @param {Events[K]} update */
  emit(name, ...update) {
    for (const listener of this.#listeners[name] ?? []) listener(...update);
  }
}

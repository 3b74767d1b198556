// A minimal event emitter.

export class Emitter {
  #listeners = new Map();

  on(name, listener) {
    if (!this.#listeners.has(name)) this.#listeners.set(name, []);
    this.#listeners.get(name).push(listener);
  }

  emit(name, ...update) {
    for (const listener of this.#listeners.get(name) ?? []) listener(...update);
  }
}

// Who has news tells it by name, and knows nothing of who listens.

export class Emitter {
  #listeners = new Map();

  on(name, listener) {
    if (!this.#listeners.has(name)) this.#listeners.set(name, []);
    this.#listeners.get(name).push(listener);
  }

  emit(name, ...news) {
    for (const listener of this.#listeners.get(name) ?? []) listener(...news);
  }
}

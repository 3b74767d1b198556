// @ts-check
// Preferences of this browser: units, layers. Silently not kept where the browser has no storage.

const KEY = "echolocate";

/** @returns {Record<string, unknown>} */
function read() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return typeof kept === "object" && kept !== null ? kept : {};
  } catch {
    return {};
  }
}

/** @template T @param {string} name @param {T} otherwise @returns {T} */
export function preferred(name, otherwise) {
  const kept = read()[name];
  const isAlike = typeof kept === typeof otherwise && Array.isArray(kept) === Array.isArray(otherwise);
  return isAlike ? /** @type {T} */ (kept) : otherwise;
}

/** @param {string} name @param {unknown} value */
export function prefer(name, value) {
  try {
    localStorage.setItem(KEY, JSON.stringify({ ...read(), [name]: value }));
  } catch {
    // A private window may refuse; the page works all the same.
  }
}

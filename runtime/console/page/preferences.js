// Preferences of this browser: units, layers. Silently not kept where the browser has no storage.

const KEY = "echolocate";

function read() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return typeof kept === "object" && kept !== null ? kept : {};
  } catch {
    return {};
  }
}

export function preferred(name, otherwise) {
  const kept = read()[name];
  return typeof kept === typeof otherwise ? kept : otherwise;
}

export function prefer(name, value) {
  try {
    localStorage.setItem(KEY, JSON.stringify({ ...read(), [name]: value }));
  } catch {
    // A private window may refuse; the page works all the same.
  }
}

// @ts-check
// Helpers that build elements. Text is always inserted as text, so that no string from a robot or a recording becomes
// markup.

const SVG = "http://www.w3.org/2000/svg";

/** The element of an id that the page has. @template {string} K @param {K} id @returns {ElementOf<K>} */
export function byId(id) {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no element #${id}`);
  return /** @type {ElementOf<K>} */ (found);
}

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Properties} properties
 * @param {Content[]} children
 */
export function el(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function")
      element.addEventListener(name.slice(2), /** @type {EventListener} */ (/** @type {unknown} */ (value)));
    else if (name === "class") element.className = String(value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

// A button that acts; its content is text, elements, or several of them.
/** @param {Content | Content[]} content @param {Properties["onclick"]} act @param {Properties} more */
export const button = (content, act, more = {}) =>
  el("button", { type: "button", onclick: act, ...more }, ...[content].flat());

/** @param {string} name */
export const icon = (name) => svg("svg", { class: "icon", "aria-hidden": "true" }, svg("use", { href: `#${name}` }));

/**
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string | number>} attributes
 * @param {Node[]} children
 */
export function svg(tag, attributes, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  element.append(...children);
  return element;
}

// Writing the same text again would make the browser lay the page out again, twenty times a second.
/** @param {Node} element @param {string} text */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** @param {Element} element @param {string} name @param {string | number | boolean} value */
export function setAttribute(element, name, value) {
  const text = String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

// The events by which a pointer that is held down ends.
export const PRESS_ENDS = /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"]);

// What a table says of the key that was pressed.
/** @template T @param {KeyboardEvent} event @param {Record<string, T>} table @returns {T | undefined} */
export const byKey = (event, table) => table[event.key];

// Switches buttons and fields off or on.
/** @param {Iterable<Element>} elements @param {boolean} off */
export function disable(elements, off) {
  for (const element of elements) if ("disabled" in element) element.disabled = off;
}

/** @param {string} name @param {Blob} blob */
export function download(name, blob) {
  const address = URL.createObjectURL(blob);
  const link = el("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** @param {EventTarget | null} element */
export function writesText(element) {
  if (!(element instanceof HTMLElement)) return false;
  if (element instanceof HTMLTextAreaElement || element.isContentEditable) return true;
  return (
    element instanceof HTMLInputElement && !["checkbox", "range", "file", "button", "radio"].includes(element.type)
  );
}

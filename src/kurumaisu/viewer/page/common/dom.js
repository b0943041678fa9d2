// SPDX-License-Identifier: BSD-3-Clause
// Elements and numbers. Text reaches the page through textContent only: names come from files.

export const byId = (id) => document.getElementById(id);

/** Return a new element: properties as of the DOM, `data` as data-attributes, `aria` as aria-attributes. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  const {data = {}, aria = {}, role, ...rest} = properties;
  Object.assign(element, rest);
  Object.assign(element.dataset, data);
  for (const [name, value] of Object.entries(aria)) element.setAttribute(`aria-${name}`, value);
  if (role) element.setAttribute("role", role);
  element.append(...children);
  return element;
}

/** Write only what changed: an unchanged text costs no layout, and a screen reader stays quiet. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setPressed(button, on) {
  button.setAttribute("aria-pressed", String(Boolean(on)));
}

export function fixed(value, digits, unit = "") {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits).replace("-", "−");
  return unit ? `${text} ${unit}` : text;
}

/** Return a number with three digits that count, for labels. */
export function short(value) {
  return String(Number(Number(value).toPrecision(3))).replace("-", "−");
}

export const degrees = (radians) => (radians * 180) / Math.PI;
export const radians = (angle) => (angle * Math.PI) / 180;

/** A list of listeners for each kind of news. */
export class News {
  #listeners = new Map();

  on(kinds, listener) {
    for (const kind of kinds.split(" ")) {
      if (!this.#listeners.has(kind)) this.#listeners.set(kind, []);
      this.#listeners.get(kind).push(listener);
    }
  }

  tell(kind, what) {
    for (const listener of this.#listeners.get(kind) ?? []) listener(what);
  }
}

/**
 * Return a function that sends the newest of its arguments, one at a time: over a slow line what was overtaken is
 * never sent. `send` returns a promise; `done` gets its value when nothing newer waits.
 */
export function newest(send, done = () => {}) {
  let waiting = null;
  let busy = false;
  async function run() {
    busy = true;
    let answer;
    while (waiting) {
      const argument = waiting;
      waiting = null;
      answer = await send(...argument);
    }
    busy = false;
    done(answer);
  }
  return (...argument) => {
    waiting = argument;
    if (!busy) run();
  };
}

// SPDX-License-Identifier: BSD-3-Clause
// A number as a slider and a field. Bounds are far apart and what matters is near zero, so the slider is finer there.

import {make, short} from "../common/dom.js";

const STEPS = 1000;
const BEND = 3; // power of the slider's law

/** Return the functions between a value and a slider's place, 0 to STEPS, for bounds that are finite. */
export function law(min, max) {
  const root = (value) => Math.sign(value) * Math.abs(value) ** (1 / BEND);
  const middle = Math.min(Math.max(0, min), max); // where the slider is finest
  const [low, high] = [root(min - middle), root(max - middle)];
  return {
    place: (value) => (STEPS * (root(value - middle) - low)) / (high - low || 1),
    value: (place) => {
      const offset = (low + ((high - low) * place) / STEPS) ** BEND;
      const quiet = Math.abs(offset) < 1e-9 * (max - min) ? 0 : Number(offset.toPrecision(3));
      const value = Number((middle + quiet).toPrecision(9));
      return Math.min(max, Math.max(min, value));
    },
  };
}

/** Return {row, show(value), value()}; changed() when the user has moved it, `whose`: for those who hear it only. */
export function slider({name, description, unit, min, max, value}, whose, changed) {
  const label = unit && unit !== "1" ? `${name} [${unit}]` : name;
  const {place, value: valueAt} = law(min, max);
  const range = make("input", {type: "range", min: 0, max: STEPS, step: "any", aria: {label: `${whose}, ${label}`}});
  const number = make("input", {type: "number", min, max, step: "any", aria: {label: `${whose}, ${label}, as a number`}});
  let now = value;
  const show = (next) => {
    now = next;
    range.value = place(next);
    range.setAttribute("aria-valuetext", `${short(next)} ${unit ?? ""}`);
    if (document.activeElement !== number) number.value = Number(next.toPrecision(6));
  };
  const take = (next) => {
    show(next);
    changed();
  };
  range.addEventListener("input", () => take(valueAt(Number(range.value))));
  number.addEventListener("change", () => {
    const typed = number.valueAsNumber;
    if (Number.isFinite(typed)) take(Math.min(max, Math.max(min, typed)));
    number.value = Number(now.toPrecision(6));
  });
  show(value);
  const bounds = `${short(min)} to ${short(max)}`;
  const row = make("div", {className: "slider", title: description ? `${description}; ${bounds}` : bounds},
    make("span", {className: "slider-name", textContent: label}), range, number);
  return {row, show, value: () => now, controls: [range, number], busy: () => [range, number].includes(document.activeElement)};
}

// SPDX-License-Identifier: BSD-3-Clause
// A tab with curves of any number on the page, against the time of the source.

import {byId, make, setText, short} from "../common/dom.js";
import {download} from "../common/download.js";
import {drawCurves, styleOf} from "./curves.js";
import {numbers} from "./numbers.js";
import {Series} from "./series.js";

const MOST = 6; // curves
const NOTHING = 1e-9; // a number so small is rounding
const PERIOD = 100; // [ms] between pictures
const FIRST = ["v", "commanded.0"]; // what is shown until somebody chooses

export class Plot {
  #chosen = []; // {key, label, unit, value, series, style, read}
  #touched = false;
  #listed = "";
  #drawn = 0;

  constructor(scene, picture) {
    Object.assign(this, {scene, picture});
    byId("plot-add").addEventListener("change", ({target}) => this.#choose(target.value));
    byId("plot-length").addEventListener("change", () => this.#draw());
    byId("plot-clear").addEventListener("click", () => this.#chosen.forEach(({series}) => series.clear()));
    byId("plot-save").addEventListener("click", () => this.#save());
    byId("tab-plot").addEventListener("click", () => this.#list());
    scene.on("state", (state) => state && this.#take(state));
    new ResizeObserver(() => this.#draw()).observe(byId("plot"));
  }

  #take(state) {
    if (!this.#touched && !this.#chosen.length) this.#begin();
    for (const {series, value} of this.#chosen) series.add(state.t, value(this.scene));
    if (byId("panel-plot").hidden || (performance.now() - this.#drawn < PERIOD && !state.paused)) return;
    this.#list();
    this.#draw();
  }

  #begin() {
    const known = numbers(this.scene);
    for (const key of FIRST) if (known.has(key)) this.#add(key, known.get(key));
  }

  #choose(key) {
    byId("plot-add").value = "";
    const known = numbers(this.scene).get(key);
    if (!known || this.#chosen.some((one) => one.key === key) || this.#chosen.length >= MOST) return;
    this.#touched = true;
    this.#add(key, known);
  }

  #add(key, known) {
    const place = [...Array(MOST).keys()].find((i) => !this.#chosen.some((one) => one.place === i));
    const read = make("output");
    const remove = make("button", {type: "button", textContent: "✕", title: `Remove ${known.label}`, aria: {label: `Remove ${known.label}`}});
    const swatch = make("canvas", {width: 28, height: 10, aria: {hidden: true}});
    const row = make("li", {}, swatch, make("span", {textContent: known.label}), read, remove);
    const one = {key, place, ...known, series: new Series(), read, swatch, row};
    remove.addEventListener("click", () => {
      this.#touched = true;
      this.#chosen = this.#chosen.filter((other) => other !== one);
      row.remove();
      this.#list();
      this.#draw();
    });
    this.#chosen.push(one);
    byId("plot-list").append(row);
    this.#list();
  }

  /** Offer what there is now and is not shown yet. */
  #list() {
    const known = [...numbers(this.scene)].filter(([key]) => !this.#chosen.some((one) => one.key === key));
    const listed = JSON.stringify(known.map(([key, {label}]) => [key, label]));
    const select = byId("plot-add");
    select.disabled = this.#chosen.length >= MOST;
    if (listed === this.#listed || document.activeElement === select) return;
    this.#listed = listed;
    known.sort(([, one], [, two]) => one.label.localeCompare(two.label));
    const entries = known.map(([key, {label, unit}]) => make("option", {value: key, textContent: unit ? `${label} [${unit}]` : label}));
    select.replaceChildren(make("option", {value: "", textContent: "Add a curve"}), ...entries);
  }

  #draw() {
    const canvas = byId("plot");
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !this.scene.state) return;
    this.#drawn = performance.now();
    const ratio = devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const {colors} = this.picture;
    const curves = this.#chosen.map(({series, unit, place}) => ({series, unit, style: styleOf(place, colors)}));
    drawCurves(context, width, height, curves, this.scene.state.t, Number(byId("plot-length").value), colors);
    for (const one of this.#chosen) this.#showValue(one, styleOf(one.place, colors));
  }

  #showValue({series, unit, read, swatch}, {color, dash}) {
    const value = series.values.at(-1);
    setText(read, Number.isFinite(value) ? `${short(Math.abs(value) < NOTHING ? 0 : value)} ${unit}` : "–");
    const context = swatch.getContext("2d");
    context.clearRect(0, 0, 28, 10);
    context.setLineDash(dash);
    Object.assign(context, {strokeStyle: color, lineWidth: 2});
    context.beginPath();
    context.moveTo(0, 5);
    context.lineTo(28, 5);
    context.stroke();
  }

  /** The curves as a table: a row for each time that any of them has. */
  #save() {
    const rows = new Map();
    this.#chosen.forEach(({series}, i) => series.times.forEach((t, j) => {
      if (!rows.has(t)) rows.set(t, Array(this.#chosen.length).fill(""));
      if (Number.isFinite(series.values[j])) rows.get(t)[i] = series.values[j];
    }));
    const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    const head = ["t [s]", ...this.#chosen.map(({label, unit}) => (unit ? `${label} [${unit}]` : label))].map(quoted);
    const lines = [...rows].sort(([one], [two]) => one - two).map(([t, values]) => [t, ...values].join(","));
    download(new Blob([[head.join(","), ...lines, ""].join("\n")], {type: "text/csv"}), "curves.csv");
  }
}

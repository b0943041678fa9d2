// SPDX-License-Identifier: BSD-3-Clause
// What the pictures of the critic's report hold: samples with their run, time and place, and where they are drawn.

const MISFIT = "kind";
const PATH = "path";

/** Return the rows of a table as arrays of texts. */
export function rowsOf(text) {
  const rows = [[]];
  const cell = /(?:"((?:[^"]|"")*)"|([^",\n]*))(,|\n|$)/gy;
  for (let found; cell.lastIndex < text.length && (found = cell.exec(text)); ) {
    rows.at(-1).push(found[1] === undefined ? found[2] : found[1].replaceAll('""', '"'));
    if (found[3] === "\n") rows.push([]);
  }
  return rows.filter((row) => row.length);
}

function textOf(link) {
  const packed = link.getAttribute("href").split(",", 2)[1];
  return new TextDecoder().decode(Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0)));
}

/** Return run, t, x, y of a row; null where it is of no single moment. */
function moment(row, columns) {
  const text = (name) => row[columns.indexOf(name)];
  const t = Number.parseFloat(text("t [s]"));
  if (!Number.isFinite(t)) return null;
  return {run: text("run"), t, x: Number.parseFloat(text("x [m]")), y: Number.parseFloat(text("y [m]"))};
}

/**
 * Return the pictures whose samples have moments: {title, svg, unit, samples}. A sample has run, t, x, y, its value in
 * that unit (null for a place of a path), and left, top: where it lies in the picture's own coordinates.
 */
export function pictures(page) {
  const found = [];
  for (const figure of page.querySelectorAll("figure")) {
    const svg = figure.querySelector("svg[data-at]");
    const link = figure.querySelector('a[download][href^="data:text/csv"]');
    if (!svg || !link) continue;
    const [columns, ...rows] = rowsOf(textOf(link));
    const [a, b, c, d] = svg.dataset.at.split(" ").map(Number);
    const isMisfit = columns[0] === MISFIT;
    if (!isMisfit && columns[0] !== PATH) continue;
    const [across, up] = isMisfit ? [1, 2] : [2, 3];
    const samples = rows.flatMap((row) => {
      const when = moment(row, columns);
      if (!when) return [];
      const [x, y] = [Number(row[across]), Number(row[up])];
      return [{...when, value: isMisfit ? y : null, left: a + b * x, top: c + d * y}];
    });
    const unit = isMisfit ? columns[2].slice(columns[2].indexOf("[") + 1, -1) : "";
    if (samples.length) found.push({title: figure.querySelector("h3").textContent, figure, svg, unit, samples});
  }
  return found;
}

/** Return the samples that are furthest off, the furthest first. */
export function largest(samples, count) {
  return samples
    .filter(({value}) => Number.isFinite(value))
    .sort((one, other) => Math.abs(other.value) - Math.abs(one.value))
    .slice(0, count);
}

/** Return the address's end that leads to a moment and its place. */
export function fragment({run, t, x, y}) {
  const values = new URLSearchParams({run, t: t.toFixed(3)});
  if (Number.isFinite(x) && Number.isFinite(y)) {
    values.set("x", x.toFixed(3));
    values.set("y", y.toFixed(3));
  }
  return `#${values}`;
}

/** Say a value with its unit, small ones in thousandths, angles in degrees. */
export function quantity(value, unit) {
  if (value === null) return "";
  let [number, said] = [value, unit];
  if (unit.startsWith("rad")) [number, said] = [(value * 180) / Math.PI, unit.replace("rad", "°")];
  else if (unit.startsWith("m") && Math.abs(value) < 0.1) [number, said] = [1000 * value, `m${unit}`];
  const text = String(Number(number.toPrecision(3))).replace("-", "−");
  return `${number > 0 ? "+" : ""}${text} ${said}`.trim();
}

/** Say when and where. */
export function momentText({run, t, x, y}) {
  const metres = (value) => (Math.round(100 * value) / 100 + 0).toFixed(2).replace("-", "−"); // + 0: none is minus nothing
  const place = Number.isFinite(x) && Number.isFinite(y) ? `, at ${metres(x)}, ${metres(y)} m` : "";
  return `${run}, t = ${t.toFixed(2)} s${place}`;
}

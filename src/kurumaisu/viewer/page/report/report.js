// SPDX-License-Identifier: BSD-3-Clause
// In the critic's report, where the viewer serves it: a point leads to its moment and place.

import {ask} from "../common/channel.js";
import {fragment, largest, pictures, quantity, momentText} from "./data.js";

const VIEWER = "kurumaisu-viewer"; // the window that the viewer is in
const NEAR = 12; // of the picture's own coordinates: points are found from so far
const LISTED = 10;
const SVG = "http://www.w3.org/2000/svg";

const address = (sample) => new URL(`../${fragment(sample)}`, location.href).href;

const news = document.createElement("p");

/** The viewer that led here is brought to the front. Opened in another way, this page has to ask which one there is. */
async function show(sample) {
  if (!window.opener || window.opener.closed) {
    const {gone, why} = await ask(fragment(sample));
    if (gone) return say(`${momentText(sample)}: shown in the viewer's tab.`);
    if (why) return say(`The viewer's tab cannot show it. ${why}`);
  }
  // an empty target would take this page away
  window.open(address(sample), VIEWER)?.focus();
}

function say(text) {
  news.textContent = text;
}

function setUpNews() {
  news.setAttribute("role", "status");
  news.style.cssText = "position: sticky; bottom: 0; margin: 0; padding: 0.5em; background: Canvas; color: CanvasText";
  document.body.append(news);
}

function ringIn(svg) {
  const ring = document.createElementNS(SVG, "circle");
  for (const [name, value] of Object.entries({r: 7, fill: "none", stroke: "currentColor", "stroke-width": 2, visibility: "hidden"})) {
    ring.setAttribute(name, value);
  }
  svg.append(ring);
  return ring;
}

/** Return the sample next to a place on the screen, null where none is near. */
function nearest({svg, samples}, {clientX, clientY}) {
  const {x, y} = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
  let [best, least] = [null, NEAR];
  for (const sample of samples) {
    const distance = Math.hypot(sample.left - x, sample.top - y);
    if (distance < least) [best, least] = [sample, distance];
  }
  return best;
}

function lead(picture) {
  const {svg, unit, figure} = picture;
  const ring = ringIn(svg);
  const said = document.createElement("p");
  said.className = "hint";
  const hint = "Click a point to see it in the viewer.";
  said.textContent = hint;
  svg.parentElement.after(said);
  const point = (event) => {
    const sample = nearest(picture, event);
    ring.setAttribute("visibility", sample ? "visible" : "hidden");
    svg.style.cursor = sample ? "pointer" : "";
    if (sample) {
      ring.setAttribute("cx", sample.left);
      ring.setAttribute("cy", sample.top);
    }
    said.textContent = sample ? `${quantity(sample.value, unit)} ${momentText(sample)}`.trim() : hint;
    return sample;
  };
  // what is ringed is what a click means: a click's own place is rounded to whole pixels
  let ringed = null;
  svg.addEventListener("pointermove", (event) => (ringed = point(event)));
  svg.addEventListener("pointerdown", (event) => event.pointerType !== "mouse" && (ringed = point(event)));
  svg.addEventListener("pointerleave", () => ring.setAttribute("visibility", "hidden"));
  svg.addEventListener("click", () => ringed && show(ringed));
  const worst = largest(picture.samples, LISTED);
  if (worst.length) figure.append(list(worst, unit));
}

/** For keys and screen readers, and for who asks where it is worst. */
function list(samples, unit) {
  const details = document.createElement("details");
  const summary = document.createElement("summary");
  summary.textContent = `The ${samples.length} largest misfits, in the viewer`;
  const items = samples.map((sample) => {
    const link = document.createElement("a");
    Object.assign(link, {href: address(sample), target: VIEWER, textContent: `${quantity(sample.value, unit)} ${momentText(sample)}`});
    link.addEventListener("click", (event) => {
      event.preventDefault();
      show(sample);
    });
    const item = document.createElement("li");
    item.append(link);
    return item;
  });
  const ordered = document.createElement("ol");
  ordered.append(...items);
  details.append(summary, ordered);
  return details;
}

window.name ||= "kurumaisu-report";
for (const hint of document.querySelectorAll(".unserved")) hint.hidden = true;
for (const picture of pictures(document)) lead(picture);
setUpNews();

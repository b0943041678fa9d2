// SPDX-License-Identifier: BSD-3-Clause
// Colours of the canvas. Names: the palette of Okabe and Ito. Numbers: blue to orange of the same palette for a sign,
// cividis for a size. All can be told apart with the usual kinds of colour blindness.

const TOKENS = [
  "paper", "ink", "soft", "faint", "strong-faint", "accent", "truth", "odom", "estimate", "mark", "scan", "free",
];
export const BUCKETS = 24; // steps of a colour scale

// The inner two thirds read on white and on near-black alike.
const SHORT = {light: [0, 82, 155], dark: [86, 180, 233]};
const LONG = {light: [196, 78, 0], dark: [255, 150, 40]};
const NONE = {light: [150, 154, 160], dark: [150, 154, 160]};
const CIVIDIS = [
  [0, 34, 78], [31, 60, 110], [66, 77, 108], [92, 95, 110], [116, 114, 117], [143, 134, 118], [171, 155, 110],
  [201, 178, 96], [232, 204, 72], [254, 232, 56],
];
const PART = {light: [0, 0.75], dark: [0.3, 1]}; // of cividis: its end would vanish on the ground

function mix(a, b, share) {
  return `rgb(${a.map((value, i) => Math.round(value + (b[i] - value) * share)).join(" ")})`;
}

function along(stops, share) {
  const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(place), stops.length - 2);
  return mix(stops[i], stops[i + 1], place - i);
}

/** Resolve the style sheet's colours for the theme that is on: {paper, ink, ..., error[], intensity[]}. */
export function readColors() {
  const probe = document.createElement("span");
  document.body.append(probe);
  const colors = {};
  for (const token of TOKENS) {
    probe.style.color = `var(--${token})`;
    colors[token] = getComputedStyle(probe).color;
  }
  probe.remove();
  const numbers = colors.paper.match(/[\d.]+/g).map(Number);
  const theme = numbers[0] < 128 ? "dark" : "light";
  const [from, to] = PART[theme];
  const steps = Array.from({length: BUCKETS}, (_, i) => i / (BUCKETS - 1));
  colors.dark = theme === "dark";
  colors.error = steps.map((share) => along([SHORT[theme], NONE[theme], LONG[theme]], share));
  colors.intensity = steps.map((share) => along(CIVIDIS, from + (to - from) * share));
  return colors;
}

/** Return the bucket of a value between low and high. */
export function bucket(value, low, high) {
  const share = (value - low) / (high - low || 1);
  return Math.min(BUCKETS - 1, Math.max(0, Math.round(share * (BUCKETS - 1))));
}

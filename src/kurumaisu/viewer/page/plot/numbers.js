// SPDX-License-Identifier: BSD-3-Clause
// Every number that the page hears of, by name and unit, and how to read it.

import {degrees} from "../common/dom.js";

const HIDDEN = ["t", "wall", "seed", "playback"]; // no curves: the axis, and what a run is called
const PLACE = [["x", "m"], ["y", "m"], ["yaw", "°"]];

const apart = (one, two) => (one && two ? Math.hypot(one[0] - two[0], one[1] - two[1]) : NaN);
const turned = (one, two) => (one && two ? degrees(Math.atan2(Math.sin(one[2] - two[2]), Math.cos(one[2] - two[2]))) : NaN);

/** What is worked out of a moment: [key, label, unit, value(scene)]. */
const DERIVED = [
  ["error.odom", "odometry error", "m", ({state}) => apart(state.odom, state.truth)],
  ["error.odom.yaw", "odometry heading error", "°", ({state}) => turned(state.odom, state.truth)],
  ["error.estimate", "localization error", "m", ({state}) => apart(state.estimate?.pose, state.truth)],
  ["error.estimate.yaw", "localization heading error", "°", ({state}) => turned(state.estimate?.pose, state.truth)],
  ["scan.error", "range error, RMS", "m", (scene) => root(of(scene, "errors"))],
  ["scan.nearest", "nearest range", "m", (scene) => of(scene, "ranges").reduce((least, r) => (r < least ? r : least), Infinity)],
];

/** Names and units of what a state says, where they are not plain. */
const KNOWN = {
  v: ["v", "m/s"], w: ["ω", "rad/s"], "commanded.0": ["commanded v", "m/s"], "commanded.1": ["commanded ω", "rad/s"],
  "volts.0": ["volts, forward", "V"], "volts.1": ["volts, steering", "V"], rtf: ["real-time factor", "×"], speed: ["wanted speed", "×"],
};
const POSES = {truth: "truth", odom: "odometry", "estimate.pose": "localization", "goal.pose": "goal"};

/** Numbers of the newest scan of the chair, or of whoever has one. */
function of(scene, name) {
  const chair = scene.world.bodies.indexOf(scene.chair);
  const scan = scene.scans.get(`${chair} 0`) ?? scene.scans.values().next().value;
  return scan?.[name] ?? [];
}

function root(values) {
  const good = [...values].filter(Number.isFinite);
  return good.length ? Math.hypot(...good) / Math.sqrt(good.length) : NaN;
}

/** Return a Map of key to {label, unit, value(scene)} of all that there is now. */
export function numbers(scene) {
  const found = new Map();
  if (!scene.state) return found;
  walk(scene.state, "", (path) => {
    const [label, unit, factor] = named(path, scene);
    found.set(path, {label, unit, value: ({state}) => factor(read(state, path))});
  });
  for (const [key, label, unit, value] of DERIVED) {
    if (Number.isFinite(value(scene))) found.set(key, {label, unit, value});
  }
  return found;
}

function walk(value, path, take) {
  if (typeof value === "number") return take(path);
  if (value === null || typeof value !== "object") return undefined;
  for (const [name, inner] of Object.entries(value)) {
    if (path || !HIDDEN.includes(name)) walk(inner, path ? `${path}.${name}` : name, take);
  }
  return undefined;
}

function read(state, path) {
  let value = state;
  for (const name of path.split(".")) value = value?.[name];
  return typeof value === "number" ? value : NaN;
}

const plain = (value) => value;

/** Return the label and unit of a path, and what makes its number one of that unit. */
function named(path, scene) {
  if (KNOWN[path]) return [...KNOWN[path], plain];
  const parts = path.split(".");
  const place = PLACE[Number(parts.at(-1))];
  const owner = parts.slice(0, -1).join(".");
  const whose = POSES[owner] ?? (parts[0] === "poses" ? scene.body(parts[1])?.name : undefined);
  if (whose && place) return [`${whose} ${place[0]}`, place[1], place[1] === "°" ? degrees : plain];
  if (parts[0] === "contacts") return [`${scene.body(parts[1])?.name ?? parts[1]} contacts`, "", plain];
  return [path, "", plain];
}

// SPDX-License-Identifier: BSD-3-Clause
// What the server has said: world, map, newest state and scans, and the trails that we keep of it.

import {decode} from "../server/decode.js";
import {News} from "../common/dom.js";
import {prepare} from "./shapes.js";
import {Trail} from "./trail.js";

const JUMP = 1.0; // [s] that time must go back to be another run: messages may overtake each other
const BODY = "body "; // in front of its id: the name of its trail
const MARKS = 300; // collision marks, at most
const SEEN = 600; // [ms] that a contact is shown, however short it was

/** News: "hello", "world", "map", "state", "effects", "scan". */
export class Scene extends News {
  hello = null;
  world = {bodies: [], bounds: null};
  state = null;
  map = null;
  effects = [];
  scans = new Map();
  particles = null;
  trails = new Map();
  marks = [];
  #touching = new Set();
  #contacts = null; // how many each body had, as of the last state
  #shown = new Map(); // when each body's last contact began [ms]

  take(message) {
    if (message.type === "hello") this.hello = message;
    else if (message.type === "world") this.#takeWorld(message);
    else if (message.type === "map") this.map = message;
    else if (message.type === "state") this.#takeState(message);
    else if (message.type === "effects") this.effects = message.groups;
    else return; // a newer server says more
    this.tell(message.type, message);
  }

  takeBinary(buffer) {
    const item = decode(buffer);
    if (item?.kind === "scan") this.scans.set(`${item.body} ${item.ranger}`, item);
    else if (item) this.particles = item;
    if (item) this.tell("scan", item);
  }

  /** The body that odometry, truth and estimate are about. */
  get chair() {
    const {bodies, chair} = this.world;
    return bodies.find((body) => body.id === chair) ?? bodies.find((body) => body.kind === "robot") ?? null;
  }

  body(id) {
    return this.world.bodies.find((body) => body.id === id) ?? null;
  }

  /** [x, y, yaw] of a body; what has no pose, as walls, stands where it is drawn. */
  poseOf(body) {
    return this.state?.poses?.[body.id] ?? (body.kind === "wall" ? [0, 0, 0] : null);
  }

  /** Say whether something touches a body, or did a moment ago. */
  touches({id}) {
    return this.#touching.has(id) || performance.now() - this.#shown.get(id) < SEEN;
  }

  /** The bodies that can be driven. */
  get drivable() {
    return this.world.bodies.filter(({drivable}) => drivable);
  }

  forget() {
    this.trails.clear();
    this.marks.length = 0;
    this.tell("state", this.state);
  }

  #takeWorld(message) {
    this.world = {...message, bodies: message.bodies.map(prepare)};
    for (const name of this.trails.keys()) {
      if (name.startsWith(BODY) && !this.body(name.slice(BODY.length))) this.trails.delete(name); // of who has left
    }
    this.scans.clear();
    this.particles = null;
    this.#contacts = null; // counted anew
  }

  #takeState(state) {
    if (this.state && state.t < this.state.t - JUMP) {
      this.trails.clear();
      this.marks.length = 0;
    }
    this.state = state;
    for (const body of this.world.bodies) {
      if (body.kind === "robot" || body.kind === "person") this.#trail(BODY + body.id, state.poses?.[body.id]);
    }
    for (const name of ["truth", "odom"]) this.#trail(name, state[name]);
    this.#trail("estimate", state.estimate?.pose);
    this.#mark(state);
  }

  #trail(name, pose) {
    if (!pose) return;
    if (!this.trails.has(name)) this.trails.set(name, new Trail());
    this.trails.get(name).add(pose);
  }

  /** Keep a mark where a contact began, also one that had ended before it could be seen. */
  #mark(state) {
    const touching = new Set(state.hit ?? []);
    const contacts = state.contacts ?? {};
    const before = this.#contacts ?? contacts;
    const begun = Object.keys(contacts).filter((id) => contacts[id] > (before[id] ?? 0));
    for (const id of new Set([...touching].filter((one) => !this.#touching.has(one)).concat(begun))) {
      const pose = state.poses?.[id];
      if (pose) this.marks.push([pose[0], pose[1]]);
      this.#shown.set(id, performance.now());
    }
    this.#contacts = contacts;
    if (this.marks.length > MARKS) this.marks.splice(0, this.marks.length - MARKS);
    this.#touching = touching;
  }
}

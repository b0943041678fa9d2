// SPDX-License-Identifier: BSD-3-Clause
// The stick on the screen and the keys that do the same.

import {byId, fixed, make, setPressed, setText} from "../common/dom.js";
import {DeadMan} from "./dead_man.js";

const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0], ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowLeft: [0, 1], KeyA: [0, 1], ArrowRight: [0, -1], KeyD: [0, -1],
};
const HARMLESS = ["Shift", "Control", "Alt", "Meta", "Tab"];

export class Stick {
  #down = new Set(); // codes of keys
  #pointer = null;
  emergency = () => {}; // what Space does while the stick is taken, whatever has the focus

  /** options: what is chosen; say(text): tells the driver why the stick was taken away. */
  constructor(connection, scene, options, say) {
    Object.assign(this, {scene, options});
    this.drive = new DeadMan(connection, (reason) => this.#changed(reason, say));
    this.pad = byId("stick");
    this.pad.addEventListener("pointerdown", (event) => this.#take(event));
    this.pad.addEventListener("pointermove", (event) => event.pointerId === this.#pointer && this.#pull(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      this.pad.addEventListener(end, (event) => event.pointerId === this.#pointer && this.#letGo());
    }
    addEventListener("keydown", (event) => this.#key(event), {capture: true});
    addEventListener("keyup", (event) => this.#down.delete(event.code) && this.#byKeys(), {capture: true});
    byId("drive").addEventListener("click", () => this.toggle());
    scene.on("world", () => this.#listRobots());
    options.on("change", () => this.#choose(options.selected));
    byId("drive-body").addEventListener("change", (event) => {
      const robot = this.#robots[event.target.value];
      this.#choose(robot.id);
      options.set({selected: robot.id});
      byId("front").focus({preventScroll: true}); // or the keys would choose another one
    });
    byId("share").addEventListener("input", () => this.#showShare());
  }

  toggle() {
    if (this.drive.armed) return this.drive.disarm();
    if (byId("drive").disabled || byId("drive").hidden) return;
    this.drive.arm();
    if (this.#robots.length > 1) this.options.set({selected: this.drive.body}); // which one, in the picture, too
    byId("front").focus({preventScroll: true}); // or the keys would move a slider
  }

  #robots = [];

  #listRobots() {
    this.#robots = this.scene.drivable;
    const entries = this.#robots.map(({name}, i) => make("option", {value: String(i), textContent: name}));
    byId("drive-body").replaceChildren(...entries);
    byId("drive-who").hidden = this.#robots.length < 2;
    const known = this.#robots.some(({id}) => id === this.drive.body);
    const first = this.#robots.includes(this.scene.chair) ? this.scene.chair : this.#robots[0];
    this.#choose(known ? this.drive.body : (first?.id ?? null));
  }

  /** Drive another robot; the one so far is let go, and who holds a key or the stick must let go, too. */
  #choose(id) {
    const place = this.#robots.findIndex((robot) => robot.id === id);
    if (place < 0 && this.#robots.length) return; // something that nobody drives was chosen
    if (id !== this.drive.body) {
      this.drive.release();
      this.#down.clear();
      this.#pointer = null;
    }
    this.drive.body = this.#robots.length ? id : null;
    byId("drive-body").value = String(place);
  }

  get #share() {
    return Number(byId("share").value) / 100;
  }

  #showShare() {
    const limits = this.scene.hello?.limits;
    const [v, w] = [limits?.v, limits?.w].map((limit) => limit * this.#share);
    setText(byId("share-read"), limits ? `${fixed(v, 2)} m/s, ${fixed(w, 2)} rad/s` : "");
  }

  #take(event) {
    event.preventDefault();
    if (!this.drive.armed || this.#pointer !== null) return;
    this.#pointer = event.pointerId;
    this.pad.setPointerCapture(event.pointerId);
    this.#pull(event);
  }

  #pull(event) {
    const box = this.pad.getBoundingClientRect();
    const reach = box.width / 2;
    let x = (event.clientX - box.left - reach) / reach;
    let y = (event.clientY - box.top - reach) / reach;
    const length = Math.max(Math.hypot(x, y), 1);
    [x, y] = [x / length, y / length];
    this.#show(x, y);
    this.#hold(-y, -x);
  }

  #letGo() {
    this.#pointer = null;
    this.drive.release();
  }

  #key(event) {
    if (!this.drive.armed || event.ctrlKey || event.metaKey || event.altKey) return;
    const writing = event.target.closest?.("input, select, textarea");
    if (event.code in KEYS && !writing) {
      event.preventDefault();
      event.stopImmediatePropagation();
      // a key that was down when the stick was taken must be let go first
      if (event.repeat && !this.#down.has(event.code)) return;
      this.#down.add(event.code);
      this.#byKeys();
    } else if (event.code === "Space" && !writing) {
      event.preventDefault();
      event.stopImmediatePropagation();
      this.emergency();
    } else if (!HARMLESS.includes(event.key) && this.drive.held) {
      this.drive.disarm(); // whatever else is pressed in a fright stops
    }
  }

  #byKeys() {
    if (this.#pointer !== null || !this.drive.armed) return;
    let [v, w] = [0, 0];
    for (const code of this.#down) {
      v += KEYS[code][0];
      w += KEYS[code][1];
    }
    [v, w] = [Math.sign(v), Math.sign(w)];
    if (!this.#down.size) this.drive.release();
    else {
      this.#show(-w, -v);
      this.#hold(v, w);
    }
  }

  /** Shares of the limits, forward and to the left. */
  #hold(v, w) {
    const limits = this.scene.hello?.limits;
    if (!limits) return this.drive.disarm("the speed limits are unknown");
    this.drive.hold(v * limits.v * this.#share, w * limits.w * this.#share);
    const [now, turn] = this.drive.held ?? [0, 0];
    setText(byId("drive-read"), `${fixed(now, 2)} m/s  ${fixed(turn, 2)} rad/s`);
  }

  #show(x, y) {
    const reach = this.pad.clientWidth / 3; // the knob's middle, when its edge is at the rim
    byId("knob").style.transform = `translate(${reach * x}px, ${reach * y}px)`;
  }

  #changed(reason, say) {
    const {armed, held} = this.drive;
    if (!held) {
      this.#show(0, 0);
      setText(byId("drive-read"), "hold to drive");
    }
    if (!armed) {
      this.#down.clear();
      this.#pointer = null;
    }
    this.#showShare();
    byId("stick-box").hidden = !armed;
    this.pad.classList.toggle("held", Boolean(held));
    setPressed(byId("drive"), armed);
    if (reason) say(`Driving was ended: ${reason}.`);
  }
}

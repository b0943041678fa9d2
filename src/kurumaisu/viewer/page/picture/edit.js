// SPDX-License-Identifier: BSD-3-Clause
// Choosing, moving and turning bodies; measuring; telling the localization where the chair is.

import {newest, short} from "../common/dom.js";
import {label} from "./names.js";
import {covers} from "../scene/shapes.js";

const HANDLE = 26; // [px] from a body's edge to the handle that turns it
const GRIP = {mouse: 10, pen: 12, touch: 22}; // [px] radius in which handle and small bodies are hit

export class Edit {
  #ghost = null; // {body, pose} that is asked for
  #arrow = null; // {from, to, kind} of measuring and of an estimate

  /** can(name): may this command be given now? ask(name, values): gives it; resolves with its reply. */
  constructor(picture, scene, options, {can, ask, failed}) {
    Object.assign(this, {picture, scene, options, can, ask});
    this.place = newest(
      (body, [x, y, yaw]) => ask("set_pose", {body, x, y, yaw}),
      (reply) => {
        if (!this.#held) this.#ghost = null;
        if (!reply.ok) failed(reply.message);
        picture.dirty("front");
      },
    );
    picture.extras.push((context) => this.#draw(context));
  }

  #held = false;

  /** Return what a press at a place of the picture takes, or null. */
  grab(px, py, type) {
    const at = this.picture.camera.toWorld(px, py);
    if (this.options.tool) return this.#pull(at);
    if (!this.can("set_pose")) return null;
    const chosen = this.#chosen();
    if (chosen?.movable && this.#onHandle(chosen, px, py, type)) return this.#turn(chosen);
    const body = this.bodyAt(...at, type);
    // a finger that wants to move the view often lands on something: it must be chosen first
    if (!body?.movable || (type === "touch" && body !== chosen)) return null;
    this.options.set({selected: body.id});
    return this.#move(body, at);
  }

  click(px, py) {
    const body = this.bodyAt(...this.picture.camera.toWorld(px, py), "mouse");
    this.#arrow = null;
    this.options.set({selected: body?.id ?? null});
  }

  /** The body at a place of the world: the last drawn is on top. */
  bodyAt(x, y, type) {
    const slack = (GRIP[type] ?? GRIP.mouse) / this.picture.camera.scale;
    const hit = (body) => {
      const pose = body.kind === "wall" ? null : this.scene.poseOf(body);
      return pose && covers(body, pose, x, y, Math.min(slack, Math.max(slack - body.radius, 0)));
    };
    return this.scene.world.bodies.findLast(hit) ?? null;
  }

  forgetArrow() {
    this.#arrow = null;
    this.picture.dirty("front");
  }

  #chosen() {
    return this.options.selected === null ? null : this.scene.body(this.options.selected);
  }

  #handle(body) {
    const [x, y, yaw] = this.#poseOf(body);
    const reach = body.radius * this.picture.camera.scale + HANDLE;
    const [px, py] = this.picture.camera.toScreen(x, y);
    return [px + reach * Math.cos(yaw), py - reach * Math.sin(yaw)];
  }

  #poseOf(body) {
    return this.#ghost?.body === body.id ? this.#ghost.pose : this.scene.poseOf(body);
  }

  #onHandle(body, px, py, type) {
    if (!this.#poseOf(body)) return false;
    const [hx, hy] = this.#handle(body);
    return Math.hypot(px - hx, py - hy) <= (GRIP[type] ?? GRIP.mouse);
  }

  #move(body, [x0, y0]) {
    const [bx, by, yaw] = this.scene.poseOf(body);
    return this.#drag(body, (x, y) => [bx + x - x0, by + y - y0, yaw]);
  }

  #turn(body) {
    const [bx, by] = this.scene.poseOf(body);
    return this.#drag(body, (x, y) => [bx, by, Math.atan2(y - by, x - bx)]);
  }

  /** pose(x, y): where the body shall be when the pointer is there. */
  #drag(body, pose) {
    const before = this.scene.poseOf(body);
    let moved = false;
    const put = (target, held) => {
      this.#held = held;
      this.#ghost = {body: body.id, pose: target};
      this.place(body.id, target);
      this.picture.dirty("front");
    };
    return {
      move: (px, py) => {
        moved = true;
        put(pose(...this.picture.camera.toWorld(px, py)), true);
      },
      end: () => put(this.#ghost.pose, false),
      cancel: () => moved && put(before, false),
    };
  }

  #pull(from) {
    const kind = this.options.tool;
    const drop = () => this.forgetArrow();
    return {
      move: (px, py) => {
        this.#arrow = {from, to: this.picture.camera.toWorld(px, py), kind};
        this.picture.dirty("front");
      },
      end: () => {
        if (kind === "measure") return;
        const [x, y, yaw] = [...from, angleOf(this.#arrow)];
        this.ask("initial_pose", {x, y, yaw});
        drop();
        this.options.set({tool: null});
      },
      cancel: drop,
    };
  }

  #draw(context) {
    const {camera, colors, ratio} = this.picture;
    if (this.#ghost) this.#drawGhost(context);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const chosen = this.#chosen();
    if (chosen?.movable && this.can("set_pose") && this.#poseOf(chosen)) this.#drawHandle(context, chosen);
    if (!this.#arrow) return;
    const {from, to, kind} = this.#arrow;
    const [[x0, y0], [x1, y1]] = [camera.toScreen(...from), camera.toScreen(...to)];
    line(context, x0, y0, x1, y1, colors);
    const angle = `${short((angleOf(this.#arrow) * 180) / Math.PI)}°`;
    const length = `${short(Math.hypot(to[0] - from[0], to[1] - from[1]))} m`;
    Object.assign(context, {font: "12px system-ui, sans-serif", textAlign: "left", textBaseline: "bottom"});
    label(context, kind === "measure" ? `${length}, ${angle}` : angle, x1 + 10, y1 - 6, colors);
  }

  #drawGhost(context) {
    const {camera, colors, ratio} = this.picture;
    const body = this.scene.body(this.#ghost.body);
    if (!body) return;
    camera.apply(context, ratio);
    context.translate(this.#ghost.pose[0], this.#ghost.pose[1]);
    context.rotate(this.#ghost.pose[2]);
    Object.assign(context, {strokeStyle: colors.accent, lineWidth: 1.5 / camera.scale});
    context.setLineDash([4 / camera.scale, 3 / camera.scale]);
    context.stroke(body.closed);
    context.setLineDash([]);
  }

  #drawHandle(context, body) {
    const {camera, colors} = this.picture;
    const [hx, hy] = this.#handle(body);
    const [px, py] = camera.toScreen(...this.#poseOf(body));
    line(context, px, py, hx, hy, colors);
    context.beginPath();
    context.arc(hx, hy, 7, 0, 2 * Math.PI);
    Object.assign(context, {fillStyle: colors.paper, strokeStyle: colors.accent, lineWidth: 2.5});
    context.fill();
    context.stroke();
  }
}

function angleOf({from, to}) {
  return Math.atan2(to[1] - from[1], to[0] - from[0]);
}

function line(context, x0, y0, x1, y1, colors) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  Object.assign(context, {strokeStyle: colors.accent, lineWidth: 1.5});
  context.stroke();
}

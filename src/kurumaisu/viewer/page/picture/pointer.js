// SPDX-License-Identifier: BSD-3-Clause
// Mouse, pen and fingers on the picture: one drags a thing or the view, two pinch, the wheel zooms.

const STILL = {mouse: 4, pen: 6, touch: 10}; // [px] that a click may wander
const WHEEL = 0.0016; // per unit of deltaY
const LINE = 20; // units of deltaY for a line of a wheel that counts lines

export class Pointer {
  #down = new Map(); // pointerId -> [x, y]
  #start = null;
  #drag = null; // {move(x, y), end(), cancel()} in pixels, of what a tool has taken
  #moved = false;

  /** grab(x, y, type): returns such a drag, or null to move the view; click(x, y); panned(). */
  constructor(element, picture, {grab, click, panned}) {
    Object.assign(this, {element, picture, grab, click, panned});
    element.addEventListener("pointerdown", (event) => this.#onDown(event));
    element.addEventListener("pointermove", (event) => this.#onMove(event));
    element.addEventListener("pointerup", (event) => this.#onUp(event, true));
    element.addEventListener("pointercancel", (event) => this.#onUp(event, false));
    element.addEventListener("wheel", (event) => this.#onWheel(event), {passive: false});
  }

  /** Give back what is being dragged. */
  cancel() {
    this.#drag?.cancel();
    this.#drag = null;
  }

  #place(event) {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  #onDown(event) {
    if (event.button > 1) return;
    const place = this.#place(event);
    this.element.setPointerCapture(event.pointerId);
    this.#down.set(event.pointerId, place);
    if (this.#down.size > 1) return this.cancel();
    this.#start = place;
    this.#moved = false;
    this.#drag = event.button === 0 ? this.grab(...place, event.pointerType) : null;
  }

  #onMove(event) {
    const before = this.#down.get(event.pointerId);
    if (!before) return;
    const place = this.#place(event);
    if (this.#down.size > 1) this.#pinch(event.pointerId, before, place);
    else if (this.#moved || this.#wandered(place, event.pointerType)) {
      const from = this.#moved ? before : this.#start;
      this.#moved = true;
      if (this.#drag) this.#drag.move(...place);
      else this.#pan(place[0] - from[0], place[1] - from[1]);
    }
    this.#down.set(event.pointerId, place);
  }

  #wandered([x, y], type) {
    return Math.hypot(x - this.#start[0], y - this.#start[1]) > (STILL[type] ?? STILL.mouse);
  }

  #onUp(event, good) {
    if (!this.#down.delete(event.pointerId)) return;
    if (this.#down.size) {
      this.#moved = true; // the finger that stays goes on moving the view
      return;
    }
    const drag = this.#drag;
    this.#drag = null;
    if (!good) drag?.cancel();
    else if (drag && this.#moved) drag.end();
    else {
      drag?.cancel();
      if (!this.#moved) this.click(...this.#place(event));
    }
  }

  #pan(dx, dy) {
    this.picture.camera.pan(dx, dy);
    this.panned();
    this.picture.dirty();
  }

  /** Scale by the distance of the first two fingers, and follow their middle. */
  #pinch(id, before, place) {
    const ids = [...this.#down.keys()].slice(0, 2);
    if (!ids.includes(id)) return;
    const other = this.#down.get(ids.find((one) => one !== id));
    const distance = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
    const middle = [(place[0] + other[0]) / 2, (place[1] + other[1]) / 2];
    this.#moved = true;
    this.#pan((place[0] - before[0]) / 2, (place[1] - before[1]) / 2);
    this.picture.camera.zoom(distance(place) / distance(before), ...middle);
  }

  #onWheel(event) {
    event.preventDefault();
    const units = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE : 1;
    const speed = event.ctrlKey ? 6 : 1; // a pinch on a touchpad
    this.picture.camera.zoom(Math.exp(-event.deltaY * units * WHEEL * speed), ...this.#place(event));
    this.picture.dirty();
  }
}

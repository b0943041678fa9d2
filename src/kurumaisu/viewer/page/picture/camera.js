// SPDX-License-Identifier: BSD-3-Clause
// Which part of the world is seen: middle [m], scale [pixels per metre], size of the picture [pixels of CSS].

const CLOSEST = 4000; // [px/m]
const FARTHEST = 0.5;
const ROOM = 0.94; // share of the picture that "everything" fills

export class Camera {
  x = 0;
  y = 0;
  scale = 60;
  width = 1;
  height = 1;

  /** A text that is the same for the same view. */
  get place() {
    return `${this.x} ${this.y} ${this.scale}`;
  }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  /** Draw in metres, y up. */
  apply(context, ratio) {
    const k = this.scale * ratio;
    context.setTransform(k, 0, 0, -k, (this.width / 2) * ratio - this.x * k, (this.height / 2) * ratio + this.y * k);
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  /** Zoom so that the point of the picture stays where it is. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(CLOSEST, Math.max(FARTHEST, this.scale * factor));
    const [nx, ny] = this.toWorld(px, py);
    this.x += x - nx;
    this.y += y - ny;
  }

  /** Show all of [x0, y0, x1, y1] between what covers the picture at its top and bottom [pixels]. */
  fit([x0, y0, x1, y1], top = 0, bottom = 0) {
    const free = Math.max(this.height - top - bottom, 1);
    const scale = ROOM * Math.min(this.width / Math.max(x1 - x0, 0.1), free / Math.max(y1 - y0, 0.1));
    this.scale = Math.min(CLOSEST, Math.max(FARTHEST, scale));
    this.x = (x0 + x1) / 2;
    this.y = (y0 + y1) / 2 + (top - bottom) / 2 / this.scale;
  }
}

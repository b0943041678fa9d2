// SPDX-License-Identifier: BSD-3-Clause
// The dead-man: commands go out only while somebody holds something, and one zero when he lets go.

const PERIOD = 100; // [ms] between commands
const UNANSWERED = 10; // commands without a reply: what is seen is a second old, and nobody can drive by that
const BACKLOG = 2000; // [bytes] that the network has not taken: what waits there would be obeyed too late

export class DeadMan {
  armed = false;
  body = null; // id of the robot that is driven, where there are several
  #held = null; // [v, w] [m/s, rad/s]
  #timer = 0;
  #unanswered = 0;

  /** connection: gives commands; changed(reason): armed, held or not has changed; reason: why it was taken away. */
  constructor(connection, changed) {
    Object.assign(this, {connection, changed});
    const lost = (reason) => () => this.disarm(reason);
    addEventListener("blur", lost("this window lost the focus"));
    addEventListener("pagehide", lost("the page was left"));
    document.addEventListener("visibilitychange", () => document.hidden && this.disarm("this page was hidden"));
    connection.on("line", ({state}) => state === "on" || this.disarm("the connection was lost"));
  }

  get held() {
    return this.#held;
  }

  arm() {
    this.armed = true;
    this.#unanswered = 0;
    this.changed();
  }

  /** Take the stick away. A reason is for what the driver did not ask for. */
  disarm(reason = "") {
    if (!this.armed) return;
    this.release();
    this.armed = false;
    this.changed(reason);
  }

  /** Hold v [m/s] and w [rad/s]; nothing happens unless armed. */
  hold(v, w) {
    if (!this.armed) return;
    const began = this.#held === null;
    this.#held = [v, w];
    if (!began) return;
    this.#send();
    this.#timer = setInterval(() => this.#send(), PERIOD);
    this.changed();
  }

  release() {
    if (this.#held === null) return;
    clearInterval(this.#timer);
    this.#held = null;
    // without a line there is nothing to send: the server stops by itself
    if (this.connection.open) this.#command(0, 0);
    this.changed();
  }

  #send() {
    if (this.#unanswered >= UNANSWERED || this.connection.backlog > BACKLOG) {
      this.disarm("the connection is too slow for driving");
    } else this.#command(...this.#held);
  }

  async #command(v, w) {
    this.#unanswered += 1;
    const whom = this.body === null ? {} : {body: this.body};
    const reply = await this.connection.command("drive", {v, w, ...whom});
    this.#unanswered -= 1;
    if (!reply.ok) this.disarm(reply.message);
  }
}

// SPDX-License-Identifier: BSD-3-Clause
// What this page has added to the world, deleted from it and moved in it: there and back again.

import {byId} from "../common/dom.js";

const MOST = 200; // steps that are kept

/** A body that edits are about: its id, until a reset takes away what was added; there: as far as we know. */
class Subject {
  matched = false; // the world has once been as we know it

  /** id: null until it has been added. */
  constructor(id) {
    Object.assign(this, {id, added: id === null, there: id !== null});
  }

  /** Be there or not from now on; bodies: of the world that is shown, which may know already, or not yet. */
  be(there, bodies) {
    this.there = there;
    this.matched = this.in(bodies) === there;
  }

  in(bodies) {
    return bodies.some(({id}) => id === this.id);
  }
}

export class History {
  #done = []; // {what, forth(), back()}, each resolving with a reply
  #undone = [];
  #subjects = new Map(); // by id
  #busy = Promise.resolve();
  #waiting = 0; // edits whose reply is yet to come, though the world may come before it

  /** ask(name, values): a command, failures are said elsewhere; say(text). */
  constructor(scene, permit, ask, say) {
    Object.assign(this, {scene, permit, ask, say});
    byId("undo").addEventListener("click", () => this.undo());
    byId("redo").addEventListener("click", () => this.redo());
    permit.on("change", () => this.#show());
    scene.on("world", () => this.#compare());
    this.#show();
  }

  /** Add a body: arguments as of the command; resolve with its id, or null. */
  async add(values) {
    const subject = new Subject(null);
    const forth = async () => {
      const reply = subject.id === null ? await this.ask("add", values) : await this.ask("restore", {body: subject.id});
      if (reply.ok && subject.id === null) this.#subjects.set((subject.id = reply.result), subject);
      if (reply.ok) subject.be(true, this.#bodies);
      return reply;
    };
    const reply = await this.#do({what: `adding a ${values.kind}`, forth, back: () => this.#delete(subject)});
    return reply.ok ? subject.id : null;
  }

  remove({id, name}) {
    if (!this.permit.can("delete")) return;
    const subject = this.#subject(id);
    const back = async () => {
      const reply = await this.ask("restore", {body: subject.id});
      if (reply.ok) subject.be(true, this.#bodies);
      return reply;
    };
    this.#do({what: `deleting ${name}`, forth: () => this.#delete(subject), back});
  }

  /** Note that a body was moved from a pose [x, y, yaw] to another. */
  moved({id, name}, before, after) {
    const subject = this.#subject(id);
    const put = ([x, y, yaw]) => this.ask("set_pose", {body: subject.id, x, y, yaw});
    this.#keep({what: `moving ${name}`, forth: () => put(after), back: () => put(before)});
  }

  undo() {
    return this.#go(this.#done, this.#undone, "back", "Undone");
  }

  redo() {
    return this.#go(this.#undone, this.#done, "forth", "Done again");
  }

  /** The world is again as its file has it: all that was done can be done again. */
  rewound() {
    for (const subject of this.#subjects.values()) {
      if (subject.added) subject.id = null;
      subject.be(!subject.added, this.#bodies);
    }
    this.#subjects.clear();
    this.#undone.push(...this.#done.reverse());
    this.#done = [];
    this.#show();
  }

  get #bodies() {
    return this.scene.world.bodies;
  }

  #subject(id) {
    if (!this.#subjects.has(id)) this.#subjects.set(id, new Subject(id));
    return this.#subjects.get(id);
  }

  async #delete(subject) {
    const reply = await this.ask("delete", {body: subject.id});
    if (reply.ok) subject.be(false, this.#bodies);
    return reply;
  }

  /** One after another: the next may need the id that the one before makes. */
  #one(action) {
    this.#waiting += 1;
    this.#busy = this.#busy.then(action).finally(() => (this.#waiting -= 1));
    return this.#busy;
  }

  #do(edit) {
    return this.#one(async () => {
      const reply = await edit.forth();
      if (reply.ok) this.#keep(edit);
      return reply;
    });
  }

  #keep(edit) {
    this.#done.push(edit);
    if (this.#done.length > MOST) this.#done.shift();
    this.#undone = [];
    this.#show();
  }

  #go(from, to, way, word) {
    return this.#one(async () => {
      const edit = from.at(-1);
      if (!edit || !this.permit.can("add")) return;
      const reply = await edit[way]();
      if (!reply.ok || from.at(-1) !== edit) return;
      to.push(from.pop());
      this.say(`${word}: ${edit.what}.`);
      this.#show();
    });
  }

  /** See whether somebody else has put the world back: what was there is gone, or the other way round. */
  #compare() {
    if (this.#waiting) return;
    for (const subject of this.#subjects.values()) {
      const agrees = subject.in(this.#bodies) === subject.there;
      if (!agrees && subject.matched) return void this.rewound();
      subject.matched = agrees;
    }
  }

  #show() {
    for (const [id, list] of [["undo", this.#done], ["redo", this.#undone]]) {
      const button = byId(id);
      const may = this.permit.can("add");
      button.disabled = !may || !list.length;
      if (may) button.title = list.length ? `${button.dataset.title}: ${list.at(-1).what}` : "Nothing to be done";
    }
  }
}

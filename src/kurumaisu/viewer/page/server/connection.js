// SPDX-License-Identifier: BSD-3-Clause
// The line to the server: connects, says who we are, reconnects, and pairs commands with replies.

import {News} from "../common/dom.js";

const VERSION = 1;
const WAITS = [250, 500, 1000, 2000, 4000, 8000]; // [ms] between attempts, the last one for good
const SESSION = "kurumaisu.session";

/**
 * News: "message" (an object), "binary" (an ArrayBuffer), "line" ({state: "on", "off" or "wrong", seconds
 * to wait, why the server ended it, if it said}),
 * "refused" (why a one-time secret is not good).
 */
export class Connection extends News {
  asking = null; // "token" or "session" while the answer to it is awaited
  #socket = null;
  #attempt = 0;
  #timer = 0;
  #number = 0;
  #pending = new Map();
  #token = null;

  /** token: one-time secret of the address, or null. */
  constructor(token) {
    super();
    this.#token = token;
    addEventListener("online", () => this.#hurry());
    document.addEventListener("visibilitychange", () => document.hidden || this.#hurry());
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Bytes that the network has not taken yet. */
  get backlog() {
    return this.#socket?.bufferedAmount ?? 0;
  }

  start() {
    clearTimeout(this.#timer);
    const address = new URL("ws", document.baseURI);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    address.hash = "";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.#introduce();
    socket.onmessage = (event) => this.#take(event.data);
    socket.onclose = ({reason}) => this.#lost(socket, reason);
    this.#socket = socket;
  }

  /** Use a one-time secret that came later. */
  useToken(token) {
    this.#token = token;
    if (this.open) this.#introduce();
  }

  /** Send a command; resolve with {ok, message, result?}, also when the line breaks. */
  command(name, values = {}) {
    if (!this.open) return Promise.resolve({ok: false, message: "not connected"});
    const id = ++this.#number;
    this.#socket.send(JSON.stringify({type: "command", ...values, id, name}));
    return new Promise((resolve) => this.#pending.set(id, resolve));
  }

  #introduce() {
    const session = sessionStorage.getItem(SESSION);
    this.asking = this.#token ? "token" : session && "session";
    if (this.#token) this.#socket.send(JSON.stringify({type: "token", token: this.#token}));
    else if (session) this.#socket.send(JSON.stringify({type: "session", session}));
    this.#token = null;
  }

  #take(data) {
    if (typeof data !== "string") return this.tell("binary", data);
    const message = JSON.parse(data);
    if (message.type === "reply") return message.id === null ? this.#turnedAway(message) : this.#settle(message.id, message);
    if (message.type === "hello") {
      if (message.version !== VERSION) return this.tell("line", {state: "wrong"});
      this.#attempt = 0;
      if (message.control) this.asking = null;
      if (message.session) sessionStorage.setItem(SESSION, message.session);
      this.tell("line", {state: "on"});
    }
    return this.tell("message", message);
  }

  #settle(id, reply) {
    const resolve = this.#pending.get(id);
    this.#pending.delete(id);
    resolve?.(reply);
  }

  /** A session is that of a server that has ended, so no message is due; a secret was given on purpose. */
  #turnedAway({message}) {
    if (this.asking === "session") sessionStorage.removeItem(SESSION);
    const why = this.asking === "token" ? message : "";
    this.asking = null;
    this.tell("refused", why);
  }

  #lost(socket, why) {
    if (socket !== this.#socket) return;
    for (const id of [...this.#pending.keys()]) this.#settle(id, {ok: false, message: "the connection was lost"});
    const wait = WAITS[Math.min(this.#attempt, WAITS.length - 1)];
    this.#attempt += 1;
    this.tell("line", {state: "off", seconds: wait / 1000, why});
    // somewhat random, or all pages would come back at once
    this.#timer = setTimeout(() => this.start(), wait * (0.75 + 0.5 * Math.random()));
  }

  #hurry() {
    if (this.#socket?.readyState === WebSocket.CLOSED) this.start();
  }
}

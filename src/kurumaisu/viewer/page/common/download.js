// SPDX-License-Identifier: BSD-3-Clause
// What the browser saves.

import {make} from "./dom.js";

const LIFE = 60_000; // [ms] that a browser may take to read it

export function download(blob, name) {
  const href = URL.createObjectURL(blob);
  make("a", {href, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(href), LIFE);
}

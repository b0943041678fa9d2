// SPDX-License-Identifier: BSD-3-Clause
// Between tabs of one viewer: the report asks whoever shows the recording to go to a moment.

const NAME = "kurumaisu-viewer";
const PATIENCE = 400; // [ms] that an answer may take

/** go(fragment): goes there and returns "", or why it may not. */
export function answer(go) {
  const channel = new BroadcastChannel(NAME);
  channel.onmessage = ({data: {ask, fragment}}) => ask && channel.postMessage({answer: ask, why: go(fragment)});
}

/** Resolve with {gone, why}: whether a tab went there, and if none did, why one would not, null where there is none. */
export function ask(fragment) {
  const channel = new BroadcastChannel(NAME);
  const number = crypto.getRandomValues(new Uint32Array(1))[0] + 1;
  return new Promise((resolve) => {
    let refusal = null;
    const end = (result) => {
      channel.close();
      resolve(result);
    };
    channel.onmessage = ({data: {answer, why}}) => {
      if (answer !== number) return;
      if (!why) end({gone: true});
      refusal = why;
    };
    setTimeout(() => end({gone: false, why: refusal}), PATIENCE);
    channel.postMessage({ask: number, fragment});
  });
}

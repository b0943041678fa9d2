// SPDX-License-Identifier: BSD-3-Clause
// Binary messages: docs/viewer.md. Little endian, as are all computers that run a browser today.

const HEAD = 8; // bytes: kind, flags, count, body, which of its rangers
const SCAN_HEAD = 7; // numbers: x, y, yaw, angle_min, angle_increment, range_min, range_max
const ERROR = 1;
const INTENSITY = 2;
const NO_BODY = 0xffff;

/** Return {kind, body, ...}, or null for a kind that is not known. Throw RangeError where bytes are missing. */
export function decode(buffer) {
  const view = new DataView(buffer);
  const [kind, flags] = [view.getUint8(0), view.getUint8(1)];
  const count = view.getUint16(2, true);
  const [index, ranger] = [view.getUint16(4, true), view.getUint16(6, true)];
  const body = index === NO_BODY ? null : index;
  if (kind === 1) return scan(buffer, flags, count, {body, ranger});
  if (kind === 2) return {kind: "particles", body, count, values: new Float32Array(buffer, HEAD, 3 * count)};
  return null;
}

function scan(buffer, flags, count, whose) {
  const [x, y, yaw, angleMin, angleIncrement, rangeMin, rangeMax] = new Float32Array(buffer, HEAD, SCAN_HEAD);
  let offset = HEAD + 4 * SCAN_HEAD;
  const take = () => {
    const values = new Float32Array(buffer, offset, count);
    offset += 4 * count;
    return values;
  };
  const ranges = take();
  const errors = flags & ERROR ? take() : null;
  const intensities = flags & INTENSITY ? take() : null;
  return {kind: "scan", ...whose, count, x, y, yaw, angleMin, angleIncrement, rangeMin, rangeMax, ranges, errors, intensities};
}

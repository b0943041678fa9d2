// SPDX-License-Identifier: BSD-3-Clause
// The map: map_server's greys, 0 occupied to 254 free and 205 unknown, in the colours of the theme.

const UNKNOWN = 205;
const FREE = 254;

let wanted = null; // url that is shown, or under way
let source = null; // its image, once it is there
let tinted = null; // the image in the colours of `tint`
let tint = "";

export function drawMap(context, picture) {
  const {map} = picture.scene;
  if (!map) return;
  if (map.url !== wanted) load(map.url, picture);
  if (!source) return;
  if (!tinted || tint !== picture.colors.ink) {
    tint = picture.colors.ink;
    tinted = colored(source, picture.colors);
  }
  const [x, y, yaw] = map.origin;
  picture.camera.apply(context, picture.ratio);
  context.translate(x, y);
  context.rotate(yaw);
  context.scale(map.resolution, -map.resolution); // row 0 of an image is its top
  context.imageSmoothingEnabled = picture.camera.scale * map.resolution < 1;
  context.drawImage(tinted, 0, -source.height);
}

/** The old image stays until the new one is there. Only a path of this server is loaded. */
function load(url, picture) {
  wanted = url;
  const image = new Image();
  image.onload = () => {
    if (url !== wanted) return;
    source = image;
    tinted = null;
    picture.dirty("ground");
  };
  image.src = new URL(url, document.baseURI).pathname;
}

function colored(image, colors) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext("2d", {willReadFrequently: true});
  context.drawImage(image, 0, 0);
  const data = context.getImageData(0, 0, canvas.width, canvas.height);
  const ink = rgb(colors.ink);
  const free = rgb(colors.free);
  const words = new Uint32Array(data.data.buffer);
  const table = new Uint32Array(256);
  for (let grey = 0; grey < 256; grey++) table[grey] = shade(grey, ink, free);
  for (let i = 0; i < words.length; i++) words[i] = table[words[i] & 0xff];
  context.putImageData(data, 0, 0);
  return canvas;
}

/** Return a pixel: ink where occupied, the colour of free floor, or nothing where unknown. */
function shade(grey, ink, free) {
  const [color, strength] = grey >= UNKNOWN
    ? [free, (grey - UNKNOWN) / (FREE - UNKNOWN)]
    : [ink, (1 - grey / UNKNOWN) * 0.75];
  const alpha = Math.round(255 * Math.min(1, strength));
  return ((alpha << 24) | (color[2] << 16) | (color[1] << 8) | color[0]) >>> 0;
}

function rgb(color) {
  return color.match(/[\d.]+/g).slice(0, 3).map(Number);
}

// The voxels in the page: Hounsfield units on a grid along the patient's axes. i runs to the patient's left, j to the
// back, k to the head; an index means a voxel's centre.
'use strict';

/** So many bytes from the server, as they come in; `progress(share)` is told how far it is. */
PLAN.bytes = async (path, count, progress) => {
  const bytes = new Uint8Array(count);
  const response = await PLAN.fetch(path);
  const reader = /** @type {ReadableStream<Uint8Array<ArrayBuffer>>} */ (response.body).getReader();
  let at = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (at + value.length > count) throw new Error(`the ${path} data are longer than expected`);
    bytes.set(value, at);
    at += value.length;
    progress(at / count);
  }
  if (at !== count) throw new Error(`the ${path} data are incomplete`);
  return bytes;
};

class Volume {
  /** @param {number[]} size @param {number[]} spacing @param {Int16Array} hu */
  constructor(size, spacing, hu) {
    this.size = size;
    this.spacing = spacing.map((metres) => metres * 1e3); // mm
    this.hu = hu;
  }

  /**
   * As it comes in; `progress(share)` is told how far it is.
   * @param {number[]} size
   * @param {number[]} spacing
   * @param {(share: number) => void} progress
   */
  static async load(size, spacing, progress) {
    const bytes = await PLAN.bytes('volume', 2 * size[0] * size[1] * size[2], progress);
    return new Volume(size, spacing, new Int16Array(bytes.buffer));
  }

  /** @param {Index} index */
  holds(index) {
    return index.every((value, axis) => value >= -0.5 && value < this.size[axis] - 0.5);
  }

  /**
   * Voxel by voxel: the nearest one's value, or nothing outside.
   * @param {Index} index
   */
  at(index) {
    const [i, j, k] = index.map(Math.round);
    const [n, m, l] = this.size;
    if (i < 0 || j < 0 || k < 0 || i >= n || j >= m || k >= l) return undefined;
    return this.hu[(k * m + j) * n + i];
  }

  /**
   * Between the eight voxels around; -1000 outside.
   * @param {number} x
   * @param {number} y
   * @param {number} z
   */
  between(x, y, z) {
    const [n, m, l] = this.size;
    if (!(x >= 0 && y >= 0 && z >= 0 && x <= n - 1 && y <= m - 1 && z <= l - 1)) return -1000;
    const i = Math.min(Math.floor(x), Math.max(n - 2, 0)),
      j = Math.min(Math.floor(y), Math.max(m - 2, 0)),
      k = Math.min(Math.floor(z), Math.max(l - 2, 0));
    const di = n > 1 ? 1 : 0,
      dj = m > 1 ? n : 0,
      dk = l > 1 ? n * m : 0;
    const u = x - i,
      v = y - j,
      w = z - k;
    const at = (k * m + j) * n + i;
    const { hu } = this;
    const low = (hu[at] * (1 - u) + hu[at + di] * u) * (1 - v) + (hu[at + dj] * (1 - u) + hu[at + dj + di] * u) * v;
    const high =
      (hu[at + dk] * (1 - u) + hu[at + dk + di] * u) * (1 - v) +
      (hu[at + dk + dj] * (1 - u) + hu[at + dk + dj + di] * u) * v;
    return low * (1 - w) + high * w;
  }
}

/** Greys of Hounsfield units, as pixels: from -32768 on. */
PLAN.greys = ([low, high]) => {
  const table = new Uint32Array(65536);
  for (let code = 0; code < 65536; code++) {
    const share = (code - 32768 - low) / (high - low);
    const grey = Math.round(255 * Math.min(Math.max(share, 0), 1));
    table[code] = 0xff000000 | (grey << 16) | (grey << 8) | grey;
  }
  return table;
};

/** Paints a slice, a pixel a voxel: `pixel(at, column, line)` is the colour of the voxel at an offset. */
PLAN.paint = (size, { u, v, w, flip }, slice, canvas, pixel) => {
  const stride = [1, size[0], size[0] * size[1]];
  if (canvas.width !== size[u] || canvas.height !== size[v]) [canvas.width, canvas.height] = [size[u], size[v]];
  const context = NB.context(canvas);
  const image = context.createImageData(size[u], size[v]);
  const pixels = new Uint32Array(image.data.buffer);
  let to = 0;
  for (let row = 0; row < size[v]; row++) {
    const line = flip ? size[v] - 1 - row : row;
    let at = slice * stride[w] + line * stride[v];
    for (let column = 0; column < size[u]; column++, at += stride[u]) pixels[to++] = pixel(at, column, line);
  }
  context.putImageData(image, 0, 0);
};

/** A slice in greys. */
PLAN.plane = ({ size, hu }, plane, slice, greys, canvas) => {
  PLAN.paint(size, plane, slice, canvas, (at) => greys[hu[at] + 32768]);
};

/** The outlines of labels in a slice: a voxel that has another beside it, in its label's colour. */
PLAN.outlines = (size, labels, plane, slice, colors, canvas) => {
  const { u, v } = plane;
  const stride = [1, size[0], size[0] * size[1]];
  PLAN.paint(size, plane, slice, canvas, (at, column, line) => {
    const label = labels[at];
    const inside =
      !label ||
      ((column === 0 || labels[at - stride[u]] === label) &&
        (column === size[u] - 1 || labels[at + stride[u]] === label) &&
        (line === 0 || labels[at - stride[v]] === label) &&
        (line === size[v] - 1 || labels[at + stride[v]] === label));
    return inside ? 0 : (colors.get(label) ?? 0xffffffff);
  });
};

/** Small vectors. */
PLAN.add = (a, b, by = 1) => a.map((value, axis) => value + by * b[axis]);
PLAN.dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
PLAN.cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
PLAN.unit = (a) => {
  const size = Math.hypot(...a) || 1;
  return a.map((value) => value / size);
};

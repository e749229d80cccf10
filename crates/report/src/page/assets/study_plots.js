// The plots of a study.
'use strict';

/** Colours and dashes of the eight configurations. */
NB.configurationStyles = [
  { color: '#0072b2', dash: [] },
  { color: '#e69f00', dash: [] },
  { color: '#009e73', dash: [] },
  { color: '#cc79a7', dash: [] },
  { color: '#56b4e9', dash: [6, 3] },
  { color: '#d55e00', dash: [6, 3] },
  { color: '#000000', dash: [6, 3] },
  { color: '#8a7a00', dash: [6, 3] },
];

/** Viridis, sampled; for shares and numbers. */
NB.viridis = (share) => {
  const stops = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [109, 205, 89],
    [180, 222, 44],
    [253, 231, 37],
  ];
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(at), stops.length - 2);
  return stops[low].map((value, k) => Math.round(value + (stops[low + 1][k] - value) * (at - low)));
};

/** A count with thin spaces between thousands. */
NB.grouped = (value) => value.toLocaleString('en').replaceAll(',', '\u202f');

/** Fixed scatter of points that share a level, so that they can be told apart: 0 to 1. */
NB.jitter = (index, salt) => {
  let x = Math.imul(index + 1, 0x9e3779b1) ^ Math.imul(salt + 1, 0x85ebca6b);
  x = Math.imul(x ^ (x >>> 15), 0x2c1b3c6d);
  return ((x ^ (x >>> 13)) >>> 0) / 4294967296;
};

NB.rgb = ([r, g, b]) => `rgb(${r}, ${g}, ${b})`;

/** Places that are drawn with a mark each; more are drawn as pixels. */
NB.MOST_MARKS = 4000;

/** Cases of a cell below which no share is written. */
NB.FEW_CASES = 20;

/** What a study's page draws: colours, scatter, map, shares, histogram. */
class StudyPlots {
  /**
   * Kinds of cases with their colours, `of` the kind of a case, or a `scale` and the `value` of a case.
   * @returns {Coloring}
   */
  coloring() {
    const { color } = this.state;
    const [blue, red, orange, violet, grey] = [
      [0, 114, 178],
      [213, 94, 0],
      [230, 159, 0],
      [120, 94, 240],
      [150, 150, 150],
    ];
    if (color === 'outcome') {
      /** @type {CaseKind[]} */
      const kinds =
        this.state.configuration < 0
          ? [
              ['ok', blue, 'square', 'feasible'],
              ['none works', red, 'cross', 'none feasible'],
              ['invalid', grey, 'dot', 'invalid layout'],
            ]
          : [
              ['ok', blue, 'square', 'feasible'],
              ['failed', orange, 'triangle', 'failed criterion'],
              ['rejected', red, 'cross', 'rejected'],
              ['not_judged', violet, 'triangle', 'not evaluated'],
              ['invalid', grey, 'dot', 'invalid layout'],
            ];
      const at = new Map(kinds.map(([name], index) => [name, index]));
      return { kinds, of: (index) => at.get(this.outcome(index)) ?? kinds.length - 1 };
    }
    if (color === 'best') {
      /** @param {string} text */
      const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));
      /** @type {CaseKind[]} */
      const kinds = this.page.configurations.map((label, c) => [
        label,
        hex(NB.configurationStyles[c].color),
        c % 2 ? 'triangle' : 'square',
        label,
      ]);
      kinds.push(['none works', [190, 190, 190], 'dot', 'none feasible']);
      return { kinds, of: (index) => (this.best[index] < 0 ? 8 : this.best[index]) };
    }
    if (color === 'working') {
      return {
        low: 0,
        high: 8,
        scale: { low: '0', high: '8', text: 'feasible configurations' },
        value: (index) => (this.invalid[index] ? NaN : this.working[index]),
      };
    }
    const metric = this.metric(color);
    /** @param {number} index */
    const value = (index) => {
      const row = this.row(index);
      return row < 0 || !metric ? NaN : metric.values[row];
    };
    const shown = [];
    for (const index of this.indices) {
      const each = value(index);
      if (!Number.isNaN(each)) shown.push(each);
    }
    shown.sort((a, b) => a - b);
    const [low, high] = [
      shown[Math.floor(0.01 * shown.length)] ?? 0,
      shown[Math.floor(0.99 * (shown.length - 1))] ?? 1,
    ];
    return {
      low,
      high,
      value,
      scale: {
        low: `\u2264 ${NB.threeDigits(low)}`,
        high: `\u2265 ${NB.threeDigits(high)}`,
        text: metric ? this.titleOf(metric) : color,
      },
    };
  }

  /**
   * The places of the shown cases over two factors: cases of the same place are drawn as one mark.
   * @returns {Places}
   */
  places() {
    if (this.placed) return this.placed;
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    /** @param {ShownFactor} factor @param {number} value */
    const code = ({ column, levels }, value) =>
      levels ? value : Math.round((value - (column.low ?? 0)) / (column.step || 1));
    const known = new Map();
    /** @type {number[]} */
    const first = [];
    const of = new Uint32Array(this.indices.length);
    this.indices.forEach((index, at) => {
      const key = code(xFactor, xFactor.values[index]) * 65537 + code(yFactor, yFactor.values[index]);
      let place = known.get(key);
      if (place === undefined) {
        place = first.length;
        known.set(key, place);
        first.push(index);
      }
      of[at] = place;
    });
    const counts = new Uint32Array(first.length);
    for (const place of of) counts[place]++;
    // Level by level there is one place each: no scatter is wanted, the mark says how many cases it is of.
    const grid = Boolean(xAxis.labels && yAxis.labels);
    /** @param {StudyAxis} axis @param {ShownFactor} factor @param {number} index */
    const where = (axis, factor, index) => {
      const value = factor.values[index];
      return axis.labels && !grid ? value + 0.6 * (NB.jitter(index, axis.salt) - 0.5) : value;
    };
    let most = 0;
    for (const count of counts) most = Math.max(most, count);
    this.placed = {
      of,
      first,
      counts,
      most,
      x: first.map((index) => where(xAxis, xFactor, index)),
      y: first.map((index) => where(yAxis, yFactor, index)),
      grid,
    };
    return this.placed;
  }

  /**
   * Radius of the mark of a place: its area grows with the number of its cases.
   * @param {number} count
   * @param {number} most
   * @param {number} width
   */
  radius(count, most, width) {
    if (most === 1) return 3.2;
    const largest = this.places().grid
      ? Math.min(26, width / 16)
      : this.places().first.length > 600
        ? 4.5
        : Math.min(8, width / 60);
    return Math.max(largest * Math.sqrt(count / most), 2.5);
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paintScatter(context, width, height) {
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const left = yAxis.labels ? Math.min(150, 0.3 * width) : 62;
    const box = { left, top: 10, width: width - left - 14, height: height - 52 };
    const axes = new Axes(box, this.padded(xAxis), this.padded(yAxis));
    if (!context.isPaper) this.scatterAxes = axes;
    axes.draw(context);
    const coloring = this.coloring();
    const places = this.places();
    const marks = coloring.kinds ? this.shares(places, coloring) : this.medians(places, coloring);
    if (places.first.length > NB.MOST_MARKS) this.pixels(context, box, axes, places, marks);
    else this.marks(context, axes, places, marks, coloring, width);
    if (this.chosen !== undefined && !context.isPaper) this.ring(context, axes, places);
    this.scatterItems = this.legendOf(coloring, places, marks);
  }

  /**
   * How many cases of each kind every place has.
   * @param {Places} places
   * @param {{ kinds: CaseKind[], of(index: number): number }} coloring
   * @returns {PlaceMarks}
   */
  shares(places, { kinds, of }) {
    const counts = new Uint32Array(kinds.length * places.first.length);
    const totals = new Uint32Array(kinds.length);
    this.indices.forEach((index, at) => {
      const kind = of(index);
      counts[places.of[at] * kinds.length + kind]++;
      totals[kind]++;
    });
    /** @param {number} place */
    const color = (place) => {
      let most = 0;
      for (let kind = 1; kind < kinds.length; kind++)
        if (counts[place * kinds.length + kind] > counts[place * kinds.length + most]) most = kind;
      return kinds[most][1];
    };
    return { counts, totals, color, middle: [] };
  }

  /**
   * The median of the cases of every place.
   * @param {Places} places
   * @param {{ low: number, high: number, value(index: number): number }} coloring
   * @returns {PlaceMarks}
   */
  medians(places, { low, high, value }) {
    /** @type {number[][]} */
    const lists = places.first.map(() => []);
    this.indices.forEach((index, at) => {
      const each = value(index);
      if (!Number.isNaN(each)) lists[places.of[at]].push(each);
    });
    const middle = lists.map((list) => (list.length ? list.sort((a, b) => a - b)[list.length >> 1] : NaN));
    return {
      counts: new Uint32Array(),
      totals: new Uint32Array(),
      middle,
      color: (place) =>
        Number.isNaN(middle[place]) ? [200, 200, 200] : NB.viridis((middle[place] - low) / (high - low || 1)),
    };
  }

  /**
   * A mark at each place: a shape of a single case, a pie of the shares of several.
   * @param {Painter} context
   * @param {Axes} axes
   * @param {Places} places
   * @param {PlaceMarks} marks
   * @param {Coloring} coloring
   * @param {number} width
   */
  marks(context, axes, places, marks, { kinds }, width) {
    places.first.forEach((_, place) => {
      const [x, y, count] = [axes.px(places.x[place]), axes.py(places.y[place]), places.counts[place]];
      const radius = this.radius(count, places.most, width);
      if (kinds && places.most === 1) {
        const kind = kinds.findIndex((_each, at) => marks.counts[place * kinds.length + at]);
        this.shape(context, kinds[kind], x, y, radius);
        return;
      }
      /** @type {[color: Bytes, count: number][]} */
      const parts = kinds
        ? kinds.map((kind, at) => [kind[1], marks.counts[place * kinds.length + at]])
        : [[marks.color(place), count]];
      this.pie(context, x, y, radius, parts);
      if (places.grid && radius > 12) {
        context.fillStyle = '#111';
        context.textAlign = 'left';
        context.textBaseline = 'middle';
        const text = kinds
          ? `${Math.round((100 * marks.counts[place * kinds.length]) / count)} %`
          : NB.threeDigits(marks.middle[place]);
        context.fillText(text, x + radius + 4, y);
      }
    });
  }

  /**
   * @param {Painter} context
   * @param {number} x
   * @param {number} y
   * @param {number} radius
   * @param {[color: Bytes, count: number][]} parts
   */
  pie(context, x, y, radius, parts) {
    const all = parts.reduce((sum, [, count]) => sum + count, 0);
    let from = -Math.PI / 2;
    for (const [color, count] of parts) {
      if (!count) continue;
      const to = from + (2 * Math.PI * count) / all;
      context.fillStyle = NB.rgb(color);
      context.beginPath();
      if (count < all) context.moveTo(x, y);
      context.arc(x, y, radius, from, to);
      if (count < all) context.closePath();
      context.fill();
      from = to;
    }
    context.strokeStyle = '#fff';
    context.lineWidth = 0.8;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }

  /**
   * A hundred thousand shapes would take too long: pixels are written one by one.
   * @param {Painter} context
   * @param {Box} box
   * @param {Axes} axes
   * @param {Places} places
   * @param {PlaceMarks} marks
   */
  pixels(context, box, axes, places, marks) {
    const size = 2;
    if (!(context instanceof CanvasRenderingContext2D)) {
      places.first.forEach((_, place) => {
        context.fillStyle = NB.rgb(marks.color(place));
        context.fillRect(axes.px(places.x[place]), axes.py(places.y[place]), 1, 1);
      });
      return;
    }
    const ratio = context.getTransform().a;
    const [w, h] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    const image = context.getImageData(Math.round(box.left * ratio), Math.round(box.top * ratio), w, h);
    const pixels = new Uint32Array(image.data.buffer);
    const wide = Math.max(1, Math.round(0.8 * size * ratio));
    for (let place = 0; place < places.first.length; place++) {
      const [r, g, b] = marks.color(place);
      const color = ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
      const x = Math.round((axes.px(places.x[place]) - box.left) * ratio);
      const y = Math.round((axes.py(places.y[place]) - box.top) * ratio);
      for (let dy = 0; dy < wide; dy++) {
        for (let dx = 0; dx < wide; dx++) {
          if (x + dx >= 0 && x + dx < w && y + dy >= 0 && y + dy < h) pixels[(y + dy) * w + x + dx] = color;
        }
      }
    }
    context.putImageData(image, Math.round(box.left * ratio), Math.round(box.top * ratio));
  }

  /**
   * A ring about the place of the chosen case.
   * @param {Painter} context
   * @param {Axes} axes
   * @param {Places} places
   */
  ring(context, axes, places) {
    const at = this.indices.indexOf(this.chosen ?? -1);
    if (at < 0) return;
    const place = places.of[at];
    const radius = this.radius(places.counts[place], places.most, 700) + 4;
    for (const { color, wide } of [
      { color: '#fff', wide: 5 },
      { color: '#000', wide: 2.2 },
    ]) {
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.beginPath();
      context.arc(axes.px(places.x[place]), axes.py(places.y[place]), radius, 0, 7);
      context.stroke();
    }
  }

  /** @param {Coloring} coloring @param {Places} places @param {PlaceMarks} marks @returns {(Mark | Scale)[]} */
  legendOf(coloring, places, marks) {
    /** @type {(Mark | Scale)[]} */
    const items = [];
    /** @param {number} value */
    const group = (value) => NB.grouped(value);
    if (coloring.kinds) {
      coloring.kinds.forEach((kind, at) => {
        if (!marks.totals[at] && coloring.kinds.length > 5) return;
        /** @type {Mark['draw']} */
        const draw =
          places.most === 1 && places.first.length <= NB.MOST_MARKS
            ? (context, x, y) => this.shape(context, kind, x, y, 4.5)
            : (context, x, y) => {
                context.fillStyle = NB.rgb(kind[1]);
                context.beginPath();
                context.arc(x, y, 5, 0, 2 * Math.PI);
                context.fill();
              };
        items.push({
          text: `${kind[3]}: ${group(marks.totals[at])} ${marks.totals[at] === 1 ? 'case' : 'cases'}`,
          draw,
        });
      });
    } else {
      items.push({ ...coloring.scale, color: (share) => NB.rgb(NB.viridis(share)) });
      items.push({
        text: 'none feasible, or no value',
        draw: (context, x, y) => this.pie(context, x, y, 5, [[[200, 200, 200], 1]]),
      });
    }
    if (places.most > 1) {
      let fewest = Infinity;
      for (const count of places.counts) fewest = Math.min(fewest, count);
      let shows = coloring.kinds ? 'sectors: shares of cases' : 'colour: median';
      if (places.first.length > NB.MOST_MARKS) shows = 'colour: most frequent';
      const cases =
        fewest === places.most ? `${group(places.most)} cases` : `${group(fewest)} to ${group(places.most)} cases`;
      items.push({
        text: `${group(places.first.length)} positions, ${cases} each; ${shows}`,
        draw() {},
      });
    }
    return items;
  }

  /** @param {StudyAxis} axis */
  padded(axis) {
    const pad = axis.labels ? 0 : 0.03 * (axis.high - axis.low);
    // Marks of a level are spread so that they can be seen: they all have its value.
    const title = axis.labels && !this.places().grid ? `${axis.title} (marks spread about each level)` : axis.title;
    return { ...axis, title, low: axis.low - pad, high: axis.high + pad };
  }

  /** @param {Painter} context @param {CaseKind} kind @param {number} x @param {number} y @param {number} size */
  shape(context, [, color, shape], x, y, size) {
    context.fillStyle = NB.rgb(color);
    context.strokeStyle = context.fillStyle;
    context.lineWidth = 1.8;
    if (shape === 'cross') {
      context.beginPath();
      context.moveTo(x - size, y - size);
      context.lineTo(x + size, y + size);
      context.moveTo(x - size, y + size);
      context.lineTo(x + size, y - size);
      context.stroke();
    } else if (shape === 'triangle') {
      context.beginPath();
      context.moveTo(x, y - size);
      context.lineTo(x + size, y + size);
      context.lineTo(x - size, y + size);
      context.fill();
    } else if (shape === 'dot') {
      context.beginPath();
      context.arc(x, y, size * 0.6, 0, 7);
      context.fill();
    } else context.fillRect(x - size * 0.8, y - size * 0.8, size * 1.6, size * 1.6);
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paintMap(context, width, height) {
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const left = yAxis.labels ? Math.min(150, 0.3 * width) : 62;
    const box = { left, top: 10, width: width - left - 14, height: height - 52 };
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    const axes = new Axes(box, xAxis, yAxis);
    const [nx, ny] = [xAxis.bins, yAxis.bins];
    const [ok, of] = [new Uint32Array(nx * ny), new Uint32Array(nx * ny)];
    for (const index of this.indices) {
      const outcome = this.outcome(index);
      if (outcome === 'invalid') continue;
      const cell = this.bin(yAxis, yFactor, index) * nx + this.bin(xAxis, xFactor, index);
      of[cell]++;
      if (outcome === 'ok') ok[cell]++;
    }
    if (!context.isPaper) this.mapCells = { axes, nx, ny, ok, of };
    axes.draw(context);
    const [w, h] = [box.width / nx, box.height / ny];
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    for (let cell = 0; cell < nx * ny; cell++) {
      const [x, y] = [box.left + (cell % nx) * w, box.top + box.height - (Math.floor(cell / nx) + 1) * h];
      if (!of[cell]) {
        context.fillStyle = '#f2f2f2';
        context.fillRect(x, y, w, h);
        continue;
      }
      const rate = ok[cell] / of[cell];
      const [r, g, b] = NB.viridis(rate);
      context.fillStyle = `rgb(${r}, ${g}, ${b})`;
      context.fillRect(x, y, Math.ceil(w), Math.ceil(h));
      if (w > 24 && h > 14) {
        context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 130 ? '#000' : '#fff';
        // Of few cases a share would say too much.
        const text = of[cell] < NB.FEW_CASES ? `${ok[cell]}/${of[cell]}` : String(Math.round(100 * rate));
        if (context.measureText(text).width < w - 2) context.fillText(text, x + w / 2, y + h / 2);
      }
    }
    const text =
      this.state.configuration < 0
        ? 'layouts with a feasible configuration (%)'
        : `layouts with ${this.page.configurations[this.state.configuration]} feasible (%)`;
    /** @type {(Mark | Scale)[]} */
    const items = [{ low: '0', high: '100', text, color: (share) => NB.rgb(NB.viridis(share)) }];
    this.mapItems = items;
    let fewest = Infinity;
    for (const count of of) if (count) fewest = Math.min(fewest, count);
    if (fewest < NB.FEW_CASES)
      items.push({
        text: `counts instead of %: fewer than ${NB.FEW_CASES} cases`,
        draw() {},
      });
  }

  /**
   * Sorted values of every configuration, once for each metric and filter.
   * @returns {Float32Array[]}
   */
  sort() {
    if (this.sorted) return this.sorted;
    const metric = this.metric(this.state.metric);
    const counted = this.outcomeOf.map((name) => ['ok', 'failed', 'not_judged'].includes(name));
    this.sorted = this.page.configurations.map((_, c) => {
      const values = new Float32Array(this.indices.length);
      let n = 0;
      for (const index of this.indices) {
        const at = c * this.count + index;
        if (metric && counted[this.outcomes[at]] && !Number.isNaN(metric.values[at])) values[n++] = metric.values[at];
      }
      return values.subarray(0, n).sort();
    });
    return this.sorted;
  }

  valueRange() {
    let [low, high] = [Infinity, -Infinity];
    for (const values of this.sort()) {
      if (!values.length) continue;
      low = Math.min(low, values[Math.floor(0.001 * values.length)]);
      high = Math.max(high, values[Math.floor(0.999 * (values.length - 1))]);
    }
    return low < high ? [low, high] : [0, 1];
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paintEcdf(context, width, height) {
    const metric = this.metric(this.state.metric);
    if (!metric) return;
    const [low, high] = this.valueRange();
    const box = { left: 62, top: 10, width: width - 76, height: height - 52 };
    const axes = new Axes(
      box,
      { low, high, title: this.titleOf(metric) },
      { low: 0, high: 100, title: 'cumulative share of layouts (%)' },
    );
    if (!context.isPaper) this.ecdfAxes = axes;
    axes.draw(context);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    this.sort().forEach((values, c) => {
      if (!values.length) return;
      const { color, dash } = NB.configurationStyles[c];
      context.strokeStyle = color;
      context.setLineDash(dash);
      context.lineWidth = this.state.configuration === c ? 3.5 : 1.8;
      context.beginPath();
      const points = Math.min(values.length, 500);
      for (let k = 0; k < points; k++) {
        const at = points > 1 ? Math.round((k * (values.length - 1)) / (points - 1)) : 0;
        const [x, y] = [axes.px(values[at]), axes.py((100 * (at + 0.5)) / values.length)];
        if (k) context.lineTo(x, y);
        else context.moveTo(x, y);
      }
      context.stroke();
    });
    context.restore();
    context.setLineDash([]);
    this.ecdfItems = this.page.configurations
      .map((label, c) => ({
        text: `${label} (${NB.grouped(this.sort()[c].length)} layouts)`,
        draw: (/** @type {Painter} */ at, /** @type {number} */ x, /** @type {number} */ y) => {
          const { color, dash } = NB.configurationStyles[c];
          at.strokeStyle = color;
          at.lineWidth = 2.5;
          at.setLineDash(dash.map((each) => each / 2));
          at.beginPath();
          at.moveTo(x - 8, y);
          at.lineTo(x + 8, y);
          at.stroke();
          at.setLineDash([]);
        },
      }))
      .filter((_, c) => this.sort()[c].length);
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paintHistogram(context, width, height) {
    const metric = this.metric(this.state.metric);
    if (!metric) return;
    const [low, high] = this.valueRange();
    const c = this.state.configuration;
    const bins = 40;
    const counts = new Uint32Array(bins);
    /** @param {number} value */
    const add = (value) => {
      const bin = Math.floor(((value - low) / (high - low)) * bins);
      if (bin >= 0 && bin < bins) counts[bin]++;
    };
    if (c >= 0) this.sort()[c].forEach(add);
    else
      for (const index of this.indices) {
        const row = this.row(index);
        if (row >= 0 && !Number.isNaN(metric.values[row])) add(metric.values[row]);
      }
    const most = Math.max(...counts, 1);
    const box = { left: 62, top: 10, width: width - 76, height: height - 52 };
    const whose = c < 0 ? 'best per layout' : this.page.configurations[c];
    const axes = new Axes(
      box,
      { low, high, title: `${this.titleOf(metric)}, ${whose}` },
      { low: 0, high: 1.05 * most, title: 'cases' },
    );
    axes.draw(context);
    context.fillStyle = c < 0 ? '#5a626d' : NB.configurationStyles[c].color;
    counts.forEach((count, bin) => {
      const [x, next] = [axes.px(low + ((high - low) * bin) / bins), axes.px(low + ((high - low) * (bin + 1)) / bins)];
      context.fillRect(x + 0.5, axes.py(count), next - x - 1, axes.py(0) - axes.py(count));
    });
  }
}

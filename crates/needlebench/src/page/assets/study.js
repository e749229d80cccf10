// The page of a study.
'use strict';

/** Colours and dashes of the eight configurations. */
NB.configurationStyles = [
  { color: '#0072b2', dash: [] }, { color: '#e69f00', dash: [] }, { color: '#009e73', dash: [] }, { color: '#cc79a7', dash: [] },
  { color: '#56b4e9', dash: [6, 3] }, { color: '#d55e00', dash: [6, 3] }, { color: '#000000', dash: [6, 3] }, { color: '#8a7a00', dash: [6, 3] },
];

/** Viridis, sampled; for shares and numbers. */
NB.viridis = function (share) {
  const stops = [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121], [109, 205, 89], [180, 222, 44], [253, 231, 37]];
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(at), stops.length - 2);
  return stops[low].map((value, k) => Math.round(value + (stops[low + 1][k] - value) * (at - low)));
};

/** Fixed scatter of points that share a level, so that they can be told apart: 0 to 1. */
NB.jitter = (index, salt) => {
  let x = Math.imul(index + 1, 0x9e3779b1) ^ Math.imul(salt + 1, 0x85ebca6b);
  x = Math.imul(x ^ x >>> 15, 0x2c1b3c6d);
  return ((x ^ x >>> 13) >>> 0) / 4294967296;
};

NB.StudyPage = class {
  constructor(page, app) {
    this.page = page;
    this.count = page.kept;
    this.factors = page.factors.map((factor) => ({ ...factor, values: NB.array(factor.column) }));
    this.metrics = page.metrics.map((metric) => ({ ...metric, values: NB.array(metric.column) }));
    this.outcomes = NB.array(page.outcomes);
    this.outcomeOf = page.outcomeNames.map(([outcome]) => outcome);
    this.numbers = page.numbers ? NB.array(page.numbers) : null;
    if (this.numbers) for (let k = 1; k < this.count; k++) this.numbers[k] += this.numbers[k - 1];
    const posed = NB.array(page.postures.cases);
    this.posed = new Map([...posed].map((index, at) => [index, at]));
    this.poses = NB.array(page.postures.joints);
    this.places = page.postures.places ? NB.array(page.postures.places) : null;
    this.derive();
    app.append(this.head());
    if (!this.count) {
      app.append(NB.el('p', { text: 'The study has no cases.' }));
      return;
    }
    this.build(app);
  }

  metric(name) { return this.metrics.find((metric) => metric.name === name); }

  /** Best configuration and number of working ones, case by case: ok, with the largest clearance. */
  derive() {
    const { count } = this;
    const clearance = this.metric('clearance_mm');
    const ok = this.outcomeOf.map((name) => name === 'ok');
    const invalid = this.outcomeOf.map((name) => name === 'invalid');
    this.best = new Int8Array(count).fill(-1);
    this.working = new Uint8Array(count);
    this.invalid = new Uint8Array(count);
    for (let index = 0; index < count; index++) {
      let most = -Infinity;
      this.invalid[index] = invalid[this.outcomes[index]] ? 1 : 0;
      for (let c = 0; c < 8; c++) {
        const at = c * count + index;
        if (!ok[this.outcomes[at]]) continue;
        this.working[index]++;
        const value = clearance ? clearance.values[at] : 0;
        if (value > most || this.best[index] < 0) { most = value; this.best[index] = c; }
      }
    }
  }

  caseOf(index) { return this.numbers ? this.numbers[index] : index; }

  indexOf(number) {
    if (!this.numbers) return number < this.count ? number : -1;
    let [low, high] = [0, this.count - 1];
    while (low <= high) {
      const middle = (low + high) >> 1;
      if (this.numbers[middle] === number) return middle;
      if (this.numbers[middle] < number) low = middle + 1; else high = middle - 1;
    }
    return -1;
  }

  head() {
    const { cases, kept } = this.page;
    const group = (value) => value.toLocaleString('en').replaceAll(',', '\u202f');
    const criteria = this.page.manifest?.criteria || this.page.summary?.criteria;
    const met = Array.isArray(criteria) ? criteria.filter((each) => each.pass).length : 0;
    return NB.el('div', { class: 'bar' },
      Array.isArray(criteria) && criteria.length ? NB.el('span', { class: `chip ${met === criteria.length ? 'good' : 'bad'}`, text: met === criteria.length ? '\u2713 passed' : '\u2717 failed' }) : null,
      NB.el('span', { text: `${group(cases)} cases of 8 configurations` }),
      kept < cases ? NB.el('strong', { text: `The plots show ${group(kept)} of them: one of each block of successive cases, drawn by a fixed rule, and those that the statistics name. All tables of statistics are of all cases.` }) : null);
  }

  build(app) {
    const continuous = this.factors.findIndex((factor) => !factor.levels);
    const varying = this.factors.map((factor, index) => [factor, index]).filter(([factor]) => !factor.levels || factor.levels.length > 1).map(([, index]) => index);
    this.state = {
      x: continuous >= 0 ? continuous : varying[0] ?? 0,
      y: varying.find((index) => index > (continuous >= 0 ? continuous : varying[0])) ?? varying[1] ?? 0,
      color: 'outcome', configuration: -1, metric: this.metrics[0]?.name, filters: new Map(),
    };
    this.axesOf = this.factors.map((factor, index) => this.axis(factor, index));
    this.filter();
    const options = this.factors.map((factor, index) => [String(index), NB.words(factor.name)]);
    const configurations = [['-1', 'best of each case'], ...this.page.configurations.map((label, index) => [String(index), label])];
    const redraw = (set) => (value) => { set(value); this.redraw(); };
    const metricOptions = this.metrics.map((metric) => [metric.name, this.titleOf(metric)]);
    const colors = [['outcome', 'outcome'], ['best', 'best configuration'], ['working', 'number that work'], ...metricOptions];
    const controls = NB.el('div', { class: 'bar no-print', role: 'group', 'aria-label': 'What the plots show' },
      NB.select('across', options, String(this.state.x), redraw((value) => { this.state.x = Number(value); })),
      NB.select('up', options, String(this.state.y), redraw((value) => { this.state.y = Number(value); })),
      NB.select('colour', colors, 'outcome', redraw((value) => { this.state.color = value; })),
      NB.select('of', configurations, '-1', redraw((value) => { this.state.configuration = Number(value); })),
      this.factors.map((factor, index) => (factor.levels && factor.levels.length > 1
        ? NB.select(NB.words(factor.name), [['', 'all'], ...factor.levels.map((level, at) => [String(at), level.label])], '', (value) => {
          if (value === '') this.state.filters.delete(index); else this.state.filters.set(index, Number(value));
          this.filter();
          this.redraw();
        }) : null)));
    this.tip = NB.el('div', { class: 'tip', hidden: true });
    this.scatter = new NB.Canvas(430, 'Scatter of the cases over two factors', (...all) => this.paintScatter(...all));
    this.map = new NB.Canvas(430, 'Map of the success rate over two factors', (...all) => this.paintMap(...all));
    this.ecdf = new NB.Canvas(300, 'Share of cases below a value, configuration by configuration', (...all) => this.paintEcdf(...all));
    this.histogram = new NB.Canvas(300, 'Histogram of a metric', (...all) => this.paintHistogram(...all));
    this.strip = new NB.Canvas(230, 'Success rates with their intervals', (...all) => this.paintStrip(...all));
    this.scatterLegend = NB.el('div', { class: 'legend' });
    this.mapLegend = NB.el('div', { class: 'legend' });
    this.ecdfLegend = NB.el('div', { class: 'legend' });
    this.shown = NB.el('p', { class: 'soft', role: 'status' });
    this.listen(this.scatter, (x, y) => this.nearestPoint(x, y));
    this.listen(this.ecdf, (x, y) => this.nearestOnCurve(x, y));
    this.listen(this.map, (x, y) => this.cellAt(x, y));
    this.casePanel = NB.el('div', { class: 'panel' });
    this.cellPanel = NB.el('div');
    this.makeView();
    const figure = (title, help, ...parts) => NB.el('section', { class: 'panel points' }, NB.el('h3', { text: title }), NB.el('p', { class: 'soft small', text: help }), ...parts);
    const metricSelect = NB.select('metric', metricOptions, this.state.metric, redraw((value) => { this.state.metric = value; this.sorted = null; }));
    app.append(
      figure('How often each configuration works', this.page.summary?.overall
        ? `Share of valid cases in which it is ok, with ${Math.round(100 * (this.page.summary.confidence || 0.95))} % interval; of all cases.`
        : 'Share of the valid cases on this page in which it is ok.', this.strip.element),
      controls, this.shown,
      NB.el('div', { class: 'grid cases' },
        NB.el('div', null,
          figure('Cases', 'Each point is a case: click it to see it at the right, or go through the numbers there with the arrow keys.', this.scatter.element, this.scatterLegend),
          figure('Success rate', 'Share of valid cases in each cell that are ok. Click a cell for its cases.', this.map.element, this.mapLegend, this.cellPanel)),
        NB.el('div', null, this.casePanel, this.view ? NB.el('div', { class: 'panel' }, this.view.element, this.viewNote) : null)),
      NB.el('div', { class: 'bar no-print' }, metricSelect),
      NB.el('div', { class: 'grid wide' },
        figure('Share of cases below', 'Click a curve for the case at that value.', this.ecdf.element, this.ecdfLegend),
        figure('Histogram', 'Rows of the configuration chosen above; ok and failed ones.', this.histogram.element)),
      this.tip, ...this.statistics());
    this.redraw();
    const noted = this.firstNoted();
    this.choose(Number.isNaN(noted) ? 0 : noted);
  }

  /** The first case that the statistics name and that is here. */
  firstNoted() {
    const found = JSON.stringify(this.page.summary?.evidence?.configurations || []).match(/"case":(\d+)/);
    const index = found ? this.indexOf(Number(found[1])) : -1;
    return index >= 0 ? index : NaN;
  }

  titleOf(metric) {
    const unit = metric.name.match(/_(mm|deg|um|s|m3|mm_mrad)$/)?.[1];
    const name = unit ? metric.name.slice(0, -unit.length - 1) : metric.name;
    return `${NB.words(name)}${unit ? ` (${{ um: '\u00b5m', mm_mrad: 'mm/mrad', m3: 'm\u00b3' }[unit] || unit})` : ''}`;
  }

  /** Range, title and bins of a factor. */
  axis(factor, salt) {
    const title = `${NB.words(factor.name)}${factor.unit ? ` (${factor.unit})` : ''}`;
    if (factor.levels) {
      const labels = factor.levels.map((level) => level.label);
      return { low: -0.5, high: labels.length - 0.5, title, labels, bins: labels.length, salt };
    }
    let [low, high] = [Infinity, -Infinity];
    for (const value of factor.values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (!(low < high)) { low -= 0.5; high += 0.5; }
    const bins = Math.min(Math.max(Math.floor(Math.sqrt(this.count / 40)), 4), 16);
    return { low, high, title, labels: null, bins, salt };
  }

  place(axis, factor, index) {
    const value = factor.values[index];
    return axis.labels ? value + 0.7 * (NB.jitter(index, axis.salt) - 0.5) : value;
  }

  bin(axis, factor, index) {
    const value = factor.values[index];
    if (axis.labels) return value;
    return Math.min(Math.floor((value - axis.low) / (axis.high - axis.low) * axis.bins), axis.bins - 1);
  }

  filter() {
    const filters = [...this.state.filters];
    const indices = [];
    for (let index = 0; index < this.count; index++) {
      if (filters.every(([factor, level]) => this.factors[factor].values[index] === level)) indices.push(index);
    }
    this.indices = Uint32Array.from(indices);
    this.sorted = null;
    if (this.shown) this.shown.textContent = `${this.indices.length.toLocaleString('en')} cases are shown.`;
  }

  redraw() {
    for (const canvas of [this.scatter, this.map, this.ecdf, this.histogram, this.strip]) canvas.draw();
  }

  /** Row of the chosen configuration in a case; -1 where none works. */
  row(index) {
    const c = this.state.configuration < 0 ? this.best[index] : this.state.configuration;
    return c < 0 ? -1 : c * this.count + index;
  }

  outcome(index) {
    if (this.invalid[index]) return 'invalid';
    if (this.state.configuration < 0) return this.working[index] ? 'ok' : 'none works';
    return this.outcomeOf[this.outcomes[this.state.configuration * this.count + index]];
  }

  /** Class and colour of each shown case, and the legend. */
  coloring() {
    const { color } = this.state;
    if (color === 'outcome') {
      const kinds = this.state.configuration < 0
        ? [['ok', [0, 114, 178], 'square'], ['none works', [213, 94, 0], 'cross'], ['invalid', [150, 150, 150], 'dot']]
        : [['ok', [0, 114, 178], 'square'], ['failed', [230, 159, 0], 'triangle'], ['rejected', [213, 94, 0], 'cross'], ['invalid', [150, 150, 150], 'dot']];
      const at = new Map(kinds.map(([name], index) => [name, index]));
      return { kinds, of: (index) => at.get(this.outcome(index)) ?? kinds.length - 1 };
    }
    const rgb = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));
    if (color === 'best') {
      const kinds = [...this.page.configurations.map((label, c) => [label, rgb(NB.configurationStyles[c].color), c % 2 ? 'triangle' : 'square']), ['none works', [190, 190, 190], 'dot']];
      return { kinds, of: (index) => (this.best[index] < 0 ? 8 : this.best[index]) };
    }
    if (color === 'working') {
      const kinds = Array.from({ length: 9 }, (_, k) => [String(k), NB.viridis(k / 8), 'square']);
      return { kinds, of: (index) => this.working[index], scale: ['0', '8', 'configurations that work'] };
    }
    const metric = this.metric(color);
    const { values } = metric;
    const shown = [];
    for (const index of this.indices) { const row = this.row(index); if (row >= 0 && !Number.isNaN(values[row])) shown.push(values[row]); }
    shown.sort((a, b) => a - b);
    const [low, high] = [shown[Math.floor(0.01 * shown.length)] ?? 0, shown[Math.floor(0.99 * (shown.length - 1))] ?? 1];
    const steps = 24;
    const kinds = [...Array.from({ length: steps }, (_, k) => [String(k), NB.viridis(k / (steps - 1)), 'square']), ['none', [200, 200, 200], 'dot']];
    return {
      kinds, scale: [`\u2264 ${NB.fixed(low, 1)}`, `\u2265 ${NB.fixed(high, 1)}`, this.titleOf(metric)],
      of: (index) => {
        const row = this.row(index);
        const value = row < 0 ? NaN : values[row];
        return Number.isNaN(value) ? steps : Math.min(Math.max(Math.floor((value - low) / (high - low || 1) * steps), 0), steps - 1);
      },
    };
  }

  paintScatter(context, width, height) {
    const left = this.axesOf[this.state.y].labels ? 150 : 74;
    const box = { left, top: 10, width: width - left - 14, height: height - 52 };
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    const axes = new NB.Axes(box, this.padded(xAxis), this.padded(yAxis));
    this.scatterAxes = axes;
    axes.draw(context);
    const { kinds, of, scale } = this.coloring();
    const counts = new Uint32Array(kinds.length);
    const ratio = context.getTransform().a;
    const many = this.indices.length > 4000;
    const size = Math.max(1, Math.round((many ? 1.6 : 3) * ratio));
    if (many) {
      // Pixels are written one by one: a hundred thousand shapes would take too long.
      const [w, h] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
      const image = context.getImageData(Math.round(box.left * ratio), Math.round(box.top * ratio), w, h);
      const pixels = new Uint32Array(image.data.buffer);
      const colors = kinds.map(([, [r, g, b]]) => (255 << 24 | b << 16 | g << 8 | r) >>> 0);
      for (const index of this.indices) {
        const kind = of(index);
        counts[kind]++;
        const x = Math.round((axes.px(this.place(xAxis, xFactor, index)) - box.left) * ratio);
        const y = Math.round((axes.py(this.place(yAxis, yFactor, index)) - box.top) * ratio);
        for (let dy = 0; dy < size; dy++) {
          for (let dx = 0; dx < size; dx++) {
            if (x + dx >= 0 && x + dx < w && y + dy >= 0 && y + dy < h) pixels[(y + dy) * w + x + dx] = colors[kind];
          }
        }
      }
      context.putImageData(image, Math.round(box.left * ratio), Math.round(box.top * ratio));
    } else {
      for (const index of this.indices) {
        const kind = of(index);
        counts[kind]++;
        this.shape(context, kinds[kind], axes.px(this.place(xAxis, xFactor, index)), axes.py(this.place(yAxis, yFactor, index)), 3.2);
      }
    }
    if (this.chosen !== undefined) {
      const [x, y] = [axes.px(this.place(xAxis, xFactor, this.chosen)), axes.py(this.place(yAxis, yFactor, this.chosen))];
      for (const [color, wide] of [['#fff', 5], ['#000', 2.2]]) {
        context.strokeStyle = color; context.lineWidth = wide;
        context.beginPath(); context.arc(x, y, 8, 0, 7); context.stroke();
      }
    }
    if (scale) this.scaleLegend(this.scatterLegend, kinds, scale);
    else {
      NB.clear(this.scatterLegend, kinds.map((kind, index) => (counts[index] || kinds.length < 5
        ? NB.el('span', { class: 'key' }, this.symbol(kind), `${kind[0]}: ${counts[index].toLocaleString('en')}`) : null)));
    }
  }

  padded(axis) {
    const pad = axis.labels ? 0 : 0.02 * (axis.high - axis.low);
    return { ...axis, low: axis.low - pad, high: axis.high + pad };
  }

  shape(context, [, [r, g, b], shape], x, y, size) {
    context.fillStyle = `rgb(${r}, ${g}, ${b})`;
    context.strokeStyle = context.fillStyle;
    context.lineWidth = 1.8;
    if (shape === 'cross') {
      context.beginPath();
      context.moveTo(x - size, y - size); context.lineTo(x + size, y + size);
      context.moveTo(x - size, y + size); context.lineTo(x + size, y - size);
      context.stroke();
    } else if (shape === 'triangle') {
      context.beginPath(); context.moveTo(x, y - size); context.lineTo(x + size, y + size); context.lineTo(x - size, y + size); context.fill();
    } else if (shape === 'dot') {
      context.beginPath(); context.arc(x, y, size * 0.6, 0, 7); context.fill();
    } else context.fillRect(x - size * 0.8, y - size * 0.8, size * 1.6, size * 1.6);
  }

  symbol(kind) {
    const canvas = NB.el('canvas', { width: '14', height: '14', 'aria-hidden': 'true' });
    this.shape(canvas.getContext('2d'), kind, 7, 7, 4.5);
    return canvas;
  }

  scaleLegend(element, kinds, [low, high, title]) {
    const canvas = NB.el('canvas', { width: '160', height: '12', 'aria-hidden': 'true' });
    const context = canvas.getContext('2d');
    for (let x = 0; x < 160; x++) {
      const [r, g, b] = NB.viridis(x / 159);
      context.fillStyle = `rgb(${r}, ${g}, ${b})`;
      context.fillRect(x, 0, 1, 12);
    }
    const none = kinds.find((kind) => kind[0] === 'none');
    NB.clear(element, NB.el('span', { class: 'key' }, `${title}: ${low}`, canvas, high), none ? NB.el('span', { class: 'key' }, this.symbol(none), 'none') : null);
  }

  paintMap(context, width, height) {
    const left = this.axesOf[this.state.y].labels ? 150 : 74;
    const box = { left, top: 10, width: width - left - 14, height: height - 52 };
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    const axes = new NB.Axes(box, xAxis, yAxis);
    const [nx, ny] = [xAxis.bins, yAxis.bins];
    const [ok, of] = [new Uint32Array(nx * ny), new Uint32Array(nx * ny)];
    for (const index of this.indices) {
      const outcome = this.outcome(index);
      if (outcome === 'invalid') continue;
      const cell = this.bin(yAxis, yFactor, index) * nx + this.bin(xAxis, xFactor, index);
      of[cell]++;
      if (outcome === 'ok') ok[cell]++;
    }
    this.mapCells = { axes, nx, ny, ok, of };
    axes.draw(context);
    const [w, h] = [box.width / nx, box.height / ny];
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.font = '11px system-ui, sans-serif';
    for (let cell = 0; cell < nx * ny; cell++) {
      const [x, y] = [box.left + (cell % nx) * w, box.top + box.height - (Math.floor(cell / nx) + 1) * h];
      if (!of[cell]) { context.fillStyle = '#f2f2f2'; context.fillRect(x, y, w, h); continue; }
      const rate = ok[cell] / of[cell];
      const [r, g, b] = NB.viridis(rate);
      context.fillStyle = `rgb(${r}, ${g}, ${b})`;
      context.fillRect(x, y, Math.ceil(w), Math.ceil(h));
      if (w > 27 && h > 14) {
        context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 130 ? '#000' : '#fff';
        // Cells of few cases say so.
        context.fillText(`${Math.round(100 * rate)}${of[cell] < 20 ? '?' : ''}`, x + w / 2, y + h / 2);
      }
    }
    const title = this.state.configuration < 0 ? 'cases in which any configuration is ok, %' : `${this.page.configurations[this.state.configuration]} ok, %`;
    this.scaleLegend(this.mapLegend, [], ['0', '100', title]);
    this.mapLegend.append(NB.el('span', { class: 'soft small', text: '? fewer than 20 cases' }));
  }

  /** Sorted values of every configuration, once for each metric and filter. */
  sort() {
    if (this.sorted) return this.sorted;
    const metric = this.metric(this.state.metric);
    const counted = this.outcomeOf.map((name) => name === 'ok' || name === 'failed');
    this.sorted = this.page.configurations.map((_, c) => {
      const values = new Float32Array(this.indices.length);
      let n = 0;
      for (const index of this.indices) {
        const at = c * this.count + index;
        if (counted[this.outcomes[at]] && !Number.isNaN(metric.values[at])) values[n++] = metric.values[at];
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

  paintEcdf(context, width, height) {
    const metric = this.metric(this.state.metric);
    if (!metric) return;
    const [low, high] = this.valueRange();
    const box = { left: 62, top: 10, width: width - 76, height: height - 52 };
    const axes = new NB.Axes(box, { low, high, title: this.titleOf(metric) }, { low: 0, high: 100, title: 'share of rows below (%)' });
    this.ecdfAxes = axes;
    axes.draw(context);
    context.save();
    context.beginPath(); context.rect(box.left, box.top, box.width, box.height); context.clip();
    this.sort().forEach((values, c) => {
      if (!values.length) return;
      const { color, dash } = NB.configurationStyles[c];
      context.strokeStyle = color;
      context.setLineDash(dash);
      context.lineWidth = this.state.configuration === c ? 3.5 : 1.8;
      context.beginPath();
      const points = Math.min(values.length, 500);
      for (let k = 0; k < points; k++) {
        const at = points > 1 ? Math.round(k * (values.length - 1) / (points - 1)) : 0;
        const [x, y] = [axes.px(values[at]), axes.py(100 * (at + 0.5) / values.length)];
        if (k) context.lineTo(x, y); else context.moveTo(x, y);
      }
      context.stroke();
    });
    context.restore();
    NB.clear(this.ecdfLegend, this.page.configurations.map((label, c) => NB.el('span', { class: 'key' }, NB.sample(NB.configurationStyles[c]), `${label} (${this.sort()[c].length.toLocaleString('en')})`)));
  }

  paintHistogram(context, width, height) {
    const metric = this.metric(this.state.metric);
    if (!metric) return;
    const [low, high] = this.valueRange();
    const c = this.state.configuration;
    const bins = 40;
    const counts = new Uint32Array(bins);
    const add = (value) => {
      const bin = Math.floor((value - low) / (high - low) * bins);
      if (bin >= 0 && bin < bins) counts[bin]++;
    };
    if (c >= 0) this.sort()[c].forEach(add);
    else for (const index of this.indices) { const row = this.row(index); if (row >= 0 && !Number.isNaN(metric.values[row])) add(metric.values[row]); }
    const most = Math.max(...counts, 1);
    const box = { left: 62, top: 10, width: width - 76, height: height - 52 };
    const whose = c < 0 ? 'best of each case' : this.page.configurations[c];
    const axes = new NB.Axes(box, { low, high, title: `${this.titleOf(metric)}, ${whose}` }, { low: 0, high: 1.05 * most, title: 'rows' });
    axes.draw(context);
    context.fillStyle = c < 0 ? '#5a626d' : NB.configurationStyles[c].color;
    counts.forEach((count, bin) => {
      const [x, next] = [axes.px(low + (high - low) * bin / bins), axes.px(low + (high - low) * (bin + 1) / bins)];
      context.fillRect(x + 0.5, axes.py(count), next - x - 1, axes.py(0) - axes.py(count));
    });
  }

  paintStrip(context, width, height) {
    const given = this.page.summary?.overall?.configurations;
    const rates = this.page.configurations.map((label, c) => {
      const found = Array.isArray(given) ? given.find((each) => each.label === label)?.success : null;
      if (found && found.rate !== null) return { label, rate: found.rate, interval: found.interval };
      let [ok, of] = [0, 0];
      for (let index = 0; index < this.count; index++) {
        if (this.invalid[index]) continue;
        of++;
        if (this.outcomeOf[this.outcomes[c * this.count + index]] === 'ok') ok++;
      }
      return { label, rate: of ? ok / of : NaN, interval: null };
    });
    const box = { left: 150, top: 8, width: width - 240, height: height - 50 };
    const axes = new NB.Axes(box, { low: 0, high: 100, title: 'success rate (%)' }, { low: -0.5, high: 7.5, title: '', labels: rates.map((each) => each.label).reverse() });
    axes.draw(context);
    rates.forEach(({ rate, interval }, c) => {
      const y = axes.py(7 - c);
      const h = box.height / 8 * 0.56;
      context.fillStyle = '#56b4e9';
      context.fillRect(box.left, y - h / 2, axes.px(100 * rate) - box.left, h);
      if (interval) {
        context.strokeStyle = '#000';
        context.lineWidth = 1.4;
        const [a, b] = [axes.px(100 * interval.low), axes.px(100 * interval.high)];
        context.beginPath();
        context.moveTo(a, y); context.lineTo(b, y);
        for (const x of [a, b]) { context.moveTo(x, y - 4); context.lineTo(x, y + 4); }
        context.stroke();
      }
      context.fillStyle = '#111';
      context.textAlign = 'left';
      context.textBaseline = 'middle';
      context.fillText(`${NB.fixed(100 * rate, 1)} %`, Math.min(axes.px(100 * (interval ? interval.high : rate)), box.left + box.width) + 8, y);
    });
  }

  /** Pointer: `find` gives `{ text, choose }`. */
  listen(canvas, find) {
    const at = (event) => {
      const box = canvas.canvas.getBoundingClientRect();
      return find(event.clientX - box.left, event.clientY - box.top);
    };
    canvas.canvas.addEventListener('pointermove', (event) => {
      const found = at(event);
      this.tip.hidden = !found;
      if (!found) return;
      this.tip.textContent = found.text;
      this.tip.style.left = `${Math.min(event.pageX + 14, window.innerWidth - 280)}px`;
      this.tip.style.top = `${event.pageY + 12}px`;
    });
    canvas.canvas.addEventListener('pointerleave', () => { this.tip.hidden = true; });
    canvas.canvas.addEventListener('click', (event) => at(event)?.choose());
  }

  nearestPoint(x, y) {
    const axes = this.scatterAxes;
    if (!axes) return null;
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    let [best, least] = [-1, 100];
    for (const index of this.indices) {
      const dx = axes.px(this.place(xAxis, xFactor, index)) - x;
      if (dx > 10 || dx < -10) continue;
      const dy = axes.py(this.place(yAxis, yFactor, index)) - y;
      if (dx * dx + dy * dy < least) { least = dx * dx + dy * dy; best = index; }
    }
    return best < 0 ? null : { text: `case ${this.caseOf(best)}: ${this.outcome(best)}, ${this.working[best]} of 8 work`, choose: () => this.choose(best) };
  }

  nearestOnCurve(px, py) {
    const axes = this.ecdfAxes;
    const metric = this.metric(this.state.metric);
    if (!axes || !metric) return null;
    const [share, value] = [axes.yAt(py) / 100, axes.xAt(px)];
    let [best, least, where] = [-1, 14, 0];
    this.sort().forEach((values, c) => {
      if (!values.length) return;
      const at = Math.min(Math.max(Math.round(share * values.length - 0.5), 0), values.length - 1);
      const away = Math.abs(axes.px(values[at]) - px);
      if (away < least) { least = away; best = c; where = values[at]; }
    });
    if (best < 0) return null;
    return {
      text: `${this.page.configurations[best]}: ${NB.fixed(100 * share, 1)} % below ${NB.fixed(value, 2)}`,
      choose: () => {
        let [found, nearest] = [-1, Infinity];
        for (const index of this.indices) {
          const away = Math.abs(metric.values[best * this.count + index] - where);
          if (away < nearest) { nearest = away; found = index; }
        }
        if (found >= 0) this.choose(found, best);
      },
    };
  }

  cellAt(x, y) {
    if (!this.mapCells) return null;
    const { axes, nx, ny, ok, of } = this.mapCells;
    const cx = Math.floor((x - axes.box.left) / axes.box.width * nx);
    const cy = Math.floor((axes.box.top + axes.box.height - y) / axes.box.height * ny);
    if (cx < 0 || cy < 0 || cx >= nx || cy >= ny) return null;
    const cell = cy * nx + cx;
    return {
      text: of[cell] ? `${ok[cell]} of ${of[cell]} valid cases are ok (${Math.round(100 * ok[cell] / of[cell])} %)` : 'no valid cases',
      choose: () => this.listCell(cx, cy),
    };
  }

  /** The first cases of a cell of the map, those that are not ok first. */
  listCell(cx, cy) {
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    const inside = [...this.indices].filter((index) => this.bin(xAxis, xFactor, index) === cx && this.bin(yAxis, yFactor, index) === cy);
    inside.sort((a, b) => Number(this.outcome(a) === 'ok') - Number(this.outcome(b) === 'ok') || a - b);
    NB.clear(this.cellPanel, NB.el('p', { class: 'small', text: `${inside.length} cases in this cell; the first 40, those that are not ok before others:` }),
      this.caseButtons(inside.slice(0, 40).map((index) => this.caseOf(index))));
  }

  caseButtons(numbers) {
    const buttons = numbers.map((number) => {
      const index = this.indexOf(number);
      return NB.el('button', { type: 'button', class: 'key', disabled: index < 0, title: index < 0 ? 'not on this page' : null, onclick: () => this.choose(index) }, String(number));
    });
    buttons.forEach((button, at) => button.addEventListener('keydown', (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      const next = step && buttons[at + step];
      if (!next || next.disabled) return;
      event.preventDefault();
      next.focus();
      next.click();
    }));
    return NB.el('div', { class: 'legend', role: 'group', 'aria-label': 'Cases' }, buttons);
  }

  choose(index, configuration = null) {
    this.chosen = index;
    this.scatter.draw();
    const number = this.caseOf(index);
    const row = configuration ?? (this.state.configuration >= 0 ? this.state.configuration : Math.max(this.best[index], 0));
    const columns = [
      { title: 'Configuration', cell: (c) => this.page.configurations[c] },
      { title: 'Outcome', cell: (c) => this.outcomeText(index, c) },
      ...this.metrics.map((metric) => ({ title: this.titleOf(metric), numeric: true, help: metric.description, cell: (c) => NB.fixed(metric.values[c * this.count + index], Math.min(Math.max(0, Math.ceil(-Math.log10(metric.column.step))), 3)) })),
    ];
    const table = NB.table('Row: show its posture', columns, [0, 1, 2, 3, 4, 5, 6, 7], { class: 'choose small full' });
    const rows = [...table.querySelectorAll('tbody tr')];
    NB.rows(rows, (c) => { NB.mark(rows, c); this.pose(index, c); });
    NB.mark(rows, row);
    const file = /^[\w./-]+$/.test(this.page.file) ? this.page.file : `'${this.page.file.replaceAll("'", "'\\''")}'`;
    const command = `needlebench study ${file} --case ${number}`;
    const copied = NB.el('span', { class: 'soft', role: 'status' });
    const input = NB.el('input', {
      type: 'number', min: '0', max: String(this.page.cases - 1), value: String(number), 'aria-label': 'Number of the case', style: 'width: 8em',
      onchange: (event) => {
        const to = this.indexOf(Number(event.target.value));
        if (to >= 0) this.choose(to); else copied.textContent = 'that case is not on this page; the command reruns any';
      },
    });
    NB.clear(this.casePanel, NB.el('h3', null, 'Case ', input),
      NB.el('dl', null, this.factors.flatMap((factor) => {
        const value = factor.values[index];
        const text = factor.levels ? factor.levels[value].label : `${NB.fixed(value, 2)} ${factor.unit}`;
        return [NB.el('dt', { text: NB.words(factor.name) }), NB.el('dd', { text })];
      })), table,
      NB.el('p', { class: 'small' }, 'To the last digit, and with all columns: ', NB.el('code', { text: command }), ' ',
        NB.el('button', { type: 'button', class: 'no-print', onclick: () => this.copy(command, copied) }, 'Copy'), ' ', copied));
    this.pose(index, row);
  }

  outcomeText(index, c) {
    const [outcome, detail] = this.page.outcomeNames[this.outcomes[c * this.count + index]];
    const style = { ok: 'good', failed: 'bad', rejected: 'off', invalid: 'off' }[outcome];
    const sign = { ok: '\u2713', failed: '\u2717', rejected: '\u2013', invalid: '\u2205' }[outcome];
    return [NB.el('span', { class: style, text: `${sign} ${outcome}` }), detail ? NB.el('div', { class: 'soft', text: NB.words(detail) }) : ''];
  }

  async copy(text, status) {
    try {
      await navigator.clipboard.writeText(text);
      status.textContent = 'copied';
    } catch {
      status.textContent = 'mark and copy it by hand: this browser does not allow it here';
    }
  }

  makeView() {
    const { scene } = this.page;
    this.viewNote = NB.el('p', { class: 'soft small', role: 'status' });
    if (!scene) return;
    this.view = new NB.View(scene, 'Posture of the chosen configuration');
    this.view.element.style.height = '330px';
    this.arm = this.view.arm('arm');
    for (const layer of ['collision', 'corridor']) this.arm.layer(layer, false);
    this.view.show('gantry', false);
    const [x, y, z] = scene.chain.base;
    const goals = Object.values(this.page.goals || {});
    const targets = goals.map((goal) => goal.target);
    this.view.frame([[x - 0.2, y - 0.2, z - 0.1], [x + 0.2, y + 0.2, z + 0.5], ...targets.flatMap((t) => [t.map((v) => v - 0.25), t.map((v) => v + 0.25)])], goals.length ? NB.direction(scene.chain.base, goals[0].target, goals[0].axis) : [-0.75, 0.45, -0.55]);
  }

  /** The posture of a row, where it is on the page; places of robot and phantom as far as they are known. */
  pose(index, c) {
    if (!this.view) return;
    const at = this.posed.get(index);
    const joints = at === undefined ? null : Array.from(this.poses.subarray((8 * at + c) * 6, (8 * at + c) * 6 + 6), (value) => value * Math.PI / 180);
    const has = Boolean(joints) && joints.every((value) => !Number.isNaN(value));
    const chain = { ...this.page.scene.chain };
    let known = false;
    if (at !== undefined && this.places) {
      const numbers = Array.from(this.places.subarray(14 * at, 14 * at + 14));
      known = !Number.isNaN(numbers[0]);
      if (known) chain.base = numbers.slice(0, 7);
      if (known && this.view.works) this.movePhantom(numbers.slice(7), numbers);
    }
    this.arm.show(has);
    this.view.empty('needle');
    if (has && this.view.works) {
      this.arm.pose(chain, joints);
      const poses = NB.forward(chain, joints);
      const guide = poses[6].clone().multiply(NB.matrix(this.page.scene.guide[1]));
      const point = (z) => new THREE.Vector3(0, 0, z).applyMatrix4(guide).toArray();
      this.view.rod('needle', point(-0.12), point(0.08), 0.0012, [0, 0.45, 0.32, 1]);
    }
    this.viewNote.textContent = [
      has ? `${this.page.configurations[c]} in case ${this.caseOf(index)}.`
        : at === undefined ? 'The posture of this case is not on the page (there is room for some thousand): rerun it by the command.' : 'This configuration has no posture.',
      known ? 'Robot and phantom stand where they do in this case; sizes and tools are those of the base scenario.'
        : 'The surroundings are those of the base scenario: what this case changes of them is not drawn.'].join(' ');
    this.view.draw();
  }

  movePhantom(pose) {
    if (Number.isNaN(pose[0]) || !this.page.phantom) return;
    const move = NB.matrix(pose).multiply(NB.matrix(this.page.phantom).invert());
    for (const name of ['skin', 'bone', 'organ', 'vessel', 'lesion', 'marker']) {
      const group = this.view.group(name);
      group.matrixAutoUpdate = false;
      group.matrix.copy(move);
      group.matrixWorldNeedsUpdate = true;
    }
  }

  /** What the summary has: known parts as tables, all else as lists. */
  statistics() {
    const summary = this.page.summary;
    if (!summary || typeof summary !== 'object') return [];
    const rate = (value) => (value && value.rate !== null && value.rate !== undefined
      ? `${NB.fixed(100 * value.rate, 1)} %${value.interval ? ` (${NB.fixed(100 * value.interval.low, 1)} to ${NB.fixed(100 * value.interval.high, 1)})` : ''}` : '\u2013');
    const done = new Set(['schema_version', 'confidence', 'overall', 'goals', 'spreads', 'effects', 'regions', 'choices', 'evidence', 'notes', 'methods', 'criteria']);
    const sections = [];
    const add = (key, title, open, make) => {
      if (summary[key] === undefined || summary[key] === null) return;
      let content;
      try { content = make(summary[key]); } catch { content = NB.tree(summary[key]); }
      if (content) sections.push(NB.section(title, open, content));
    };
    add('criteria', 'Criteria', true, (criteria) => NB.table('What was checked', [
      { title: 'Criterion', cell: (c) => NB.words(c.criterion) }, { title: 'Of', cell: (c) => c.of || '' },
      { title: 'Value', numeric: true, cell: (c) => NB.significant(c.value) }, { title: 'Limit', numeric: true, cell: (c) => NB.significant(c.limit) },
      { title: 'Met', cell: (c) => NB.el('span', { class: c.pass ? 'good' : 'bad', text: c.pass ? '\u2713 met' : '\u2717 missed' }) },
    ], criteria, { class: 'small' }));
    add('notes', 'Notes', true, (notes) => NB.el('ul', { class: 'plain' }, notes.map((note) => NB.el('li', { text: String(note) }))));
    add('choices', 'Which choice is the best', true, ({ choices, axes }) => NB.table(`Choices of ${axes.map((axis) => NB.words(axis.name)).join(' and ')}, the best first`, [
      { title: 'Choice', cell: (c) => c.label }, { title: 'Cases', numeric: true, cell: (c) => c.cases },
      { title: 'Any works', numeric: true, cell: (c) => rate(c.works) }, { title: 'Enough work', numeric: true, cell: (c) => rate(c.works_k) },
      { title: 'Clearance, 5 %', unit: 'mm', numeric: true, cell: (c) => NB.significant(c.best_clearance_mm?.value) },
      { title: 'Tip error, median', unit: 'mm', numeric: true, cell: (c) => NB.significant(c.tip_error_mm?.value) },
      { title: 'Told apart from the first', cell: (c) => (c.against_first ? (c.against_first.distinguishable ? `yes, ${NB.fixed(100 * c.against_first.difference, 1)} %` : 'no') : '') },
      { title: 'Fails in', cell: (c) => this.caseButtons((c.failing || []).slice(0, 5)) },
    ], choices.slice(0, 60), { class: 'small' }));
    add('overall', 'What became of the configurations', true, (overall) => [overall, ...(summary.goals || [])].map((counts) => NB.table(
      counts.goal ? `Goal ${NB.words(counts.goal)}: ${counts.cases} cases, ${counts.invalid} invalid` : `All goals: ${counts.cases} cases, ${counts.invalid} invalid`, [
        { title: 'Configuration', cell: (c) => c.label }, { title: 'Ok', numeric: true, cell: (c) => c.ok }, { title: 'Failed', numeric: true, cell: (c) => c.failed },
        { title: 'Rejected', numeric: true, cell: (c) => c.rejected }, { title: 'Best', numeric: true, cell: (c) => c.best },
        { title: 'Success', numeric: true, cell: (c) => rate(c.success) }, { title: '', cell: (c) => c.success?.remark || '' },
      ], counts.configurations, { class: 'small' })));
    add('spreads', 'Quantiles', false, (spreads) => {
      const shares = [...new Set(spreads.flatMap((each) => each.quantiles.map((quantile) => quantile.p)))].sort((a, b) => a - b);
      return NB.table('Quantiles with their intervals', [
        { title: 'Metric', cell: (s) => NB.words(s.metric) }, { title: 'Of', cell: (s) => s.of }, { title: 'Values', numeric: true, cell: (s) => s.count },
        { title: 'Mean', numeric: true, cell: (s) => NB.significant(s.mean) },
        ...shares.map((p) => ({ title: p === 0 ? 'least' : p === 1 ? 'largest' : `${NB.significant(100 * p)} %`, numeric: true, cell: (s) => {
          const found = s.quantiles.find((quantile) => quantile.p === p);
          return found ? NB.el('span', { title: found.interval ? `${NB.significant(found.interval.low)} to ${NB.significant(found.interval.high)}` : found.remark || '', text: NB.significant(found.value) }) : '';
        } })),
      ], spreads, { class: 'small' });
    });
    add('effects', 'What the factors do', false, (effects) => effects.responses.map((response) => NB.el('div', null,
      NB.table(`${NB.words(response.response)}: share of its variance`, [
        { title: 'Factor', cell: (m) => NB.words(effects.axes[m.axis].name) },
        { title: 'Share', unit: '%', numeric: true, cell: (m) => NB.fixed(m.share === null ? NaN : 100 * m.share, 1) },
        { title: 'By chance', unit: '%', numeric: true, cell: (m) => NB.fixed(m.noise === null ? NaN : 100 * m.noise, 1) },
        { title: 'Mean over the factor', cell: (m) => NB.trend(m.bins.map((bin) => bin.mean)) },
      ], [...response.main].sort((a, b) => (b.share || 0) - (a.share || 0)), { class: 'small' }),
      response.interactions.length ? NB.table('Interactions', [
        { title: 'Factors', cell: (m) => m.axes.map((axis) => NB.words(effects.axes[axis].name)).join(' and ') },
        { title: 'Share', unit: '%', numeric: true, cell: (m) => NB.fixed(100 * m.share, 1) },
        { title: 'By chance', unit: '%', numeric: true, cell: (m) => NB.fixed(100 * m.noise, 1) },
      ], response.interactions, { class: 'small' }) : null)));
    add('evidence', 'Cases worth a look', true, (evidence) => this.evidence(evidence));
    add('regions', 'Best configuration by region', false, (regions) => regions.maps.filter((map) => map.axes.length === 1).map((map) => {
      const axis = regions.axes[map.axes[0]];
      return NB.table(`Over ${NB.words(axis.name)}${axis.unit ? ` (${axis.unit})` : ''}`, [
        { title: 'From', cell: ({ bin }) => bin.label }, { title: 'Layouts', numeric: true, cell: ({ cell }) => cell.layouts },
        { title: 'Any works', unit: '%', numeric: true, cell: ({ cell }) => NB.fixed(100 * cell.working / cell.layouts, 1) },
        { title: 'Most often the best', cell: ({ cell }) => cell.winner || 'none stands out' },
      ], map.cells.map((cell, at) => ({ cell, bin: axis.bins[at] })), { class: 'small' });
    }));
    for (const [key, value] of Object.entries(summary)) {
      if (!done.has(key)) sections.push(NB.section(NB.words(key), false, NB.tree(value)));
    }
    add('methods', 'Methods', false, (methods) => NB.table('How the numbers were found', [
      { title: 'Numbers', cell: (m) => m.numbers }, { title: 'Method', text: true, cell: (m) => m.method }, { title: 'Source', text: true, cell: (m) => m.source },
    ], methods, { class: 'small' }));
    if (this.page.manifest) sections.push(NB.section('Where the numbers come from', false, NB.tree(this.page.manifest)));
    sections.push(NB.section('Precision of this page', false, NB.el('ul', { class: 'plain' },
      [...this.factors.filter((factor) => !factor.levels), ...this.metrics].map((each) => NB.el('li', { text: `${NB.words(each.name)}: to \u00b1 ${NB.significant(each.column.step / 2)}` })))));
    return sections;
  }

  evidence(evidence) {
    const parts = [];
    const walk = (value, title) => {
      if (Array.isArray(value) && value.length && value.every((each) => Number.isInteger(each))) {
        parts.push(NB.el('p', { class: 'small', text: title }), this.caseButtons(value.slice(0, 20)));
      } else if (Array.isArray(value) && value.length && value.every((each) => each && Number.isInteger(each.case))) {
        parts.push(NB.el('p', { class: 'small', text: `${title}: ${value.slice(0, 5).map((each) => NB.significant(each.value)).join(', ')}${value.length > 5 ? ' \u2026' : ''}` }), this.caseButtons(value.slice(0, 20).map((each) => each.case)));
      } else if (Array.isArray(value)) {
        value.forEach((each, at) => walk(each, `${title}${each && (each.of || each.metric) ? ` ${NB.words(each.of || each.metric)}` : value.length > 1 ? ` ${at + 1}` : ''}`));
      } else if (value && typeof value === 'object') {
        for (const [key, each] of Object.entries(value)) if (typeof each === 'object') walk(each, `${title ? `${title}, ` : ''}${NB.words(key)}`);
      }
    };
    walk(evidence, '');
    return NB.el('div', null, parts);
  }
};

/** A small curve for a table. */
NB.trend = function (values) {
  const canvas = NB.el('canvas', { width: '140', height: '26', role: 'img', 'aria-label': values.map((value) => NB.significant(value)).join(', ') });
  const context = canvas.getContext('2d');
  const known = values.filter((value) => value !== null);
  const [low, high] = [Math.min(...known), Math.max(...known)];
  context.strokeStyle = '#0072b2';
  context.fillStyle = '#0072b2';
  context.lineWidth = 1.6;
  context.beginPath();
  values.forEach((value, k) => {
    if (value === null) return;
    const x = values.length > 1 ? 4 + 132 * k / (values.length - 1) : 70;
    const y = high > low ? 22 - 18 * (value - low) / (high - low) : 13;
    context.lineTo(x, y);
    context.fillRect(x - 1.5, y - 1.5, 3, 3);
  });
  context.stroke();
  return NB.el('span', null, canvas, NB.el('span', { class: 'soft small', text: known.length ? ` ${NB.significant(low)} to ${NB.significant(high)}` : '' }));
};

NB.start((page, app) => { NB.current = new NB.StudyPage(page, app); });

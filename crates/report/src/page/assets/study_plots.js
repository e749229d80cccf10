// The plots of a study.
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

/** What a study's page draws: colours, scatter, map, shares, histogram, rates. */
NB.StudyPlots = class {
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
};

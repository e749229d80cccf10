// Plots on a canvas.
'use strict';

/** Round numbers between two ends, about `count` of them. */
NB.ticks = (low, high, count) => {
  if (!(high > low)) return { at: [low], step: 1 };
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough) || 10 * power;
  const at = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) at.push(k * step);
  return { at, step };
};

NB.tickText = (value, step) => {
  const digits = Math.max(0, Math.min(8, -Math.floor(Math.log10(step) + 1e-9)));
  return NB.minus(value.toFixed(digits));
};

/** A canvas that fills its box and is sharp on any screen; `paint(context, width, height)`. */
class Canvas {
  /** @param {number} height @param {string} label @param {Paint} paint */
  constructor(height, label, paint) {
    this.canvas = NB.el('canvas', { role: 'img', 'aria-label': label });
    this.element = NB.el('div', { class: 'plot', style: `height:${height}px` }, this.canvas);
    this.paint = paint;
    new ResizeObserver(() => this.render()).observe(this.element);
  }

  draw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => this.render());
  }

  render() {
    if (this.asked) cancelAnimationFrame(this.asked);
    this.asked = 0;
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    const ratio = Math.max(window.devicePixelRatio || 1, 1);
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const started = performance.now();
    // Software canvases: the scatter writes pixels itself.
    const context = NB.context(this.canvas, { willReadFrequently: true });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = '12px system-ui, sans-serif';
    this.paint(context, width, height);
    this.paintedInMs = performance.now() - started;
  }
}

/** Axes of a plot: maps values to pixels and draws frame, ticks and titles. */
class Axes {
  /** @param {Box} box @param {AxisRange} x @param {AxisRange} y */
  constructor(box, x, y) {
    this.box = box;
    this.x = x;
    this.y = y;
  }

  /** @param {number} value */
  px(value) {
    return this.box.left + ((value - this.x.low) / (this.x.high - this.x.low)) * this.box.width;
  }

  /** @param {number} value */
  py(value) {
    return this.box.top + (1 - (value - this.y.low) / (this.y.high - this.y.low)) * this.box.height;
  }

  /** @param {number} px */
  xAt(px) {
    return this.x.low + ((px - this.box.left) / this.box.width) * (this.x.high - this.x.low);
  }

  /** @param {number} py */
  yAt(py) {
    return this.y.low + (1 - (py - this.box.top) / this.box.height) * (this.y.high - this.y.low);
  }

  /**
   * Where an axis has ticks, and their texts: about `count` of them where it has no labels.
   * @param {AxisRange} axis
   * @param {number} count
   */
  ticks({ low, high, labels }, count) {
    if (labels) return labels.map((text, at) => ({ at, text }));
    const { at, step } = NB.ticks(low, high, count);
    return at.map((each) => ({ at: each, text: NB.tickText(each, step) }));
  }

  /** @param {Painter} context */
  draw(context) {
    const { left, top, width, height } = this.box;
    context.save();
    context.strokeStyle = '#e3e6ea';
    context.fillStyle = '#333';
    context.lineWidth = 1;
    context.textBaseline = 'middle';
    context.textAlign = 'right';
    for (const { at: value, text } of this.ticks(this.y, height / 38)) {
      const at = Math.round(this.py(value)) + 0.5;
      context.beginPath();
      context.moveTo(left, at);
      context.lineTo(left + width, at);
      context.stroke();
      context.fillText(this.fit(context, text, left - 26), left - 6, at);
    }
    context.textAlign = 'center';
    context.textBaseline = 'top';
    const space = this.x.labels ? width / this.x.labels.length - 6 : 60;
    for (const { at: value, text } of this.ticks(this.x, width / 60)) {
      const at = Math.round(this.px(value)) + 0.5;
      context.beginPath();
      context.moveTo(at, top);
      context.lineTo(at, top + height);
      context.stroke();
      context.fillText(this.fit(context, text, space), at, top + height + 5);
    }
    context.strokeStyle = '#8a9099';
    context.strokeRect(left + 0.5, top + 0.5, width, height);
    context.fillStyle = '#111';
    context.fillText(this.x.title, left + width / 2, top + height + 21);
    context.translate(12, top + height / 2);
    context.rotate(-Math.PI / 2);
    context.textBaseline = 'middle';
    context.fillText(this.fit(context, this.y.title, height), 0, 0);
    context.restore();
  }

  /** @param {Painter} context @param {string} text @param {number} width */
  fit(context, text, width) {
    let cut = String(text);
    if (context.measureText(cut).width <= width) return cut;
    while (cut.length > 1 && context.measureText(`${cut}\u2026`).width > width) cut = cut.slice(0, -1);
    return `${cut}\u2026`;
  }
}

/** Colour and dash of each class of clearance. */
NB.classStyle = {
  robot_phantom: { color: NB.palette.vermillion, dash: [] },
  tool_phantom: { color: NB.palette.orange, dash: [] },
  guide_standoff: { color: NB.palette.orange, dash: [3, 3] },
  robot_table: { color: NB.palette.blue, dash: [] },
  robot_gantry: { color: NB.palette.sky, dash: [] },
  robot_mount: { color: NB.palette.green, dash: [] },
  robot_obstacle: { color: NB.palette.green, dash: [3, 3] },
  robot_person: { color: NB.palette.blue, dash: [3, 3] },
  self: { color: NB.palette.purple, dash: [] },
  needle_corridor: { color: NB.palette.grey, dash: [6, 3] },
  needle_route: { color: NB.palette.black, dash: [2, 4] },
};
NB.styleOf = (name) => NB.classStyle[name] || { color: NB.palette.black, dash: [] };

/** A short sample of a line for legends. */
NB.sample = ({ color, dash }) => {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('width', '28');
  svg.setAttribute('height', '10');
  svg.setAttribute('aria-hidden', 'true');
  const line = document.createElementNS('http://www.w3.org/2000/svg', 'line');
  for (const [name, value] of Object.entries({
    x1: 1,
    y1: 5,
    x2: 27,
    y2: 5,
    stroke: color,
    'stroke-width': 2.5,
    'stroke-dasharray': dash.join(' '),
  })) {
    line.setAttribute(name, String(value));
  }
  svg.append(line);
  return svg;
};

/** Curves over one variable with a cursor that follows and leads. */
class Curves {
  /**
   * `options`: height, label, xTitle, yTitle, seek(x).
   * @param {CurvesOptions} options
   */
  constructor(options) {
    this.options = options;
    /** @type {Curve[]} */
    this.curves = [];
    /** @type {Band[]} */
    this.bands = [];
    /** @type {Set<string>} */
    this.hidden = new Set();
    this.cursor = null;
    this.whole = false;
    /** @type {[from: number, to: number]} */
    this.range = [0, 1];
    // The first curve of each name, and its value at the cursor.
    /** @type {Map<string, { curve: Curve, value: HTMLElement }>} */
    this.named = new Map();
    this.canvas = new Canvas(options.height, options.label, (...all) => this.paint(...all));
    this.legend = NB.el('div', { class: 'legend', role: 'group', 'aria-label': 'Curves' });
    this.element = NB.el('div', { class: 'curves' }, this.canvas.element, this.legend);
    /** @param {PointerEvent} event */
    const seek = (event) => {
      if (!this.axes || !(event.buttons & 1)) return;
      const x = this.axes.xAt(event.clientX - this.canvas.canvas.getBoundingClientRect().left);
      options.seek(Math.min(Math.max(x, this.axes.x.low), this.axes.x.high));
    };
    this.canvas.canvas.addEventListener('pointerdown', seek);
    this.canvas.canvas.addEventListener('pointermove', seek);
  }

  /**
   * `curves` of `{ name, group, x, y, color, dash, width }`; `bands` of `{ from, to, text, color }`.
   * @param {Curve[]} curves
   * @param {Band[]} bands
   * @param {[from: number, to: number]} range
   */
  set(curves, bands, range) {
    this.curves = curves;
    this.bands = bands;
    this.range = range;
    this.named.clear();
    for (const curve of curves)
      if (!this.named.has(curve.name)) this.named.set(curve.name, { curve, value: NB.el('span', { class: 'value' }) });
    NB.clear(
      this.legend,
      [...this.named].map(([name, { curve, value }]) => {
        const button = NB.el(
          'button',
          {
            type: 'button',
            class: 'key',
            'aria-pressed': String(!this.hidden.has(name)),
            title: 'Show or hide this curve',
            onclick: () => {
              if (!this.hidden.delete(name)) this.hidden.add(name);
              button.setAttribute('aria-pressed', String(!this.hidden.has(name)));
              this.draw();
            },
          },
          NB.sample(curve),
          NB.words(name),
          value,
        );
        return button;
      }),
      NB.checkbox('full range', this.whole, (on) => {
        this.whole = on;
        this.draw();
      }),
    );
    this.draw();
  }

  /**
   * The curves as they are shown, for a paper.
   * @param {string} title
   */
  svg(title) {
    const shown = [...this.named].filter(([name]) => !this.hidden.has(name));
    /** @type {Mark[]} */
    const legend = shown.map(([name, { curve }]) => ({
      text: NB.words(name),
      draw: (context, x, y) => {
        context.strokeStyle = curve.color;
        context.lineWidth = 1.8;
        context.setLineDash(curve.dash);
        context.beginPath();
        context.moveTo(x - 14, y);
        context.lineTo(x + 14, y);
        context.stroke();
      },
    }));
    const svg = NB.paper(title, (...all) => this.paint(...all), 220, legend);
    // The axes were those of the paper.
    this.draw();
    return svg;
  }

  /**
   * The values of the first curve of each name at the cursor.
   * @param {number | null} x
   */
  seek(x) {
    this.cursor = x;
    for (const { curve, value } of this.named.values()) {
      const y = x === null ? NaN : NB.at(curve.x, curve.y, x);
      value.textContent = Number.isNaN(y) ? '' : `${NB.fixed(y, 1)} ${this.options.unit || 'mm'}`;
    }
    this.draw();
  }

  draw() {
    this.canvas.draw();
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paint(context, width, height) {
    const shown = this.curves.filter((curve) => !this.hidden.has(curve.name));
    let [low, high] = [0, 1];
    for (const { y } of shown) {
      for (const value of y) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    // What matters is near zero.
    if (!this.whole) {
      high = Math.min(high, 120);
      low = Math.max(low, -60);
    }
    const pad = 0.06 * (high - low);
    const box = { left: 58, top: 18, width: width - 72, height: height - 58 };
    const axes = new Axes(
      box,
      { low: this.range[0], high: this.range[1], title: this.options.xTitle },
      { low: low - pad, high: high + pad, title: this.options.yTitle },
    );
    this.axes = axes;
    context.save();
    for (const { from, to, text, color } of this.bands) {
      const [a, b] = [axes.px(from), axes.px(to)];
      context.fillStyle = color;
      context.fillRect(a, box.top, b - a, box.height);
      context.fillStyle = '#444';
      context.textAlign = 'center';
      context.textBaseline = 'bottom';
      context.fillText(axes.fit(context, text, b - a + 4), (a + b) / 2, box.top - 3);
    }
    context.restore();
    axes.draw(context);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    context.fillStyle = 'rgba(213, 94, 0, 0.10)';
    context.fillRect(box.left, axes.py(0), box.width, box.height);
    context.strokeStyle = NB.palette.vermillion;
    context.beginPath();
    context.moveTo(box.left, axes.py(0));
    context.lineTo(box.left + box.width, axes.py(0));
    context.stroke();
    for (const { x, y, color, dash, width: wide } of shown) {
      context.strokeStyle = color;
      context.lineWidth = wide || 1.8;
      context.setLineDash(dash);
      context.beginPath();
      let drawing = false;
      for (let k = 0; k < x.length; k++) {
        if (Number.isNaN(y[k])) {
          drawing = false;
          continue;
        }
        if (drawing) context.lineTo(axes.px(x[k]), axes.py(y[k]));
        else context.moveTo(axes.px(x[k]), axes.py(y[k]));
        drawing = true;
      }
      context.stroke();
    }
    context.setLineDash([]);
    if (this.cursor !== null) {
      context.strokeStyle = '#111';
      context.lineWidth = 1;
      const at = Math.round(axes.px(this.cursor)) + 0.5;
      context.beginPath();
      context.moveTo(at, box.top);
      context.lineTo(at, box.top + box.height);
      context.stroke();
      context.fillStyle = '#111';
      for (const { x, y } of shown) {
        const value = NB.at(x, y, this.cursor);
        if (Number.isNaN(value)) continue;
        context.beginPath();
        context.arc(at, axes.py(value), 2.5, 0, 7);
        context.fill();
      }
    }
    context.restore();
  }
}

/** Linear in between; NaN beside none. */
NB.at = (x, y, at) => {
  if (!x.length) return NaN;
  let [low, high] = [0, x.length - 1];
  if (at <= x[low]) return y[low];
  if (at >= x[high]) return y[high];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle;
    else high = middle;
  }
  return y[low] + ((y[high] - y[low]) * (at - x[low])) / (x[high] - x[low]);
};

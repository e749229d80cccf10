// Figures of a study: on the screen, and as SVG for a paper.
'use strict';

/** A plot with its title, its legend and a button that saves it as SVG, 85 mm wide with letters of 8 pt.
 *
 * `paint(context, width, height)` draws it, `height` is a number or a function of the width; `legend()` gives
 * `{ text, draw(context, x, y) }`, or `{ low, high, text, color(share) }` of a scale. */
class Figure {
  /** @param {FigureOptions} options */
  constructor({ name, title, help, label, height, paint, legend }) {
    this.name = name;
    this.title = title;
    this.height = height;
    this.paint = paint;
    this.legend = legend;
    this.legendElement = NB.el('div', { class: 'legend' });
    this.canvas = new Canvas(this.heightAt(700), label || title, (context, width, all) => {
      paint(context, width, all);
      this.showLegend();
    });
    const saved = NB.saveButton('SVG', title, () => [`${NB.fileName(name)}.svg`, this.svg(), 'image/svg+xml']);
    this.element = NB.el(
      'section',
      { class: 'panel points' },
      NB.el('div', { class: 'figure-head' }, NB.el('h3', { text: title }), saved),
      help ? NB.el('p', { class: 'soft small', text: help }) : null,
      this.canvas.element,
      this.legendElement,
    );
    if (typeof height === 'function') {
      new ResizeObserver(() => {
        const wanted = `${this.heightAt(this.canvas.element.clientWidth)}px`;
        if (this.canvas.element.style.height !== wanted) this.canvas.element.style.height = wanted;
      }).observe(this.canvas.element);
    }
  }

  /** @param {number} width */
  heightAt(width) {
    return typeof this.height === 'function' ? this.height(width) : this.height;
  }

  draw() {
    this.canvas.draw();
  }

  render() {
    this.canvas.render();
  }

  get paintedInMs() {
    return this.canvas.paintedInMs;
  }

  showLegend() {
    const items = this.legend ? this.legend() : [];
    NB.clear(
      this.legendElement,
      items.map((item) => {
        const canvas = NB.el('canvas', { width: item.color ? '120' : '18', height: '14', 'aria-hidden': 'true' });
        const context = NB.context(canvas);
        if (!item.color) {
          item.draw(context, 9, 7);
          return NB.el('span', { class: 'key' }, canvas, item.text);
        }
        this.scale(context, item, 0, 1, 120);
        return NB.el('span', { class: 'key' }, `${item.text}: ${item.low}`, canvas, item.high);
      }),
    );
  }

  /** @param {Painter} context @param {Scale} scale @param {number} x @param {number} y @param {number} width */
  scale(context, { color }, x, y, width) {
    for (let k = 0; k < width; k += 2) {
      context.fillStyle = color((k + 0.5) / width);
      context.fillRect(x + k, y, 2, 12);
    }
  }

  /** The figure for a column of a journal, with its legend below it. */
  svg() {
    const width = NB.COLUMN.px;
    /** @type {Mark[]} */
    const legend = (this.legend ? this.legend() : []).map((item) =>
      item.color
        ? {
            text: `${item.text}: ${item.low} to ${item.high}`,
            draw: (context, x, y) => this.scale(context, item, x - 15, y - 6, 30),
          }
        : item,
    );
    return NB.paper(
      this.title,
      this.paint,
      Math.min(this.heightAt(width), 0.85 * width + 40),
      legend.flatMap(NB.folded),
    );
  }
}

/** A line of a legend that fits a column, as several where it is long. */
NB.folded = (item) => {
  const ruler = new SvgContext(1, 1, 1);
  const lines = [''];
  for (const word of item.text.split(' ')) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (ruler.measureText(longer).width <= NB.COLUMN.px - 48) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines.map((text, at) => ({ text, draw: at ? () => {} : item.draw }));
};

/** Height of a row of a dot plot: where there is little width its label stands above it. */
NB.dotRow = (width) => (width < 560 ? 34 : 25);
NB.dotHeight = (rows) => (width) => rows * NB.dotRow(width) + 54;

/**
 * Values with their intervals, one a row: `rows` of `{ label, value, interval, text, style }`, `x` of
 * `{ low, high, title }`.
 */
NB.dotPlot = (context, width, height, rows, x) => {
  const narrow = width < 560;
  const [left, right] = narrow ? [8, 14] : [Math.min(0.3 * width, 250), 150];
  const box = { left, top: 6, width: width - left - right, height: height - 50 };
  const axes = new Axes(box, x, { low: -0.5, high: rows.length - 0.5, title: '', labels: [] });
  axes.draw(context);
  const pitch = box.height / Math.max(rows.length, 1);
  rows.forEach(({ label, value, interval, text, style }, at) => {
    const middle = box.top + (at + 0.5) * pitch;
    const y = narrow ? middle + 8 : middle;
    const color = style || '#0072b2';
    if (narrow) {
      // The line of the grid would run through the words.
      context.fillStyle = context.isPaper ? '#fff' : '#f7f8fa';
      context.fillRect(box.left + 1, middle - 15, box.width - 1, 15);
    }
    const known = value !== null && value !== undefined && !Number.isNaN(value);
    if (interval) {
      context.strokeStyle = '#333';
      context.lineWidth = 1.4;
      const [a, b] = [axes.px(interval.low), axes.px(interval.high)];
      context.beginPath();
      context.moveTo(a, y);
      context.lineTo(b, y);
      for (const end of [a, b]) {
        context.moveTo(end, y - 4);
        context.lineTo(end, y + 4);
      }
      context.stroke();
    }
    if (known) {
      context.fillStyle = color;
      context.beginPath();
      context.arc(axes.px(value), y, 4.5, 0, 2 * Math.PI);
      context.fill();
    }
    context.fillStyle = '#111';
    context.textBaseline = 'middle';
    const words = known ? text : '\u2013';
    if (narrow) {
      const room = box.width - context.measureText(words).width - 14;
      context.textAlign = 'left';
      context.fillText(axes.fit(context, label, room), box.left + 4, middle - 7);
      context.textAlign = 'right';
      context.fillText(words, box.left + box.width - 3, middle - 7);
    } else {
      context.textAlign = 'right';
      context.fillText(axes.fit(context, label, left - 12), left - 8, y);
      context.textAlign = 'left';
      context.fillText(words, box.left + box.width + 8, y);
    }
  });
};

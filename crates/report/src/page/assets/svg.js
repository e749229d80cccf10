// Figures for papers: what plots draw on a canvas, as SVG.
'use strict';

/** A column of a journal, and the size of its letters: 85 mm at 96 points to the inch, 8 pt. */
NB.COLUMN = { mm: 85, px: (85 / 25.4) * 96, font: (8 / 72) * 96 };

/** A canvas context that writes SVG; only what the plots use. */
class SvgContext {
  /** @param {number} width @param {number} height @param {number} mm */
  constructor(width, height, mm) {
    /** @type {[width: number, height: number, mm: number]} */
    this.size = [width, height, mm];
    /** @type {string[]} */
    this.parts = [];
    this.path = '';
    /** @type {PaperState} */
    this.state = {
      fillStyle: '#000',
      strokeStyle: '#000',
      lineWidth: 1,
      dash: [],
      textAlign: 'left',
      textBaseline: 'alphabetic',
      font: `${NB.COLUMN.font}px Helvetica, Arial, sans-serif`,
      move: '',
      clip: '',
    };
    /** @type {PaperState[]} */
    this.stack = [];
    this.clips = 0;
    this.ruler = NB.context(NB.el('canvas'));
    /** @type {(keyof PaperState)[]} */
    const settings = ['fillStyle', 'strokeStyle', 'lineWidth', 'textAlign', 'textBaseline', 'font'];
    for (const name of settings) {
      Object.defineProperty(this, name, {
        get: () => this.state[name],
        set: (value) => {
          Object.assign(this.state, { [name]: value });
        },
      });
    }
    this.isPaper = true;
  }

  save() {
    this.stack.push({ ...this.state });
  }

  restore() {
    this.state = this.stack.pop() || this.state;
  }

  /** @param {number} x @param {number} y */
  translate(x, y) {
    this.state.move += ` translate(${NB.short(x)} ${NB.short(y)})`;
  }

  /** @param {number} angle */
  rotate(angle) {
    this.state.move += ` rotate(${NB.short((angle * 180) / Math.PI)})`;
  }

  /** @param {number[]} dash */
  setLineDash(dash) {
    this.state.dash = dash;
  }

  beginPath() {
    this.path = '';
  }

  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    this.path += `M${NB.short(x)} ${NB.short(y)}`;
  }

  /** @param {number} x @param {number} y */
  lineTo(x, y) {
    this.path += `${this.path ? 'L' : 'M'}${NB.short(x)} ${NB.short(y)}`;
  }

  closePath() {
    this.path += 'Z';
  }

  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  rect(x, y, w, h) {
    this.path += `M${NB.short(x)} ${NB.short(y)}h${NB.short(w)}v${NB.short(h)}h${NB.short(-w)}Z`;
  }

  /** @param {number} x @param {number} y @param {number} r @param {number} from @param {number} to */
  arc(x, y, r, from, to) {
    /** @param {number} angle */
    const at = (angle) => [NB.short(x + r * Math.cos(angle)), NB.short(y + r * Math.sin(angle))];
    if (to - from >= 2 * Math.PI - 1e-6) {
      const [a, b] = [at(0), at(Math.PI)];
      this.path +=
        `M${a.join(' ')}A${NB.short(r)} ${NB.short(r)} 0 1 1 ${b.join(' ')}A${NB.short(r)} ${NB.short(r)} 0 1 1 ` +
        `${a.join(' ')}Z`;
      return;
    }
    const [a, b] = [at(from), at(to)];
    this.path +=
      `${this.path ? 'L' : 'M'}${a.join(' ')}A${NB.short(r)} ${NB.short(r)} 0 ${to - from > Math.PI ? 1 : 0} 1 ` +
      `${b.join(' ')}`;
  }

  /** @param {string} tag @param {object} attributes */
  put(tag, attributes, text = '') {
    const { move, clip } = this.state;
    const all = { ...attributes, transform: move.trim() || null, 'clip-path': clip ? `url(#${clip})` : null };
    const written = Object.entries(all)
      .filter(([, value]) => value !== null)
      .map(([name, value]) => ` ${name}="${NB.xml(value)}"`)
      .join('');
    this.parts.push(text ? `<${tag}${written}>${NB.xml(text)}</${tag}>` : `<${tag}${written}/>`);
  }

  fill() {
    if (this.path) this.put('path', { d: this.path, fill: this.state.fillStyle });
  }

  stroke() {
    const { strokeStyle, lineWidth, dash } = this.state;
    if (this.path)
      this.put('path', {
        d: this.path,
        fill: 'none',
        stroke: strokeStyle,
        'stroke-width': lineWidth,
        'stroke-dasharray': dash.length ? dash.join(' ') : null,
      });
  }

  clip() {
    const id = `clip${++this.clips}`;
    this.parts.push(`<clipPath id="${id}"><path d="${this.path}"/></clipPath>`);
    this.state.clip = id;
  }

  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  fillRect(x, y, w, h) {
    this.put('path', {
      d: `M${NB.short(x)} ${NB.short(y)}h${NB.short(w)}v${NB.short(h)}h${NB.short(-w)}Z`,
      fill: this.state.fillStyle,
    });
  }

  /** @param {number} x @param {number} y @param {number} w @param {number} h */
  strokeRect(x, y, w, h) {
    const path = this.path;
    this.beginPath();
    this.rect(x, y, w, h);
    this.stroke();
    this.path = path;
  }

  /** @param {string} text */
  measureText(text) {
    this.ruler.font = this.state.font;
    return this.ruler.measureText(text);
  }

  /** @param {string} text @param {number} x @param {number} y */
  fillText(text, x, y) {
    const [, size, family] = /** @type {string[]} */ (this.state.font.match(/([\d.]+)px (.*)$/));
    /** @type {{ [align: string]: string }} */
    const anchors = { left: 'start', center: 'middle', right: 'end' };
    // Not every reader of SVG knows baselines.
    /** @type {{ [baseline: string]: number }} */
    const drops = { middle: 0.35, top: 0.8, bottom: -0.2, alphabetic: 0 };
    const drop = drops[this.state.textBaseline] * Number(size);
    this.put(
      'text',
      {
        x: NB.short(x),
        y: NB.short(y + drop),
        fill: this.state.fillStyle,
        'font-size': size,
        'font-family': family,
        'text-anchor': anchors[this.state.textAlign],
        'font-weight': /bold|600/.test(this.state.font) ? 'bold' : null,
      },
      String(text),
    );
  }

  /** @param {string} title */
  svg(title) {
    const [width, height, mm] = this.size;
    return (
      `<svg xmlns="http://www.w3.org/2000/svg" width="${mm}mm" height="${NB.short((mm * height) / width)}mm" ` +
      `viewBox="0 0 ${NB.short(width)} ${NB.short(height)}">\n` +
      `<title>${NB.xml(title)}</title>\n<rect width="100%" height="100%" ` +
      `fill="#fff"/>\n${this.parts.join('\n')}\n</svg>\n`
    );
  }
}

NB.short = (value) => String(Math.round(value * 100) / 100);
NB.xml = (text) =>
  String(text).replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('>', '&gt;').replaceAll('"', '&quot;');

/** Saves a text or a blob as a file. */
NB.save = (name, content, type) => {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  NB.el('a', { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
};

/** A file's name from words. */
NB.fileName = (...words) =>
  words
    .filter(Boolean)
    .join('_')
    .replace(/[^A-Za-z0-9.-]+/g, '_');

/** A button that saves a figure; `file()` gives `[name, content, type]`. */
NB.saveButton = (text, title, file) =>
  NB.el(
    'button',
    {
      type: 'button',
      class: 'no-print save',
      'aria-label': `${title}: save as ${text}`,
      title: `Save as ${text}`,
      onclick: async () => NB.save(...(await file())),
    },
    text,
  );

/**
 * A plot for a column of a journal: `paint(context, width, height)` draws it, `legend` of
 * `{ text, draw(context, x, y) }` stands below.
 */
NB.paper = (title, paint, height, legend = []) => {
  const { px: width, font, mm } = NB.COLUMN;
  const line = 1.45 * font;
  const context = new SvgContext(width, height + legend.length * line + (legend.length ? 6 : 0), mm);
  paint(context, width, height);
  context.setLineDash([]);
  legend.forEach((item, at) => {
    const y = height + 4 + (at + 0.5) * line;
    item.draw(context, 20, y);
    context.setLineDash([]);
    context.fillStyle = '#111';
    context.textAlign = 'left';
    context.textBaseline = 'middle';
    context.fillText(item.text, 42, y);
  });
  return context.svg(title);
};

/** A chart of the program, in a box of its own width, with a button that saves it. */
NB.chart = (title, svg, name, help) => {
  const [, width, height] = /** @type {string[]} */ (svg.match(/viewBox="0 0 ([\d.]+) ([\d.]+)"/)).map(Number);
  const image = NB.el('img', {
    src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`,
    alt: title,
    width: String(Math.round(width)),
    height: String(Math.round(height)),
  });
  image.style.maxWidth = `${Math.round(1.2 * width)}px`;
  image.style.minWidth = `${Math.round(Math.min(width, Math.max(440, 0.6 * width)))}px`;
  return NB.el(
    'figure',
    { class: 'chart' },
    NB.el(
      'figcaption',
      null,
      NB.el('span', { text: title }),
      NB.saveButton('SVG', title, () => [`${name}.svg`, svg, 'image/svg+xml']),
    ),
    help ? NB.el('p', { class: 'soft small', text: help }) : null,
    NB.scroll(title, image),
  );
};

/** A button that saves what a view shows, labels included; `name` may be a function. */
NB.pngButton = (view, title, name) =>
  view.works
    ? NB.saveButton('PNG', title, async () => {
        view.snapshot();
        const bytes = Uint8Array.from(atob(view.image.src.split(',')[1]), (character) => character.charCodeAt(0));
        const blob = new Blob([bytes], { type: 'image/png' });
        return [`${typeof name === 'function' ? name() : name}.png`, blob];
      })
    : '';

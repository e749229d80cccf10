// What all pages share: reading the payload, building elements, writing numbers.
'use strict';

const NB = /** @type {Needlebench} */ ({});

/** Milliseconds at which the page was opened and first drawn; for tests. */
NB.timing = { opened: performance.now() };

/** Okabe and Ito's colours, which people with any colour vision tell apart. */
NB.palette = {
  black: '#000000',
  orange: '#e69f00',
  sky: '#56b4e9',
  green: '#009e73',
  yellow: '#f0e442',
  blue: '#0072b2',
  vermillion: '#d55e00',
  purple: '#cc79a7',
  grey: '#767676',
};

/** An element. Attributes starting with `on` are listeners; text goes in as text, never as markup. */
NB.el = (tag, attributes, ...children) => {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    else if (name === 'text') element.textContent = String(value);
    else if (name === 'value' || name === 'checked' || name === 'disabled' || name === 'selected')
      Object.assign(element, { [name]: value });
    else element.setAttribute(name, value === true ? '' : String(value));
  }
  element.append(...NB.present(children));
  return element;
};

/** What there is among children, nested or not. */
NB.present = (children) => {
  const all = /** @type {unknown[]} */ (children).flat(Infinity);
  return /** @type {(Node | string)[]} */ (all.filter((child) => child !== null && child !== undefined));
};

/** Other contents. */
NB.clear = (element, ...children) => {
  element.replaceChildren(...NB.present(children));
  return element;
};

/** An element that the page has from its start. */
NB.byId = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** What an element holds as base64 of zlib, as bytes; takes the element out of the page. */
NB.inflate = async (id) => {
  const element = NB.byId(id);
  const text = atob(element.textContent);
  element.remove();
  const compressed = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) compressed[k] = text.charCodeAt(k);
  const stream = new Blob([compressed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Response(stream).arrayBuffer();
};

/** Reads the payload: the document, with `NB.array` for what it refers to. */
NB.read = async () => NB.unpack(await NB.inflate('payload'));
NB.unpack = (raw) => {
  const length = new DataView(raw).getUint32(0, true);
  NB.raw = raw;
  NB.arrays = Math.ceil((4 + length) / 4) * 4;
  return JSON.parse(new TextDecoder().decode(new Uint8Array(raw, 4, length)));
};

/** Runs a library that the page brings along deflated. */
NB.load = async (id) => {
  const text = new TextDecoder().decode(await NB.inflate(id));
  document.head.append(NB.el('script', { text }));
};

/** The codes of a reference, or its values where it is quantised; NaN stands for none. */
NB.array = (reference) => {
  const { t, n, at, step, low = 0, d, h, p } = reference;
  const start = NB.arrays + at;
  if (t === 'f64') return new Float64Array(NB.raw.slice(start, start + 8 * n));
  let codes = new { u8: Uint8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array }[t](NB.raw, start, n);
  if (p) {
    const bytes = new Uint8Array(NB.raw, start, 2 * n);
    codes = new Uint16Array(n);
    for (let k = 0; k < n; k++) codes[k] = bytes[k] | (bytes[n + k] << 8);
  } else if (d || h) {
    codes = codes.slice();
  }
  // Arrays of 16 bits keep sums and differences modulo 2^16 by themselves.
  if (d) for (let k = d; k < n; k++) codes[k] += codes[k - d];
  if (h) {
    let next = 0;
    for (let k = 0; k < n; k++) {
      codes[k] = next - codes[k];
      next = Math.max(next, codes[k] + 1);
    }
  }
  if (step === undefined) return codes;
  const none = t === 'u8' ? 255 : 65535;
  const values = new Float32Array(n);
  for (let k = 0; k < n; k++) values[k] = codes[k] === none ? NaN : low + step * codes[k];
  return values;
};

/** Runs a page's script and shows an error where it cannot run. */
NB.start = async (build) => {
  const app = NB.byId('app');
  try {
    if (typeof DecompressionStream === 'undefined') {
      throw new Error('this browser is too old: it lacks DecompressionStream (all browsers since 2023 have it)');
    }
    const [page] = await Promise.all([NB.read(), NB.load('three')]);
    app.replaceChildren();
    for (const [name, words] of Object.entries(page.words || {})) NB.dictionary.set(name, words);
    build(page, app);
    requestAnimationFrame(() =>
      requestAnimationFrame(() => {
        NB.timing.firstView = performance.now();
        document.documentElement.dataset.ready = 'true';
      }),
    );
  } catch (error) {
    app.replaceChildren(
      NB.el('p', { class: 'error', role: 'alert', text: `This page cannot be shown: ${error.message}` }),
    );
    throw error;
  }
};

/** Columns of metrics, described by the page: the first of their keys that a configuration has is shown. */
NB.metricColumns = (columns) =>
  columns.map(({ title, unit, format, keys, help }) => ({
    title,
    unit,
    help,
    numeric: true,
    cell: ({ metrics }) => NB.formats[format](keys.map((key) => metrics[key]).find((value) => value !== undefined)),
  }));
/**
 * A name from a scenario or a report as people in the room say it: the document's own words for it, else
 * the name itself, without the number of a solid and without underscores.
 */
NB.words = (name) =>
  NB.dictionary.get(String(name)) ??
  String(name)
    .replace(/\.\d+$/, '')
    .replaceAll('_', ' ');
NB.dictionary = new Map();

/** Regions of the hemisphere about the entry point. */
NB.regionWords = {
  above: 'above',
  feet: 'towards the feet',
  head: 'towards the head',
  left: 'on the patient\u2019s left',
  right: 'on the patient\u2019s right',
};

/**
 * What a page's address says of the view, as in `report.html#goal=pose&time=2.4`: it can be sent, and survives
 * a reload. Works from disk, too.
 */
NB.address = {
  /** The choices of the address, all of them texts. */
  read: () => Object.fromEntries(new URLSearchParams(location.hash.slice(1))),

  /** Puts choices into the address, soon and without a step of the history; null takes one out. */
  write(choices) {
    const all = { ...NB.address.read(), ...NB.address.pending, ...choices };
    NB.address.pending = all;
    clearTimeout(NB.address.timer);
    NB.address.timer = setTimeout(() => {
      const kept = Object.entries(all).filter(([, value]) => value !== null && value !== undefined && value !== '');
      NB.address.pending = {};
      NB.address.written = `#${new URLSearchParams(kept.map(([name, value]) => [name, String(value)]))}`;
      if (location.hash !== NB.address.written) history.replaceState(null, '', NB.address.written);
    }, 150);
  },

  /** Calls `apply(choices)` when the address of the open page is changed by hand. */
  watch(apply) {
    window.addEventListener('hashchange', () => {
      if (location.hash !== NB.address.written) apply(NB.address.read());
    });
  },
  pending: {},
};

/** A button that puts the address with its choices on the clipboard. */
NB.copyLink = () => {
  const button = NB.el(
    'button',
    {
      type: 'button',
      class: 'no-print',
      title: 'Address of this page with the current selection',
      onclick: () => {
        /** @param {string} text */
        const said = (text) => {
          button.textContent = text;
          setTimeout(() => {
            button.textContent = 'Copy link';
          }, 2000);
        };
        setTimeout(
          () =>
            (navigator.clipboard ? navigator.clipboard.writeText(location.href) : Promise.reject()).then(
              () => said('Copied'),
              () => said('Copy it from the address bar'),
            ),
          200,
        );
      },
    },
    'Copy link',
  );
  return button;
};

/** A table with a caption: `columns` of `{ title, unit, numeric, cell(row) }`; units are in parentheses. */
NB.table = (caption, columns, rows, options = {}) => {
  const head = NB.el(
    'tr',
    null,
    columns.map((column) =>
      NB.el(
        'th',
        {
          scope: 'col',
          class: column.numeric ? 'number' : null,
          title: column.help,
        },
        column.title,
        column.unit ? NB.el('span', { class: 'unit', text: ` (${column.unit})` }) : null,
      ),
    ),
  );
  const body = rows.map((row) =>
    NB.el(
      'tr',
      options.row ? options.row(row) : null,
      columns.map((column, index) => {
        const content = column.cell(row);
        const attributes = { class: column.numeric ? 'number' : column.text ? 'text' : null };
        const isNode = content instanceof Node || Array.isArray(content);
        return index === 0
          ? NB.el('th', { scope: 'row' }, isNode ? content : String(content))
          : NB.el('td', attributes, isNode ? content : String(content));
      }),
    ),
  );
  return NB.scroll(
    caption,
    NB.el(
      'table',
      { class: options.class },
      NB.el('caption', { text: caption }),
      NB.el('thead', null, head),
      NB.el('tbody', null, body),
    ),
  );
};

/** A box that scrolls sideways where its contents are wider than it, and says so. */
NB.scroll = (label, content) => {
  const box = NB.el('div', { class: 'scroll', tabindex: '0', role: 'region', 'aria-label': label }, content);
  const element = NB.el('div', { class: 'scrolled' }, box);
  NB.hint(box);
  return element;
};

/** Tells below a box whether it scrolls sideways, and how much is hidden. */
NB.hint = (box) => {
  const element = /** @type {HTMLElement} */ (box.parentElement);
  const hint = NB.el('p', { class: 'hint no-print', 'aria-hidden': 'true' });
  element.append(hint);
  const look = () => {
    const rest = box.scrollWidth - box.clientWidth - box.scrollLeft;
    const hides = box.scrollWidth > box.clientWidth + 1;
    element.classList.toggle('hides', hides);
    element.classList.toggle('more', rest > 1);
    if (!hides) return;
    const edge = box.getBoundingClientRect().right;
    const heads = [...box.querySelectorAll('thead tr > *')];
    const beyond = heads.filter((cell) => cell.getBoundingClientRect().right > edge + 1).length;
    hint.textContent =
      rest <= 1
        ? '\u2190 the rest is to the left'
        : beyond
          ? `${beyond} more column${beyond === 1 ? '' : 's'}: scroll sideways \u2192`
          : 'scroll sideways for the rest \u2192';
  };
  box.addEventListener('scroll', look, { passive: true });
  const observer = new ResizeObserver(look);
  observer.observe(box);
  if (box.firstElementChild) observer.observe(box.firstElementChild);
};

/** A fold-out section. */
NB.section = (title, open, ...children) =>
  NB.el(
    'details',
    { class: 'section', open: open || null },
    NB.el('summary', null, NB.el('h2', { text: title })),
    ...children,
  );

/** A verdict as a chip: only `pass` is good. */
NB.verdict = (verdict) => {
  /** @type {{ [verdict: string]: string[] }} */
  const words = {
    pass: ['good', '\u2713 passed'],
    fail: ['bad', '\u2717 failed'],
    incomplete: ['bad', '? incomplete'],
  };
  const [style, text] = words[verdict] || ['bad', String(verdict)];
  return NB.el('span', { class: `chip ${style}`, text });
};

NB.checkbox = (label, checked, change) => {
  const input = NB.el('input', { type: 'checkbox', checked, onchange: (event) => change(event.target.checked) });
  const labelled = NB.el('label', { class: 'check' }, input, NB.el('span', { text: label }));
  return /** @type {Labelled<HTMLInputElement>} */ (labelled);
};

NB.select = (label, options, value, change) => {
  const select = NB.el(
    'select',
    { onchange: (event) => change(event.target.value) },
    options.map(([key, text]) => NB.el('option', { value: key, selected: key === value, text })),
  );
  const labelled = NB.el('label', { class: 'field' }, NB.el('span', { text: label }), select);
  return /** @type {Labelled<HTMLSelectElement>} */ (labelled);
};

/** Lets arrow keys move the choice among the rows of a list; `choose(index)` is called. */
NB.rows = (rows, choose) => {
  rows.forEach((row, index) => {
    row.addEventListener('click', () => choose(index));
    row.addEventListener('keydown', (event) => {
      const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
      let to = null;
      if (step) to = Math.min(Math.max(index + step, 0), rows.length - 1);
      else if (event.key === 'Home') to = 0;
      else if (event.key === 'End') to = rows.length - 1;
      else if (event.key === 'Enter' || event.key === ' ') to = index;
      if (to === null || /** @type {Element} */ (event.target).closest('input, button')) return;
      event.preventDefault();
      choose(to);
      rows[to].focus();
    });
  });
};
NB.mark = (rows, chosen) => {
  rows.forEach((row, index) => {
    const is = index === chosen;
    row.setAttribute('aria-selected', String(is));
    row.tabIndex = is ? 0 : -1;
  });
};

/** What arrow keys do in a list. */
NB.ARROWS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** Rows of a table, less its head. */
NB.tableRows = (table) => [...table.querySelectorAll('tbody')].flatMap((body) => [...body.rows]);

/** What is drawn on a canvas with. */
NB.context = (canvas, options) => /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d', options));

/** Details elements of a kind. */
NB.folds = (kind) => /** @type {NodeListOf<HTMLDetailsElement>} */ (document.querySelectorAll(`details${kind}`));

/** Every details element but those that are not for paper is open there, and nothing scrolls. */
window.addEventListener('beforeprint', () => {
  for (const details of NB.folds(':not([open]):not(.no-print)')) {
    details.dataset.closed = 'true';
    details.open = true;
  }
});
window.addEventListener('afterprint', () => {
  for (const details of NB.folds('[data-closed]')) {
    delete details.dataset.closed;
    details.open = false;
  }
});

/** Any document as nested lists. */
NB.tree = (value) => {
  if (value === null || value === undefined) return NB.el('span', { text: '\u2013' });
  if (typeof value === 'number') return NB.el('span', { text: NB.significant(value) });
  if (typeof value !== 'object') return NB.el('span', { text: String(value) });
  if (Array.isArray(value) && value.every((each) => typeof each !== 'object' || each === null)) {
    return NB.el('span', {
      text: value.map((each) => (typeof each === 'number' ? NB.significant(each) : String(each))).join(', '),
    });
  }
  return NB.el(
    'dl',
    null,
    Object.entries(value).flatMap(([key, each]) => [
      NB.el('dt', { text: NB.words(key) }),
      NB.el('dd', null, NB.tree(each)),
    ]),
  );
};

NB.provenance = (provenance, file) =>
  NB.el(
    'div',
    null,
    NB.el(
      'dl',
      null,
      NB.el('dt', { text: 'needlebench' }),
      NB.el('dd', { text: `${provenance.version} (${provenance.git_revision})` }),
      file ? [NB.el('dt', { text: 'file' }), NB.el('dd', { text: file })] : null,
      NB.el('dt', { text: 'seed' }),
      NB.el('dd', { text: String(provenance.seed) }),
      NB.el('dt', { text: 'ground truth' }),
      NB.el('dd', { text: provenance.truth }),
      NB.el('dt', { text: 'lock file' }),
      NB.el('dd', null, NB.el('code', { text: provenance.cargo_lock_sha256 })),
      provenance.engines.map((engine) => [
        NB.el('dt', { text: `${engine.name} ${engine.version}` }),
        NB.el('dd', { text: engine.settings.map(([key, value]) => `${key} = ${value}`).join(', ') }),
      ]),
    ),
    NB.el('p', {
      class: 'print-only',
      text: `${provenance.inputs.length} input files; report.json has their names and hashes.`,
    }),
    NB.el(
      'div',
      { class: 'no-print' },
      NB.table(
        'Input files',
        [
          { title: 'Role', cell: (input) => input.role },
          { title: 'File', cell: (input) => input.file },
          { title: 'SHA-256', cell: (input) => NB.el('code', { text: input.sha256 }) },
        ],
        provenance.inputs,
        { class: 'small' },
      ),
    ),
  );

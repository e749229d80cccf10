// The page of a study.
'use strict';

NB.StudyPage = class extends NB.StudyPlots {
  constructor(page, app) {
    super();
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
    this.places = page.places ? NB.array(page.places) : null;
    this.lookOf = page.lookOf ? NB.array(page.lookOf) : null;
    this.looks = page.looks || [];
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
    // Of several kinds of cases each has its own; the last that a row has counts.
    const clearances = this.metrics.filter((metric) => metric.measure === 'clearance').reverse();
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
        const value = clearances.map((metric) => metric.values[at]).find((found) => !Number.isNaN(found)) ?? 0;
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
    const { criteria = [], verdict, not_judged: open = [] } = this.page.summary || {};
    return NB.el('div', { class: 'bar' },
      criteria.length || open.length ? NB.verdict(verdict) : null,
      open.length ? NB.el('span', { class: 'error', text: `not judged: ${open.join('; ')}` }) : null,
      NB.el('span', { text: `${group(cases)} cases of 8 configurations` }),
      this.page.summary?.headline ? NB.el('strong', { class: 'headline', text: this.page.summary.headline.charAt(0).toUpperCase() + this.page.summary.headline.slice(1) }) : null,
      this.choiceText() ? NB.el('strong', { class: 'headline', text: this.choiceText() }) : null,
      kept < cases ? NB.el('strong', { text: `The plots show ${group(kept)} of them: one of each block of successive cases, drawn by a fixed rule, and those that the statistics name. All tables of statistics are of all cases.` }) : null);
  }

  /** Of which choice the statistics are, in a sentence; empty where nothing is chosen. */
  choiceText() {
    const best = this.page.summary?.of_choice;
    if (this.page.summary?.not_ranked) return `Not judged: ${this.page.summary.not_ranked}`;
    if (!best) return '';
    const rate = this.page.summary.overall?.at_least?.[0];
    const heldOut = best.held_out === null || best.held_out === undefined ? ''
      : `; picked on one half of the points, a choice works in ${NB.fixed(100 * best.held_out, 1)} % of the other half`;
    const share = rate?.rate === null || rate?.rate === undefined ? '' : ` At least one configuration is ok in ${NB.fixed(100 * rate.rate, 1)} %${rate.interval ? ` (${NB.fixed(100 * rate.interval.low, 1)} to ${NB.fixed(100 * rate.interval.high, 1)}, which holds for all choices at once)` : ''} of its valid layouts${heldOut}.`;
    return `Rates and criteria are of the best of ${best.of} choices, ${best.label}, by ${best.by}.${share}`;
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
        ? `Share of valid cases in which it is ok, with ${Math.round(100 * (this.page.summary.confidence || 0.95))} % interval; ${this.page.summary.of_choice ? `of the best choice, ${this.page.summary.of_choice.label}` : 'of all cases'}.`
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
      this.tip, ...new NB.Statistics(this).sections());
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
    const unit = { um: '\u00b5m', 'm^3': 'm\u00b3', 1: '' }[metric.unit] ?? metric.unit;
    return `${metric.words}${unit ? ` (${unit})` : ''}`;
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
      ...this.metrics.map((metric) => ({ title: this.titleOf(metric), numeric: true, help: metric.description, cell: (c) => NB.fixed(metric.values[c * this.count + index], Math.min(Math.max(0, Math.floor(-Math.log10(metric.column.step))), 3)) })),
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
    // Tools and phantoms of other cases stand in groups of their own: `skin@1`.
    const others = this.looks.flatMap((look, at) => look.parts.map((part) => ({ ...part, group: `${part.group}@${at + 1}` })));
    this.view = new NB.View({ ...scene, parts: [...scene.parts, ...others] }, 'Posture of the chosen configuration');
    this.view.element.style.height = '330px';
    this.arm = this.view.arm('arm');
    for (const layer of ['collision', 'corridor']) this.arm.layer(layer, false);
    this.view.show('gantry', false);
    const goals = Object.values(this.page.goals || {});
    const targets = goals.map((goal) => goal.target);
    this.view.frame([...NB.aboutBase(scene.chain.base, 0.5), ...targets.flatMap((t) => [t.map((v) => v - 0.25), t.map((v) => v + 0.25)])], goals.length ? NB.direction(scene.chain.base, goals[0].target, goals[0].axis) : [-0.75, 0.45, -0.55]);
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
    }
    // Without places the picture is of the base scenario, which says so below.
    const look = this.lookOf && at !== undefined ? this.lookOf[at] : this.lookOf ? 255 : 0;
    const drawn = look <= this.looks.length;
    this.look(look, known ? Array.from(this.places.subarray(14 * at + 7, 14 * at + 14)) : null);
    this.arm.show(has);
    this.view.empty('needle');
    if (has && this.view.works) this.arm.pose(chain, joints);
    if (has && drawn && this.view.works) {
      const poses = NB.forward(chain, joints);
      const exit = (look ? this.looks[look - 1] : this.page.scene).guide[1];
      const guide = poses[6].clone().multiply(NB.matrix(exit));
      const point = (z) => new THREE.Vector3(0, 0, z).applyMatrix4(guide).toArray();
      this.view.rod('needle', point(-0.12), point(0.08), 0.0012, [0, 0.45, 0.32, 1]);
    }
    this.viewNote.textContent = [
      has ? `${this.page.configurations[c]} in case ${this.caseOf(index)}.`
        : at === undefined ? 'The posture of this case is not on the page (it holds some thousand): rerun it by the command.' : 'This configuration has no posture.',
      known && drawn ? 'Robot, patient and tool are those of this case, and stand where they do in it; table, gantry, mount and obstacles are those of the base scenario.'
        : known ? 'The robot stands where it does in this case; its tool and its patient are not on the page, and are not drawn: rerun it with --run to see them.'
        : this.lookOf ? 'Tool and patient of this case are not on the page, and are not drawn; table, gantry, mount and obstacles are those of the base scenario.'
        : 'The surroundings are those of the base scenario: what this case changes of them is not drawn.'].join(' ');
    this.view.draw();
  }

  /** Shows the tool and the patient of a look alone, the patient at a place; of one that is not on the page, none. */
  look(look, phantom) {
    if (!this.view.works) return;
    const name = (group, at) => (at ? `${group}@${at}` : group);
    for (let at = 0; at <= this.looks.length; at++) {
      this.arm.layer(name('tool', at), at === look);
      for (const tissue of ['skin', 'bone', 'organ', 'vessel', 'lesion', 'marker']) {
        const group = this.view.group(name(tissue, at));
        group.visible = at === look;
        if (at !== look || !phantom || Number.isNaN(phantom[0])) continue;
        const move = NB.matrix(phantom);
        // The base scenario's lies where it does there, the others in their own frame.
        if (!at) { if (!this.page.phantom) continue; move.multiply(NB.matrix(this.page.phantom).invert()); }
        group.matrixAutoUpdate = false;
        group.matrix.copy(move);
        group.matrixWorldNeedsUpdate = true;
      }
    }
  }
};

NB.start((page, app) => { NB.current = new NB.StudyPage(page, app); });

// The page of a study.
'use strict';

class StudyPage extends StudyPlots {
  /** @type {AddressChoices} */ asked;
  /** @type {HTMLElement} */ tip;
  /** @type {Statistics} */ statistics;
  /** @type {HTMLElement} */ casePanel;
  /** @type {HTMLElement} */ cellPanel;
  /** @type {CaseScene | null} */ scene;
  /** @type {View | undefined} */ view;
  /** @type {[control: Labelled<HTMLSelectElement>, value: () => string][]} */ kept;
  /** @type {HTMLElement | null} */ metricSelect;
  /** @type {Figure} */ map;
  /** @type {Figure} */ scatter;
  /** @type {Figure} */ ecdf;
  /** @type {Figure} */ histogram;
  // Of the statistics.
  /** @type {Figure | undefined} */ compared;
  /** @type {Figure} */ strip;
  /** @type {HTMLElement | undefined} */ shown;

  /** @param {StudyDocument} page @param {HTMLElement} app */
  constructor(page, app) {
    super();
    this.page = page;
    /** @type {StudySummary} */
    this.summary = page.summary || {};
    this.count = page.kept;
    // Goals have names for files.
    /** @param {StudyFactor} factor */
    const levels = (factor) =>
      factor.name === 'goal' && factor.levels
        ? factor.levels.map((level) => ({ ...level, label: NB.words(level.label) }))
        : factor.levels;
    this.factors = page.factors.map((factor) => ({
      ...factor,
      levels: levels(factor),
      values: NB.array(factor.column),
    }));
    const metrics = page.metrics.map((metric) => ({ ...metric, values: NB.array(metric.column) }));
    // Rounding errors of an ideal arm are not shown.
    this.exact = metrics.filter((metric) => NB.isRounding(metric));
    this.metrics = metrics.filter((metric) => !NB.isRounding(metric));
    this.outcomes = NB.array(page.outcomes);
    this.outcomeOf = page.outcomeNames.map(([outcome]) => outcome);
    this.numbers = page.numbers ? NB.array(page.numbers) : null;
    if (this.numbers) for (let k = 1; k < this.count; k++) this.numbers[k] += this.numbers[k - 1];
    const posed = NB.array(page.postures.cases);
    this.posed = new Map([...posed].map((index, at) => [index, at]));
    this.poses = NB.array(page.postures.joints);
    this.derive();
    app.classList.add('study');
    app.append(this.head());
    if (!this.count) {
      app.append(NB.el('p', { text: 'The study has no cases.' }));
      return;
    }
    this.build(app);
  }

  /** @param {string | undefined} name */
  metric(name) {
    return this.metrics.find((metric) => metric.name === name);
  }

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
        if (value > most || this.best[index] < 0) {
          most = value;
          this.best[index] = c;
        }
      }
    }
  }

  /** @param {number} index */
  caseOf(index) {
    return this.numbers ? this.numbers[index] : index;
  }

  /** @param {number} number */
  indexOf(number) {
    if (!this.numbers) return number >= 0 && number < this.count ? number : -1;
    let [low, high] = [0, this.count - 1];
    while (low <= high) {
      const middle = (low + high) >> 1;
      if (this.numbers[middle] === number) return middle;
      if (this.numbers[middle] < number) low = middle + 1;
      else high = middle - 1;
    }
    return -1;
  }

  /** Verdict, cases, and what qualifies every figure below. */
  head() {
    const { cases, kept } = this.page;
    const { criteria = [], verdict, not_judged: open = [] } = this.summary;
    const varied = this.factors
      .filter((factor) => !factor.levels || factor.levels.length > 1)
      .map((factor) => (factor.levels ? `${factor.words} (${factor.levels.length})` : factor.words));
    return NB.el(
      'div',
      { class: 'bar' },
      criteria.length || open.length
        ? NB.verdict(String(verdict))
        : NB.el('span', { class: 'chip off', text: 'no criteria defined' }),
      open.length ? NB.el('span', { class: 'error', text: `not evaluated: ${open.join('; ')}` }) : null,
      this.posturesChip(),
      NB.el('span', { text: `${NB.grouped(cases)} cases, each with 8 configurations; varied: ${varied.join(', ')}` }),
      kept < cases
        ? NB.el('strong', {
            text:
              `The plots show ${NB.grouped(kept)} of them: one sampled from each block of successive cases by a ` +
              'fixed rule, and those named by the statistics. All tables of statistics cover all cases.',
          })
        : null,
      this.summary.headline
        ? NB.el('p', {
            class: 'headline',
            text: `${this.summary.headline.charAt(0).toUpperCase()}${this.summary.headline.slice(1)}.`,
          })
        : null,
    );
  }

  /** A warning that motions were not planned, beside figures. */
  posturesChip() {
    const words = { all: 'postures only, motions not planned', some: 'some cases are postures only', none: '' };
    const text = words[this.summary.postures_only || 'none'];
    const route = this.summary.without_route ? 'needle path not checked' : '';
    const chips = [text, route].filter(Boolean);
    return chips.map((each) => NB.el('span', { class: 'chip bad', text: each, title: this.summary.headline || null }));
  }

  /** @param {HTMLElement} app */
  build(app) {
    this.axesOf = this.factors.map((factor, index) => this.axis(factor, index));
    this.state = this.startState();
    this.filter();
    this.tip = NB.el('div', { class: 'tip', hidden: true });
    this.statistics = new Statistics(this);
    const map = this.figureOfMap();
    this.makeFigures();
    this.casePanel = NB.el('div', { class: 'panel' });
    const { scene, looks } = this.page;
    this.scene = scene && looks ? new CaseScene(scene, looks) : null;
    this.view = this.scene?.view;
    app.append(
      ...this.statistics.first(),
      NB.el('h2', { class: 'part', text: 'Cases in detail' }),
      this.controls(),
      ...NB.present([this.shown]),
      NB.el(
        'div',
        { class: 'explore' },
        NB.el('div', null, this.scatter.element, map.element, this.cellPanel),
        NB.el('div', null, this.scene ? this.scene.element : null, this.casePanel),
      ),
      NB.el('h2', { class: 'part', text: 'Distributions' }),
      NB.el('div', { class: 'bar no-print' }, this.metricSelect),
      NB.el('div', { class: 'pair' }, this.ecdf.element, this.histogram.element),
      NB.el('h2', { class: 'part', text: 'All tables' }),
      this.tip,
      ...this.statistics.sections(),
    );
    this.redraw();
    const asked = this.indexOf(Number(this.asked.case ?? NaN));
    const noted = this.firstNoted();
    this.choose(
      asked >= 0 ? asked : Number.isNaN(noted) ? (this.indices[0] ?? 0) : noted,
      this.state.configuration >= 0 ? this.state.configuration : null,
    );
    this.started = true;
    NB.address.watch((choices) => this.follow(choices));
  }

  /** What the plots show at first: the best candidate, over numeric factors; or what the address specifies. */
  startState() {
    this.asked = NB.address.read();
    const varying = [...this.factors.keys()].filter(
      (index) => !this.factors[index].levels || this.factors[index].levels.length > 1,
    );
    /** @param {number} index */
    const isNumber = (index) =>
      !this.factors[index].levels || this.factors[index].levels.every((level) => level.number !== null);
    const chosen = varying.filter((index) => this.factors[index].role === 'choice' && isNumber(index));
    const numbers = chosen.length > 1 ? chosen : varying.filter((index) => !this.factors[index].levels);
    const order = [...new Set([...numbers, ...varying])];
    const state = {
      x: order[0] ?? 0,
      y: order[1] ?? order[0] ?? 0,
      color: 'outcome',
      configuration: -1,
      metric: (this.metrics.find((metric) => metric.measure === 'clearance') || this.metrics[0])?.name,
      filters: new Map(),
    };
    const { choices: [best] = [], axes = [] } = this.summary.choices || {};
    (best ? axes : []).forEach((axis, at) => {
      const factor = this.factors[axis.factor];
      if (factor.levels && !axis.coarse && axis.factor !== state.x && axis.factor !== state.y)
        state.filters.set(axis.factor, best.bins[at]);
    });
    return this.withAddress(state);
  }

  /**
   * A state with what the address says of it.
   * @param {StudyState} state
   */
  withAddress(state) {
    /** @param {string} name */
    const named = (name) => this.factors.findIndex((factor) => factor.name === name);
    const of = this.page.configurations.indexOf(this.asked.of);
    if (of >= 0) state.configuration = of;
    if (this.asked.of === 'best') state.configuration = -1;
    for (const axis of /** @type {const} */ (['x', 'y'])) {
      const at = named(this.asked[axis]);
      if (at >= 0) state[axis] = at;
    }
    const color = this.asked.colour;
    if (['outcome', 'best', 'working'].includes(color) || this.metric(color)) state.color = color;
    if (this.metric(this.asked.metric)) state.metric = this.asked.metric;
    this.factors.forEach((factor, index) => {
      const asked = this.asked[`with.${factor.name}`];
      const level = factor.levels ? factor.levels.findIndex((each) => each.label === asked) : -1;
      if (level >= 0) state.filters.set(index, level);
      else if (asked === 'all') state.filters.delete(index);
    });
    return state;
  }

  /** Writes what is shown into the address. */
  remember() {
    const { x, y, color, configuration, metric, filters } = this.state;
    /** @type {{ [name: string]: string | number | undefined }} */
    const words = {
      case: this.caseOf(this.chosen ?? 0),
      x: this.factors[x].name,
      y: this.factors[y].name,
      colour: color,
      of: configuration < 0 ? 'best' : this.page.configurations[configuration],
      metric,
    };
    this.factors.forEach((factor, index) => {
      if (factor.levels && factor.levels.length > 1)
        words[`with.${factor.name}`] = factor.levels[filters.get(index) ?? -1]?.label ?? 'all';
    });
    NB.address.write(words);
  }

  /**
   * Shows what an address that was typed or gone back to asks for.
   * @param {AddressChoices} choices
   */
  follow(choices) {
    this.asked = choices;
    this.state = this.withAddress(this.state);
    for (const [control, value] of this.kept) control.control.value = value();
    this.filter();
    this.redraw();
    const index = this.indexOf(Number(this.asked.case ?? NaN));
    if (index >= 0) this.choose(index);
  }

  controls() {
    /** @type {[key: string, text: string][]} */
    const options = this.factors.flatMap((factor, index) =>
      !factor.levels || factor.levels.length > 1 ? [[String(index), factor.words]] : [],
    );
    /** @type {[key: string, text: string][]} */
    const configurations = [
      ['-1', 'best per layout'],
      ...this.page.configurations.map((label, index) => /** @type {[string, string]} */ ([String(index), label])),
    ];
    /** @type {[key: string, text: string][]} */
    const colors = [
      ['outcome', 'outcome'],
      ['best', 'best configuration'],
      ['working', 'feasible configurations'],
      ...this.metricOptions(),
    ];
    this.kept = [];
    /**
     * @param {string} label
     * @param {[key: string, text: string][]} choices
     * @param {() => string} value
     * @param {(chosen: string) => void} set
     */
    const select = (label, choices, value, set) => {
      const control = NB.select(label, choices, value(), (chosen) => {
        set(chosen);
        this.filter();
        this.redraw();
        this.remember();
      });
      this.kept.push([control, value]);
      return control;
    };
    const { state } = this;
    const filters = this.factors.map((factor, index) =>
      factor.levels && factor.levels.length > 1
        ? select(
            `${factor.words}:`,
            [
              ['', 'all'],
              ...factor.levels.map((level, at) => /** @type {[string, string]} */ ([String(at), level.label])),
            ],
            () => String(this.state.filters.get(index) ?? ''),
            (value) => {
              if (value === '') state.filters.delete(index);
              else state.filters.set(index, Number(value));
            },
          )
        : null,
    );
    this.metricSelect = this.metrics.length
      ? select(
          'metric',
          this.metricOptions(),
          () => this.state.metric ?? '',
          (value) => {
            state.metric = value;
          },
        )
      : null;
    return NB.el(
      'div',
      { class: 'bar no-print', role: 'group', 'aria-label': 'Plot settings' },
      select(
        'x axis',
        options,
        () => String(this.state.x),
        (value) => {
          state.x = Number(value);
        },
      ),
      select(
        'y axis',
        options,
        () => String(this.state.y),
        (value) => {
          state.y = Number(value);
        },
      ),
      select(
        'colour',
        colors,
        () => this.state.color,
        (value) => {
          state.color = value;
        },
      ),
      select(
        'configuration',
        configurations,
        () => String(this.state.configuration),
        (value) => {
          state.configuration = Number(value);
        },
      ),
      filters,
    );
  }

  /** @returns {[key: string, text: string][]} */
  metricOptions() {
    return this.metrics.map((metric) => [metric.name, this.titleOf(metric)]);
  }

  figureOfMap() {
    this.map = new Figure({
      name: `${this.page.name}-map`,
      title: 'Success rate map',
      help: 'Share of feasible layouts in each cell. Click a cell for its cases.',
      label: 'Map of the success rate over two factors',
      height: 400,
      paint: (...all) => this.paintMap(...all),
      legend: () => this.mapItems || [],
    });
    return this.map;
  }

  makeFigures() {
    this.scatter = new Figure({
      name: `${this.page.name}-scatter`,
      title: 'Cases',
      help:
        'Each mark is one case, or several at the same position. Click it for its cases, or go through the case ' +
        'numbers with the arrow keys.',
      label: 'Scatter of the cases over two factors',
      height: 400,
      paint: (...all) => this.paintScatter(...all),
      legend: () => this.scatterItems || [],
    });
    this.ecdf = new Figure({
      name: `${this.page.name}-ecdf`,
      title: 'Cumulative distribution',
      help: 'Layouts in which the configuration is not rejected. Click a curve for the case at that value.',
      label: 'Cumulative distribution by configuration',
      height: 300,
      paint: (...all) => this.paintEcdf(...all),
      legend: () => this.ecdfItems || [],
    });
    this.histogram = new Figure({
      name: `${this.page.name}-histogram`,
      title: 'Histogram',
      help: 'Configuration chosen above, where it is not rejected; or the best one, where any is feasible.',
      label: 'Histogram of the metric',
      height: 300,
      paint: (...all) => this.paintHistogram(...all),
    });
    this.shown = NB.el('p', { class: 'soft', role: 'status' });
    this.showCount();
    this.cellPanel = NB.el('div');
    this.listen(this.scatter.canvas, (x, y) => this.nearestPlace(x, y));
    this.listen(this.ecdf.canvas, (x, y) => this.nearestOnCurve(x, y));
    this.listen(this.map.canvas, (x, y) => this.cellAt(x, y));
  }

  /** The first case that the statistics name and that is here. */
  firstNoted() {
    const best = this.summary.evidence?.configurations?.find((each) => each.of === 'best');
    const worst = best?.worst.find(({ metric }) => !this.statistics.isExact(metric));
    const index = worst?.cases.length ? this.indexOf(worst.cases[0].case) : -1;
    return index >= 0 ? index : NaN;
  }

  /** @param {{ words: string, unit: string }} metric */
  titleOf(metric) {
    const unit = { um: '\u00b5m', 'm^3': 'm\u00b3', 1: '' }[metric.unit] ?? metric.unit;
    return `${metric.words}${unit ? ` (${unit})` : ''}`;
  }

  /**
   * Range, title and bins of a factor.
   * @param {ShownFactor} factor
   * @param {number} salt
   * @returns {StudyAxis}
   */
  axis(factor, salt) {
    const title = `${factor.words}${factor.unit ? ` (${factor.unit})` : ''}`;
    if (factor.levels) {
      const labels = factor.levels.map((level) => level.label);
      return { low: -0.5, high: labels.length - 0.5, title, labels, bins: labels.length, salt };
    }
    let [low, high] = [Infinity, -Infinity];
    for (const value of factor.values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (!(low < high)) {
      low -= 0.5;
      high += 0.5;
    }
    const bins = Math.min(Math.max(Math.floor(Math.sqrt(this.count / 40)), 4), 16);
    return { low, high, title, labels: null, bins, salt };
  }

  /** @param {StudyAxis} axis @param {ShownFactor} factor @param {number} index */
  bin(axis, factor, index) {
    const value = factor.values[index];
    if (axis.labels) return value;
    return Math.min(Math.floor(((value - axis.low) / (axis.high - axis.low)) * axis.bins), axis.bins - 1);
  }

  filter() {
    const filters = [...this.state.filters];
    const indices = [];
    for (let index = 0; index < this.count; index++) {
      if (filters.every(([factor, level]) => this.factors[factor].values[index] === level)) indices.push(index);
    }
    this.indices = Uint32Array.from(indices);
    this.sorted = null;
    this.placed = null;
    this.showCount();
  }

  showCount() {
    if (!this.shown) return;
    const only = [...this.state.filters].map(
      ([factor, level]) => `${this.factors[factor].words} ${this.factors[factor].levels?.[level].label}`,
    );
    const postures = this.summary.postures_only === 'all' ? ' Postures only, motions not planned.' : '';
    this.shown.textContent =
      `${NB.grouped(this.indices.length)} of ${NB.grouped(this.count)} cases are ` +
      `shown${only.length ? `, with ${only.join(', ')}` : ''}.${postures}`;
  }

  redraw() {
    for (const figure of [this.scatter, this.map, this.ecdf, this.histogram]) figure.draw();
  }

  /**
   * Row of the chosen configuration in a case; -1 where none is feasible.
   * @param {number} index
   */
  row(index) {
    const c = this.state.configuration < 0 ? this.best[index] : this.state.configuration;
    return c < 0 ? -1 : c * this.count + index;
  }

  /** @param {number} index */
  outcome(index) {
    if (this.invalid[index]) return 'invalid';
    if (this.state.configuration < 0) return this.working[index] ? 'ok' : 'none works';
    return this.outcomeOf[this.outcomes[this.state.configuration * this.count + index]];
  }

  /**
   * Pointer: `find` gives `{ text, choose }`.
   * @param {Canvas} canvas
   * @param {(x: number, y: number) => { text: string, choose(): void } | null} find
   */
  listen(canvas, find) {
    /** @param {MouseEvent} event */
    const at = (event) => {
      const box = canvas.canvas.getBoundingClientRect();
      return find(event.clientX - box.left, event.clientY - box.top);
    };
    canvas.canvas.addEventListener('pointermove', (event) => {
      const found = at(event);
      this.tip.hidden = !found;
      if (!found) return;
      this.tip.textContent = found.text;
      const rightmost = document.documentElement.clientWidth - this.tip.offsetWidth - 4;
      this.tip.style.left = `${Math.max(Math.min(event.pageX + 14, rightmost), 0)}px`;
      this.tip.style.top = `${event.pageY + 12}px`;
    });
    canvas.canvas.addEventListener('pointerleave', () => {
      this.tip.hidden = true;
    });
    canvas.canvas.addEventListener('click', (event) => at(event)?.choose());
  }

  /** @param {number} x @param {number} y */
  nearestPlace(x, y) {
    const axes = this.scatterAxes;
    if (!axes) return null;
    const places = this.places();
    let [best, least] = [-1, 144];
    for (let place = 0; place < places.first.length; place++) {
      const dx = axes.px(places.x[place]) - x;
      if (dx > 12 || dx < -12) continue;
      const dy = axes.py(places.y[place]) - y;
      if (dx * dx + dy * dy < least) {
        least = dx * dx + dy * dy;
        best = place;
      }
    }
    if (best < 0) return null;
    const first = places.first[best];
    if (places.counts[best] === 1) {
      return {
        text:
          `case ${this.caseOf(first)}: ${StudyPage.outcomes[this.outcome(first)]}, ` +
          `${this.working[first]} of 8 configurations feasible`,
        choose: () => this.choose(first),
      };
    }
    const here = [...this.indices].filter((_, at) => places.of[at] === best);
    const working = here.filter((index) => this.outcome(index) === 'ok').length;
    return {
      text: `${here.length} cases at this position: ${working} feasible`,
      choose: () => this.list(here, 'at this position'),
    };
  }

  /** @param {number} px @param {number} py */
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
      if (away < least) {
        least = away;
        best = c;
        where = values[at];
      }
    });
    if (best < 0) return null;
    return {
      text:
        `${this.page.configurations[best]}: ${NB.fixed(100 * share, 1)} % below ${NB.threeDigits(value)} ` +
        `${metric.unit === '1' ? '' : metric.unit}`,
      choose: () => {
        let [found, nearest] = [-1, Infinity];
        for (const index of this.indices) {
          const away = Math.abs(metric.values[best * this.count + index] - where);
          if (away < nearest) {
            nearest = away;
            found = index;
          }
        }
        if (found >= 0) this.choose(found, best);
      },
    };
  }

  /** @param {number} x @param {number} y */
  cellAt(x, y) {
    if (!this.mapCells) return null;
    const { axes, nx, ny, ok, of } = this.mapCells;
    const cx = Math.floor(((x - axes.box.left) / axes.box.width) * nx);
    const cy = Math.floor(((axes.box.top + axes.box.height - y) / axes.box.height) * ny);
    if (cx < 0 || cy < 0 || cx >= nx || cy >= ny) return null;
    const cell = cy * nx + cx;
    return {
      text: of[cell]
        ? `${ok[cell]} of ${of[cell]} layouts feasible (${Math.round((100 * ok[cell]) / of[cell])} %)`
        : 'no layouts',
      choose: () => this.listCell(cx, cy),
    };
  }

  /** @param {number} cx @param {number} cy */
  listCell(cx, cy) {
    const [xAxis, yAxis] = [this.axesOf[this.state.x], this.axesOf[this.state.y]];
    const [xFactor, yFactor] = [this.factors[this.state.x], this.factors[this.state.y]];
    this.list(
      [...this.indices].filter(
        (index) => this.bin(xAxis, xFactor, index) === cx && this.bin(yAxis, yFactor, index) === cy,
      ),
      'in this cell',
    );
  }

  /**
   * The first cases of a place or a cell, infeasible ones first.
   * @param {number[]} inside
   * @param {string} where
   */
  list(inside, where) {
    inside.sort((a, b) => Number(this.outcome(a) === 'ok') - Number(this.outcome(b) === 'ok') || a - b);
    NB.clear(
      this.cellPanel,
      NB.el('p', {
        class: 'small',
        text: `${inside.length} cases ${where}; first 40, infeasible ones first:`,
      }),
      this.caseButtons(inside.slice(0, 40).map((index) => this.caseOf(index))),
    );
    if (inside.length) this.choose(inside[0]);
  }

  /** @param {number[]} numbers */
  caseButtons(numbers) {
    const buttons = numbers.map((number) => {
      const index = this.indexOf(number);
      return NB.el(
        'button',
        {
          type: 'button',
          class: 'key',
          disabled: index < 0,
          title: index < 0 ? 'not on this page' : null,
          'aria-label': `Case ${number}`,
          onclick: () => this.choose(index),
        },
        String(number),
      );
    });
    for (const [at, button] of buttons.entries()) {
      button.addEventListener('keydown', (event) => {
        const step = NB.ARROWS[event.key];
        const next = step && buttons[at + step];
        if (!next || next.disabled) return;
        event.preventDefault();
        next.focus();
        next.click();
      });
    }
    return NB.el('div', { class: 'legend', role: 'group', 'aria-label': 'Cases' }, buttons);
  }

  /** @param {number} index @param {number | null} [configuration] */
  choose(index, configuration = null) {
    this.chosen = index;
    this.scatter.draw();
    const number = this.caseOf(index);
    const row =
      configuration ?? (this.state.configuration >= 0 ? this.state.configuration : Math.max(this.best[index], 0));
    /** @type {Column<number>[]} */
    const columns = [
      { title: 'Configuration', cell: (c) => this.page.configurations[c] },
      { title: 'Outcome', cell: (c) => this.outcomeText(index, c) },
      ...this.metrics.map((metric) => ({
        title: this.titleOf(metric),
        numeric: true,
        help: metric.description,
        cell: (/** @type {number} */ c) => NB.threeDigits(metric.values[c * this.count + index]),
      })),
    ];
    const table = NB.table('Select a row to show its posture', columns, [0, 1, 2, 3, 4, 5, 6, 7], {
      class: 'choose small full',
    });
    const rows = NB.tableRows(table);
    NB.rows(rows, (c) => {
      NB.mark(rows, c);
      this.pose(index, c);
    });
    NB.mark(rows, row);
    const file = /^[\w./-]+$/.test(this.page.file) ? this.page.file : `'${this.page.file.replaceAll("'", "'\\''")}'`;
    const command = `needlebench study ${file} --case ${number}`;
    const copied = NB.el('span', { class: 'soft', role: 'status' });
    const input = NB.el('input', {
      type: 'number',
      min: '0',
      max: String(this.page.cases - 1),
      value: String(number),
      'aria-label': 'Number of the case',
      style: 'width: 8em',
      onchange: (event) => {
        const to = this.indexOf(Number(event.target.value));
        if (to >= 0) this.choose(to);
        else copied.textContent = 'this case is not on the page; the command recomputes any case';
      },
    });
    const elsewhere =
      this.indices.indexOf(index) < 0
        ? NB.el('p', { class: 'soft small', text: 'The filters above exclude this case from the plots.' })
        : null;
    NB.clear(
      this.casePanel,
      NB.el('h3', null, 'Case ', input),
      elsewhere,
      NB.el(
        'dl',
        null,
        this.factors.flatMap((factor) => {
          const value = factor.values[index];
          const text = factor.levels ? factor.levels[value].label : `${NB.fixed(value, 2)} ${factor.unit}`;
          return [NB.el('dt', { text: factor.words }), NB.el('dd', { text })];
        }),
      ),
      table,
      NB.el(
        'p',
        { class: 'small' },
        'Full precision and all columns: ',
        NB.el('code', { text: command }),
        ' ',
        NB.el('button', { type: 'button', class: 'no-print', onclick: () => this.copy(command, copied) }, 'Copy'),
        ' ',
        copied,
      ),
    );
    this.pose(index, row);
    if (this.started) this.remember();
  }

  /** @type {{ [outcome: string]: string }} */
  static outcomes = {
    ok: 'feasible',
    failed: 'failed criterion',
    rejected: 'rejected',
    invalid: 'invalid layout',
    not_judged: 'not evaluated',
    'none works': 'no feasible configuration',
  };

  /** @param {number} index @param {number} c */
  outcomeText(index, c) {
    const [outcome, , words] = this.page.outcomeNames[this.outcomes[c * this.count + index]];
    const style = { ok: 'good', failed: 'bad', rejected: 'off', invalid: 'off', not_judged: 'off' }[outcome];
    const sign = { ok: '\u2713', failed: '\u2717', rejected: '\u2013', invalid: '\u2205', not_judged: '?' }[outcome];
    return [
      NB.el('span', { class: style, text: `${sign} ${StudyPage.outcomes[outcome]}` }),
      words ? NB.el('div', { class: 'soft', text: words }) : '',
    ];
  }

  /** @param {string} text @param {HTMLElement} status */
  async copy(text, status) {
    try {
      await navigator.clipboard.writeText(text);
      status.textContent = 'copied';
    } catch {
      status.textContent = 'select and copy it by hand: this browser denies access to the clipboard';
    }
  }

  /**
   * The posture of a row, where it is on the page.
   * @param {number} index
   * @param {number} c
   */
  pose(index, c) {
    if (!this.scene) return;
    const at = this.posed.get(index);
    const joints =
      at === undefined
        ? null
        : Array.from(this.poses.subarray((8 * at + c) * 6, (8 * at + c) * 6 + 6), (value) => (value * Math.PI) / 180);
    this.scene.show(at, joints, `${this.page.configurations[c]} in case ${this.caseOf(index)}`);
  }
}

/** Lengths in mm that are rounding only. */
NB.isRounding = ({ unit, values }) => {
  if (unit !== 'mm') return false;
  let any = false;
  for (const value of values) {
    if (Number.isNaN(value)) continue;
    if (Math.abs(value) >= NB.ROUNDING_MM) return false;
    any = true;
  }
  return any;
};

NB.start((page, app) => {
  NB.current = new StudyPage(page, app);
});

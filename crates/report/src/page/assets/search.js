// The page of a search: the best candidate, the sensitivity about it, and equivalent candidates.
'use strict';

/**
 * A number of things.
 * @param {number} number
 * @param {string} thing
 */
const counted = (number, thing) => `${number} ${thing}${number === 1 ? '' : 's'}`;

class SearchPage {
  /** @param {SearchDocument} page @param {HTMLElement} app */
  constructor(page, app) {
    this.page = page;
    this.log = page.search;
    this.answer = this.log.answer;
    this.candidates = this.log.candidates.filter((each) => each.cases > 0);
    this.winner = this.log.candidates[this.answer.winner];
    this.equals = new Set(this.answer.equals);
    this.undecided = new Set(this.answer.undecided);
    this.front = new Map((this.answer.front || []).map((member) => [member.id, member]));
    /** @type {Figure[]} */
    this.figures = [];
    app.classList.add('search', 'study');
    NB.clear(
      app,
      this.headline(),
      NB.el('h2', { class: 'part', text: 'Sensitivity and equivalent candidates' }),
      NB.el('p', {
        class: 'soft small',
        text:
          'Each point is a candidate, evaluated on all its layouts; the line is the best candidate of each ' +
          'interval. Smaller points have fewer layouts and scatter more.',
      }),
      NB.el(
        'div',
        { class: 'figures' },
        page.factors.map((factor, index) => this.flatness(factor, index)),
      ),
      this.front.size ? NB.el('div', { class: 'figures' }, this.paretoFigure()) : null,
      NB.el('h2', { class: 'part', text: 'Search progress' }),
      NB.el('div', { class: 'figures' }, this.progressFigure(), this.spentPanel()),
      page.pictures.length ? NB.el('h2', { class: 'part', text: 'Images of the placements' }) : null,
      page.pictures.length ? NB.el('div', { class: 'panel' }, this.placements()) : null,
      NB.section('All candidates', false, this.candidateTable()),
      NB.section('Generations', false, this.generationTable()),
    );
  }

  /**
   * A figure of an objective as people read it.
   * @param {number | null | undefined} value
   * @param {number} [index]
   */
  figure(value, index = 0) {
    if (value === null || value === undefined) return 'none';
    const { unit } = this.page.objectives[index] || { unit: '1' };
    return unit === '1'
      ? `${NB.fixed(100 * value, 1)} %`
      : `${NB.fixed(value, this.page.objectives[index].moreIsBetter ? 1 : 3)} ${unit}`;
  }

  /** @param {number | null} value */
  share(value) {
    return value === null ? 'none' : `${NB.fixed(100 * value, 1)} %`;
  }

  /** @param {Estimate} estimate @param {(value: number) => string} show */
  ends({ interval }, show) {
    const { low, high } = interval;
    if (low === null) return high === null ? '' : ` (97.5 % upper confidence bound ${show(high)})`;
    if (high === null) return ` (97.5 % lower confidence bound ${show(low)})`;
    return ` (95 % CI ${show(low)} to ${show(high)})`;
  }

  headline() {
    const { answer, log, page } = this;
    const estimate = answer.figures[0];
    const sentence =
      `${page.objectives[0].words} ` +
      `${this.figure(estimate.value)}${this.ends(estimate, (value) => this.figure(value))} on ${estimate.cases} ` +
      'held-out layouts';
    const as_good = this.front.size
      ? `${[...this.front.values()].filter((each) => each.is_certain).length} of ${this.front.size} are certainly ` +
        'Pareto-optimal.'
      : `${this.equals.size - 1} others are not significantly different; ${this.undecided.size} more were eliminated ` +
        'on fewer layouts and may be equivalent.';
    return NB.el(
      'section',
      { class: 'panel answer' },
      NB.el('p', { class: 'sentence', text: sentence[0].toUpperCase() + sentence.slice(1) }),
      NB.el(
        'dl',
        null,
        page.factors.map((factor, index) => [
          NB.el('dt', { text: factor.words }),
          NB.el(
            'dd',
            null,
            `${this.winner.choice[index][1]} ${factor.unit}`,
            factor.key ? [' ', NB.el('code', { class: 'soft', text: factor.key })] : null,
          ),
        ]),
        NB.el('dt', { text: 'success rate' }),
        NB.el('dd', {
          text: `${this.share(answer.rate.value)}${this.ends(answer.rate, (value) => this.share(value))}`,
        }),
        NB.el('dt', { text: this.front.size ? 'Pareto front' : 'tied' }),
        NB.el('dd', { text: as_good }),
        NB.el('dt', { text: 'on the selection layouts' }),
        NB.el('dd', {
          text: `${this.figure(answer.selected_by[0].value)}: optimistic (selection bias)`,
        }),
        NB.el('dt', { text: 'clearance classes' }),
        NB.el('dd', { text: log.classes.map((name) => NB.words(name)).join(', ') }),
      ),
      NB.el('p', {
        class: 'soft small',
        text: 'Cases are final postures; motions were not planned.',
      }),
    );
  }

  /** @param {number} id @returns {CandidateKind} */
  kindOf(id) {
    if (id === this.winner.id) return 'best';
    const member = this.front.get(id);
    if (member) return member.is_certain ? 'certain' : 'maybe';
    if (this.equals.has(id)) return 'equal';
    return 'other';
  }

  /** @type {{ [purpose: string]: string }} */
  static purposes = {
    screening: 'screening of the ranges',
    evolution: 'evolution',
    halving: 'successive halving',
    final: 'finalists, all layouts',
    fresh: 'winner, held-out layouts',
  };

  /** @type {Record<CandidateKind, { color: string, words: string }>} */
  static looks = {
    best: { color: '#d55e00', words: 'best' },
    equal: { color: '#0072b2', words: 'tied with the best' },
    certain: { color: '#0072b2', words: 'Pareto-optimal' },
    maybe: { color: '#56b4e9', words: 'possibly Pareto-optimal' },
    other: { color: '#9aa1aa', words: 'others' },
  };

  /** @param {Painter} context @param {number} x @param {number} y @param {CandidateKind} kind @param {number} [size] */
  dot(context, x, y, kind, size = 3.5) {
    context.fillStyle = SearchPage.looks[kind].color;
    context.strokeStyle = '#fff';
    context.lineWidth = 1;
    context.beginPath();
    if (kind === 'best') {
      context.moveTo(x, y - 7);
      context.lineTo(x + 7, y);
      context.lineTo(x, y + 7);
      context.lineTo(x - 7, y);
      context.closePath();
    } else context.arc(x, y, size, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  /** @param {string | null} [line] @returns {Mark[]} */
  legend(line) {
    /** @type {CandidateKind[]} */
    const kinds = ['best', 'equal', 'certain', 'maybe', 'other'];
    const seen = kinds.filter((kind) => this.candidates.some((each) => this.kindOf(each.id) === kind));
    /** @type {Mark[]} */
    const items = seen.map((kind) => ({
      text: SearchPage.looks[kind].words,
      draw: (context, x, y) => this.dot(context, x, y, kind),
    }));
    if (line) {
      items.push({
        text: line,
        draw: (context, x, y) => {
          context.strokeStyle = '#444';
          context.lineWidth = 1.5;
          context.beginPath();
          context.moveTo(x - 8, y);
          context.lineTo(x + 8, y);
          context.stroke();
        },
      });
    }
    return items;
  }

  /**
   * Ends of an axis around values; what is far below the best would flatten all else.
   * @param {number[]} values
   * @param {boolean} moreIsBetter
   */
  range(values, moreIsBetter) {
    const sorted = [...values].sort((a, b) => a - b);
    let [low, high] = [sorted[0], sorted[sorted.length - 1]];
    const [poor, good] = [0.4, 0.6].map((share) => sorted[Math.round(share * (sorted.length - 1))]);
    if (moreIsBetter) low = Math.max(low, poor - 1.5 * (high - poor));
    else high = Math.min(high, good + 1.5 * (good - low));
    const room = 0.06 * (high - low) || 1;
    return { low: low - room, high: high + room };
  }

  /** @param {number} index */
  axisTitle(index) {
    const { words, unit } = this.page.objectives[index];
    return unit === '1' ? `${words} (%)` : `${words} (${unit})`;
  }

  /** @param {Candidate} candidate @param {number} [index] */
  at(candidate, index = 0) {
    const { value } = candidate.figures[index];
    if (value === null) return null;
    return this.page.objectives[index].unit === '1' ? 100 * value : value;
  }

  /** @param {SearchFactor} factor @param {number} index */
  flatness(factor, index) {
    const levels = factor.levels?.every((level) => typeof level === 'number') ? null : factor.levels;
    // Of numbers, the number itself; of other levels, which one it is.
    const points = this.candidates.flatMap((each) => {
      const [, value] = each.choice[index];
      const y = this.at(each);
      return y === null ? [] : [{ each, x: levels ? levels.indexOf(value) : Number(value), y }];
    });
    const ends = factor.range || (factor.levels || []).map(Number);
    /** @type {AxisRange} */
    const x = levels
      ? { low: -0.5, high: levels.length - 0.5, labels: levels.map(String), title: factor.words }
      : {
          low: Math.min(...ends),
          high: Math.max(...ends),
          title: `${factor.words}${factor.unit ? ` (${factor.unit})` : ''}`,
        };
    if (!x.labels) {
      const room = 0.03 * (x.high - x.low) || 1;
      x.low -= room;
      x.high += room;
    }
    const better = this.page.objectives[0].moreIsBetter;
    const y = {
      ...this.range(
        points.map((point) => point.y),
        better,
      ),
      title: this.axisTitle(0),
    };
    // Only those with as many layouts as an evolution has: fewer are optimistically biased.
    const least = Math.min(this.log.samples / 4, this.winner.cases);
    /** @type {Map<number, (typeof points)[number]>} */
    const bins = new Map();
    for (const point of points) {
      if (point.each.cases < least) continue;
      const bin = factor.levels ? point.x : Math.floor((12 * (point.x - x.low)) / (x.high - x.low));
      const known = bins.get(bin);
      if (!known || (better ? point.y > known.y : point.y < known.y)) bins.set(bin, point);
    }
    const line = [...bins.values()].sort((a, b) => a.x - b.x);
    const most = Math.max(...points.map((point) => point.each.cases));
    const figure = new Figure({
      name: `${this.page.name}_${factor.name}`,
      title: factor.words,
      height: 260,
      label: `${this.page.objectives[0].words} over ${factor.words}`,
      legend: () => this.legend(x.labels ? null : 'best of each interval'),
      paint: (context, width, height) => {
        const axes = new Axes({ left: 66, top: 8, width: width - 76, height: height - 52 }, x, y);
        axes.draw(context);
        context.save();
        context.beginPath();
        context.rect(axes.box.left, axes.box.top, axes.box.width, axes.box.height);
        context.clip();
        if (!x.labels && line.length > 1) {
          context.strokeStyle = '#444';
          context.lineWidth = 1.5;
          context.beginPath();
          for (const point of line) context.lineTo(axes.px(point.x), axes.py(point.y));
          context.stroke();
        }
        const order = { other: 0, maybe: 1, certain: 2, equal: 2, best: 3 };
        for (const point of [...points].sort((a, b) => order[this.kindOf(a.each.id)] - order[this.kindOf(b.each.id)])) {
          this.dot(
            context,
            axes.px(point.x),
            axes.py(point.y),
            this.kindOf(point.each.id),
            1.6 + 2.6 * Math.sqrt(point.each.cases / most),
          );
        }
        context.restore();
      },
    });
    this.figures.push(figure);
    return figure.element;
  }

  paretoFigure() {
    const points = this.candidates.flatMap((each) => {
      const [x, y] = [this.at(each, 0), this.at(each, 1)];
      return x === null || y === null ? [] : [{ each, x, y }];
    });
    const [first, second] = this.page.objectives;
    const x = {
      ...this.range(
        points.map((point) => point.x),
        first.moreIsBetter,
      ),
      title: this.axisTitle(0),
    };
    const y = {
      ...this.range(
        points.map((point) => point.y),
        second.moreIsBetter,
      ),
      title: this.axisTitle(1),
    };
    const members = points.filter(({ each }) => this.front.get(each.id)?.by_estimate).sort((a, b) => a.x - b.x);
    const figure = new Figure({
      name: `${this.page.name}_front`,
      title: 'Pareto front',
      height: 320,
      help: 'Bars: 95 % CI of candidates evaluated on held-out layouts.',
      legend: () => this.legend(),
      paint: (context, width, height) => {
        const axes = new Axes({ left: 66, top: 8, width: width - 76, height: height - 52 }, x, y);
        axes.draw(context);
        context.save();
        context.beginPath();
        context.rect(axes.box.left, axes.box.top, axes.box.width, axes.box.height);
        context.clip();
        context.strokeStyle = '#444';
        context.beginPath();
        for (const point of members) context.lineTo(axes.px(point.x), axes.py(point.y));
        context.stroke();
        for (const member of this.front.values()) {
          /** @param {number | null} value @param {number} index */
          const scale = (value, index) =>
            value !== null && this.page.objectives[index].unit === '1' ? 100 * value : value;
          const [a, b] = (member.fresh || []).map((estimate, index) => ({
            at: scale(estimate.value, index),
            low: scale(estimate.interval.low, index),
            high: scale(estimate.interval.high, index),
          }));
          if (!a || !b || a.at === null || b.at === null) continue;
          context.strokeStyle = '#0072b2';
          context.lineWidth = 1;
          context.beginPath();
          context.moveTo(axes.px(a.low ?? x.low), axes.py(b.at));
          context.lineTo(axes.px(a.high ?? x.high), axes.py(b.at));
          context.moveTo(axes.px(a.at), axes.py(b.low ?? y.low));
          context.lineTo(axes.px(a.at), axes.py(b.high ?? y.high));
          context.stroke();
        }
        for (const point of points) this.dot(context, axes.px(point.x), axes.py(point.y), this.kindOf(point.each.id));
        context.restore();
      },
    });
    this.figures.push(figure);
    return figure.element;
  }

  progressFigure() {
    let cases = 0;
    /** @type {{ x: number, best: number, middle: number }[]} */
    const points = [];
    const better = this.page.objectives[0].moreIsBetter;
    for (const generation of this.log.generations) {
      cases += generation.cases;
      if (generation.stream === 'fresh') continue;
      const scale = this.page.objectives[0].unit === '1' ? 100 : 1;
      const values = generation.candidates
        .map((each) => each.figures[0])
        .filter((value) => value !== null)
        .map((value) => scale * value);
      if (values.length)
        points.push({
          x: cases,
          best: better ? Math.max(...values) : Math.min(...values),
          middle: values.sort((a, b) => a - b)[values.length >> 1],
        });
    }
    const x = { low: 0, high: Math.max(cases, 1), title: 'cases computed' };
    const y = {
      ...this.range(
        points.flatMap((point) => [point.best, point.middle]),
        better,
      ),
      title: this.axisTitle(0),
    };
    /**
     * @param {Painter} context
     * @param {Axes} axes
     * @param {'best' | 'middle'} key
     * @param {string} color
     * @param {number[]} dash
     */
    const line = (context, axes, key, color, dash) => {
      context.strokeStyle = color;
      context.setLineDash(dash);
      context.lineWidth = 1.5;
      context.beginPath();
      for (const point of points) context.lineTo(axes.px(point.x), axes.py(point[key]));
      context.stroke();
      context.setLineDash([]);
      // A generation alone makes no line.
      context.fillStyle = color;
      for (const point of points) {
        context.beginPath();
        context.arc(axes.px(point.x), axes.py(point[key]), 2.5, 0, 2 * Math.PI);
        context.fill();
      }
    };
    /** @param {string} text @param {string} color @param {number[]} dash @returns {Mark} */
    const key = (text, color, dash) => ({
      text,
      draw: (context, px, py) => {
        context.strokeStyle = color;
        context.setLineDash(dash);
        context.lineWidth = 1.5;
        context.beginPath();
        context.moveTo(px - 8, py);
        context.lineTo(px + 8, py);
        context.stroke();
        context.setLineDash([]);
      },
    });
    const figure = new Figure({
      name: `${this.page.name}_progress`,
      title: 'Best and median of each generation',
      height: 260,
      help: 'On the layouts of each generation; values may drop as layouts are added.',
      legend: () => [key('best of the generation', '#d55e00', []), key('median of the generation', '#666', [5, 3])],
      paint: (context, width, height) => {
        const axes = new Axes({ left: 66, top: 8, width: width - 76, height: height - 52 }, x, y);
        axes.draw(context);
        context.save();
        context.beginPath();
        context.rect(axes.box.left, axes.box.top, axes.box.width, axes.box.height);
        context.clip();
        line(context, axes, 'middle', '#666', [5, 3]);
        line(context, axes, 'best', '#d55e00', []);
        context.restore();
      },
    });
    this.figures.push(figure);
    return figure.element;
  }

  spentPanel() {
    const { log } = this;
    /** @type {Map<string, number>} */
    const byPurpose = new Map();
    for (const { purpose, cases } of log.generations) byPurpose.set(purpose, (byPurpose.get(purpose) || 0) + cases);
    return NB.el(
      'section',
      { class: 'panel' },
      NB.el('h3', { text: 'Computational cost' }),
      NB.table(
        'Cases by purpose',
        [
          { title: 'Purpose', cell: ([purpose]) => SearchPage.purposes[purpose] || purpose },
          { title: 'Cases', numeric: true, cell: ([, cases]) => cases },
        ],
        [...byPurpose, ['all', log.cases]],
      ),
      NB.el('p', {
        class: 'small',
        text:
          `${log.grid_cases ? `Exhaustive search: ${log.grid_cases} cases. ` : ''}Reachability alone eliminated ` +
          `${counted(log.ruled_out, 'candidate')} (${counted(log.cases_spared, 'case')} saved).`,
      }),
    );
  }

  placements() {
    return [
      NB.el('p', {
        class: 'soft small',
        text: 'Patient of the scenario, configuration with the largest margin.',
      }),
      NB.el(
        'div',
        { class: 'placements' },
        this.page.pictures.map((picture) =>
          NB.el(
            'figure',
            null,
            NB.el('img', { src: picture.address, alt: `${picture.choice}: ${picture.configuration}` }),
            NB.el(
              'figcaption',
              { class: 'small' },
              NB.el('strong', {
                text: this.front.size ? 'Pareto front: ' : picture.id === this.winner.id ? 'Best: ' : 'Tied: ',
              }),
              `${picture.choice}. ${picture.configuration} at ${NB.words(picture.goal)}, margin ` +
                `${NB.fixed(picture.marginMm, 1)} mm.`,
            ),
          ),
        ),
      ),
    ];
  }

  candidateTable() {
    const better = this.page.objectives[0].moreIsBetter ? 1 : -1;
    /** @param {Candidate} each */
    const order = (each) => (each.figures[0].value === null ? -Infinity : better * each.figures[0].value);
    const rows = [...this.candidates].sort((a, b) => b.cases - a.cases || order(b) - order(a)).slice(0, 200);
    /** @param {Candidate} each */
    const kind = (each) => {
      const known = this.kindOf(each.id);
      return known === 'other' ? '' : SearchPage.looks[known].words;
    };
    return NB.el(
      'div',
      null,
      rows.length < this.candidates.length
        ? NB.el('p', { class: 'soft small', text: `The first 200 of ${this.candidates.length}; search.json has all.` })
        : null,
      NB.table(
        'Candidates, most layouts first',
        [
          { title: 'Number', cell: (each) => each.id },
          ...this.page.factors.map((factor, index) => ({
            title: factor.words,
            unit: factor.unit,
            numeric: !factor.levels,
            cell: (/** @type {Candidate} */ each) => each.choice[index][1],
          })),
          { title: 'Layouts', numeric: true, cell: (each) => each.cases },
          ...this.page.objectives.map((objective, index) => ({
            title: objective.words,
            numeric: true,
            cell: (/** @type {Candidate} */ each) => this.figure(each.figures[index].value, index),
          })),
          { title: 'Success rate', numeric: true, cell: (each) => this.share(each.rate.value) },
          {
            title: 'Status',
            cell: (each) => kind(each) || (this.undecided.has(each.id) ? 'eliminated, may be equivalent' : ''),
          },
        ],
        rows,
        { class: 'small' },
      ),
    );
  }

  generationTable() {
    return NB.table(
      'Generations, each a separate study',
      [
        { title: 'Generation', cell: (each) => `gen_${String(each.generation).padStart(3, '0')}` },
        { title: 'Purpose', cell: (each) => SearchPage.purposes[each.purpose] || each.purpose },
        { title: 'Candidates', numeric: true, cell: (each) => each.candidates.length },
        {
          title: 'Layouts',
          numeric: true,
          cell: (each) =>
            `${each.circumstances[0]} to ${each.circumstances[1] - 1}${each.stream === 'fresh' ? ' (held-out)' : ''}`,
        },
        { title: 'Cases', numeric: true, cell: (each) => each.cases },
      ],
      this.log.generations,
      { class: 'small' },
    );
  }
}

NB.start((page, app) => {
  NB.current = new SearchPage(page, app);
});

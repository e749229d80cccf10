// The statistics of a study: the answer, then all tables.
'use strict';

/** Lengths below a nanometre are rounding: an ideal arm has no error. mm. */
NB.ROUNDING_MM = 1e-6;

/** Candidates in the figure; the table has more. */
NB.MOST_CHOICES = 12;

class Statistics {
  /** @param {StudyPage} study */
  constructor(study) {
    this.study = study;
    this.page = study.page;
    this.summary = study.summary;
  }

  /**
   * A metric of the summary in words.
   * @param {string} name
   */
  metric(name) {
    const found = this.summary.metrics?.find((metric) => metric.name === name);
    return found ? this.study.titleOf(found) : NB.words(name);
  }

  /**
   * Whether a metric of the summary is rounding only.
   * @param {string} name
   */
  isExact(name) {
    const spreads = this.summary.spreads?.filter((each) => each.metric === name) || [];
    const known = spreads.flatMap((each) => each.quantiles.map((quantile) => quantile.value));
    return (
      this.summary.metrics?.find((metric) => metric.name === name)?.unit === 'mm' &&
      known.length > 0 &&
      known.every((value) => Math.abs(value ?? 0) < NB.ROUNDING_MM)
    );
  }

  /** @param {Interval} interval */
  percents({ low, high }) {
    return `${NB.fixed(100 * low, 1)} to ${NB.fixed(100 * high, 1)}`;
  }

  /**
   * A share of layouts with its interval.
   * @param {Rate | null | undefined} value
   */
  rate(value) {
    if (!value || value.rate === null || value.rate === undefined) return '\u2013';
    return `${NB.fixed(100 * value.rate, 1)} %${value.interval ? ` (${this.percents(value.interval)})` : ''}`;
  }

  /**
   * A value of a study with its unit and its interval; shares are of 1.
   * @param {number | null | undefined} value
   * @param {string} unit
   * @param {Interval | null} [interval]
   */
  text(value, unit, interval) {
    /** @param {number} each */
    const one = (each) => (unit === '1' ? `${NB.fixed(100 * each, 1)} %` : NB.measured(each, unit));
    if (value === null || value === undefined) return '\u2013';
    if (!interval) return one(value);
    const range = unit === '1' ? this.percents(interval) : `${one(interval.low)} to ${one(interval.high)}`;
    return `${one(value)} (${range})`;
  }

  /** The answer of the study: its sentence, its comparison, its criteria, and the configurations. */
  first() {
    const { answer } = this.summary;
    return [
      answer
        ? NB.el(
            'section',
            { class: 'panel answer' },
            NB.el('p', {
              class: 'sentence',
              text: `${answer.sentence.charAt(0).toUpperCase()}${answer.sentence.slice(1)}.`,
            }),
            answer.remarks.length
              ? NB.el(
                  'ul',
                  { class: 'plain' },
                  answer.remarks.map((remark) =>
                    NB.el('li', { text: `${remark.charAt(0).toUpperCase()}${remark.slice(1)}.` }),
                  ),
                )
              : null,
          )
        : null,
      this.criteria(),
      NB.el('div', { class: 'pair' }, ...this.compared(), this.configurations()),
    ].filter((each) => each !== null);
  }

  /** Criteria with values, limits, verdicts and their requirements. */
  criteria() {
    const { criteria = [] } = this.summary;
    if (!criteria.length) return null;
    /** @param {StudyCriterion} c */
    const verdict = (c) => {
      const open = c.value === null || (c.confidence && c.interval === null);
      return NB.el('span', {
        class: c.pass ? 'good' : 'bad',
        text: c.pass ? '\u2713 met' : open ? '? not evaluated' : '\u2717 failed',
      });
    };
    /** @param {'of' | 'requirement' | 'choice'} key */
    const has = (key) => criteria.some((c) => c[key]);
    /** @type {Column<StudyCriterion>[]} */
    const columns = [
      { title: 'Criterion', cell: (c) => NB.words(c.criterion.replace(/_mm$/, '')) },
      { title: 'Result', cell: verdict },
      ...(has('of')
        ? [
            {
              title: 'Of',
              cell: (/** @type {StudyCriterion} */ c) => (c.of === 'best' ? 'best per layout' : c.of || ''),
            },
          ]
        : []),
      { title: 'Value (95 % CI)', numeric: true, cell: (c) => this.text(c.value, c.unit, c.interval) },
      {
        title: 'Limit',
        numeric: true,
        cell: (c) => `${c.criterion.startsWith('min') ? '\u2265' : '\u2264'} ${this.text(c.limit, c.unit)}`,
      },
      ...(has('requirement')
        ? [{ title: 'Requirement', text: true, cell: (/** @type {StudyCriterion} */ c) => c.requirement || '' }]
        : []),
      ...(has('choice')
        ? [{ title: 'With the best candidate', cell: (/** @type {StudyCriterion} */ c) => c.choice || '' }]
        : []),
      {
        title: 'Evaluated quantity',
        text: true,
        cell: (c) => `${c.detail}${c.confidence ? ', tested at the unfavourable CI bound' : ''}`,
      },
      { title: 'Worst cases', cell: (c) => this.study.caseButtons((c.cases || []).slice(0, 5)) },
    ];
    return NB.el(
      'section',
      { class: 'panel criteria' },
      NB.table('Criteria of the study', columns, criteria, { class: 'small' }),
    );
  }

  /** Figures of the candidates, or of the levels that are compared. */
  compared() {
    const ranking = this.summary.choices;
    if (ranking) return [this.choices(ranking)];
    return (this.summary.answer?.compared || []).map((compared, at) => this.levels(compared, at));
  }

  /** @param {ChoiceRanking} ranking */
  choices({ choices, axes }) {
    const names = axes.map((axis) => NB.words(axis.name)).join(', ');
    const shown = choices.slice(0, NB.MOST_CHOICES);
    /** @param {Choice} choice */
    const style = (choice) => (!choice.against_first?.distinguishable ? '#0072b2' : '#767676');
    const rows = shown.map((choice, at) => ({
      label: `${at + 1}. ${choice.label}`,
      value: choice.works.rate === null ? null : 100 * choice.works.rate,
      interval: this.scaled(choice.works.interval),
      text: this.rate(choice.works),
      style: style(choice),
    }));
    const x = { low: 0, high: 100, title: 'layouts with a feasible configuration (%)' };
    /** @param {string} color @returns {Mark['draw']} */
    const dot = (color) => (context, a, b) => {
      context.fillStyle = color;
      context.beginPath();
      context.arc(a, b, 4.5, 0, 2 * Math.PI);
      context.fill();
    };
    const isCut = choices.length > shown.length;
    const rest = isCut ? ` The first ${shown.length} of ${choices.length}; the table below has more.` : '';
    this.study.compared = new Figure({
      name: `${this.page.name}-choices`,
      title: `Candidates for ${names}, best first`,
      label: 'Success rate by candidate',
      help: `Share of the valid layouts; lines are individual 95 % CI.${rest}`,
      height: NB.dotHeight(rows.length),
      paint: (context, width, height) => NB.dotPlot(context, width, height, rows, x),
      legend: () => [
        { text: 'no. 1 and candidates not significantly different from it', draw: dot('#0072b2') },
        { text: 'significantly lower than no. 1', draw: dot('#767676') },
      ],
    });
    return this.study.compared.element;
  }

  /** @param {Interval | null | undefined} interval */
  scaled(interval) {
    return interval ? { low: 100 * interval.low, high: 100 * interval.high } : null;
  }

  /** @param {ComparedLevels} compared @param {number} at */
  levels(compared, at) {
    const share = compared.unit === '1';
    const factor = share ? 100 : 1;
    const rows = compared.levels.map((level) => ({
      label: `${level.label}${level.small ? ' (small sample)' : ''}`,
      value: level.value === null ? null : factor * level.value,
      interval: level.interval ? { low: factor * level.interval.low, high: factor * level.interval.high } : null,
      text: this.text(level.value, compared.unit, level.interval),
    }));
    const most = Math.max(...rows.map((row) => row.interval?.high ?? row.value ?? 0), 0);
    const x = share
      ? { low: 0, high: 100, title: `${compared.response} (%)` }
      : { low: 0, high: 1.05 * most || 1, title: `${compared.response} (${compared.unit})` };
    const figure = new Figure({
      name: `${this.page.name}-by-${compared.factor}`,
      title: `By ${NB.words(compared.factor)}: ${compared.response}`,
      help:
        'Over all other factors; lines are 95 % CI.' +
        `${compared.differs ? '' : ' Differences are not significant at the 5 % level.'}`,
      height: NB.dotHeight(rows.length),
      paint: (context, width, height) => NB.dotPlot(context, width, height, rows, x),
    });
    if (!at) this.study.compared = figure;
    return figure.element;
  }

  /** Success rate of each configuration. */
  configurations() {
    const { overall, of_choice: best } = this.summary;
    const rows = this.page.configurations.map((label, c) => {
      const found = overall?.configurations?.find((each) => each.label === label)?.success;
      const rate = found?.rate ?? this.counted(c);
      return {
        label,
        value: 100 * rate,
        interval: this.scaled(found?.interval),
        text: found ? this.rate(found) : `${NB.fixed(100 * rate, 1)} %`,
      };
    });
    const each = best ? `, simultaneous for all ${best.of} candidates` : '';
    const x = { low: 0, high: 100, title: 'success rate (% of layouts)' };
    this.study.strip = new Figure({
      name: `${this.page.name}-configurations`,
      title: `Success rate by configuration${best ? `, with ${best.label}` : ''}`,
      help: overall
        ? `Share of the ${NB.grouped(overall.layouts ?? overall.cases)} valid layouts; lines are ` +
          `${Math.round(100 * (this.summary.confidence || 0.95))} % CI${each}.`
        : 'Share of the valid layouts on this page.',
      height: NB.dotHeight(8),
      paint: (context, width, height) => NB.dotPlot(context, width, height, rows, x),
    });
    return this.study.strip.element;
  }

  /** @param {number} c */
  counted(c) {
    const { count, invalid, outcomes, outcomeOf } = this.study;
    let [ok, of] = [0, 0];
    for (let index = 0; index < count; index++) {
      if (invalid[index]) continue;
      of++;
      if (outcomeOf[outcomes[c * count + index]] === 'ok') ok++;
    }
    return of ? ok / of : NaN;
  }

  /** All tables, folded but for what most readers look for. */
  sections() {
    const best = this.summary.of_choice ? `, with ${this.summary.of_choice.label}` : '';
    /**
     * A section of what there is.
     * @template T
     * @param {T | null | undefined} value
     * @param {string} title
     * @param {boolean} open
     * @param {(value: T) => Child} make
     */
    const part = (value, title, open, make) => {
      const isEmpty = value === null || value === undefined || (Array.isArray(value) && !value.length);
      return isEmpty ? [] : [NB.section(title, open, make(value))];
    };
    const { summary } = this;
    return [
      ...part(summary.notes, 'Notes', true, (notes) =>
        NB.el(
          'ul',
          { class: 'plain' },
          notes.map((note) => NB.el('li', { text: String(note) })),
        ),
      ),
      ...part(summary.choices, 'All candidates', true, (ranking) => this.choiceTable(ranking)),
      ...part(summary.replanned, 'Postures versus motions', true, (found) => this.replanned(found)),
      ...part(summary.overall, `Outcomes by configuration${best}`, true, (overall) =>
        [overall, ...(this.summary.goals || [])].map((counts) => this.outcomes(counts)),
      ),
      ...part(summary.evidence, `Notable cases${best}`, true, (evidence) => this.evidence(evidence)),
      ...part(summary.spreads, `Quantiles${best}`, false, (spreads) => this.spreads(spreads)),
      ...part(summary.effects, `Main effects${best ? ', over all candidates' : ''}`, false, (effects) =>
        this.effects(effects),
      ),
      ...part(summary.regions, `Best configuration by region${best ? ', over all candidates' : ''}`, false, (regions) =>
        this.regions(regions),
      ),
      ...part(summary.robustness, 'Robustness to patient motion', false, (found) => this.robustness(found)),
      ...part(summary.methods, 'Methods', false, (methods) =>
        NB.table(
          'Methods and their sources',
          [
            { title: 'Numbers', cell: (m) => m.numbers },
            { title: 'Method', text: true, cell: (m) => m.method },
            { title: 'Source', text: true, cell: (m) => m.source },
          ],
          methods,
          { class: 'small' },
        ),
      ),
      NB.section('Definitions', false, this.definitions()),
      NB.section('Provenance', false, this.provenance()),
    ];
  }

  /** @param {ChoiceRanking} ranking */
  choiceTable({ choices, axes, working_configurations: k, ranked_by: by }) {
    const differs = choices.some((choice) => choice.invalid);
    const hasError = choices.some((choice) => Math.abs(choice.tip_error_mm?.value ?? 0) >= NB.ROUNDING_MM);
    /** @param {Quantile | null} found */
    const quantile = (found) =>
      found
        ? NB.el('span', {
            title: found.interval
              ? `95 % CI ${NB.threeDigits(found.interval.low)} to ${NB.threeDigits(found.interval.high)}`
              : found.remark || '',
            text: NB.threeDigits(found.value),
          })
        : '\u2013';
    /** @param {Choice} choice */
    const against = ({ against_first: found }) => {
      if (!found) return '';
      if (!found.distinguishable) return 'not significant';
      const points = `${NB.fixed(-100 * found.difference, 1)} pp`;
      return found.interval
        ? `${points} (${NB.fixed(-100 * found.interval.high, 1)} to ${NB.fixed(-100 * found.interval.low, 1)})`
        : points;
    };
    const shown = choices.slice(0, 60);
    return [
      NB.table(
        `Candidates for ${axes.map((axis) => NB.words(axis.name)).join(' and ')}, ranked by ${by}`,
        [
          { title: 'Candidate', cell: (c) => c.label },
          {
            title: 'Success rate (95 % CI)',
            numeric: true,
            cell: (c) => this.rate(c.works),
            help: 'share of the valid layouts with at least one feasible configuration',
          },
          { title: `${k} or more feasible`, numeric: true, cell: (c) => this.rate(c.works_k) },
          {
            title: 'Difference to no. 1',
            numeric: true,
            cell: against,
            help: 'percentage points (pp), in brackets the 95 % CI',
          },
          {
            title: 'P5 clearance',
            unit: 'mm',
            numeric: true,
            cell: (c) => quantile(c.best_clearance_mm),
            help: '5th percentile over the feasible layouts, with the best configuration of each',
          },
          ...(hasError
            ? [
                {
                  title: 'Median tip error',
                  unit: 'mm',
                  numeric: true,
                  cell: (/** @type {Choice} */ c) => quantile(c.tip_error_mm),
                },
              ]
            : []),
          { title: 'Cases', numeric: true, cell: (c) => NB.grouped(c.cases) },
          ...(differs
            ? [{ title: 'Invalid layouts', numeric: true, cell: (/** @type {Choice} */ c) => NB.grouped(c.invalid) }]
            : []),
          { title: 'Infeasible cases', cell: (c) => this.study.caseButtons((c.failing || []).slice(0, 5)) },
        ],
        shown,
        { class: 'small' },
      ),
      choices.length > shown.length
        ? NB.el('p', {
            class: 'soft small',
            text: `The first ${shown.length} of ${choices.length}; summary.json has all.`,
          })
        : null,
    ];
  }

  /** @param {Replanned} replanned */
  replanned({ cases, of, gaps }) {
    return NB.table(
      `${cases} of ${NB.grouped(of)} static cases, sampled at random, with motions also planned`,
      [
        { title: 'Configuration', cell: (g) => g.of },
        { title: 'Feasible as posture', numeric: true, cell: (g) => g.by_postures },
        { title: 'Feasible with motion', numeric: true, cell: (g) => g.planned },
        {
          title: 'Difference, 95 % CI',
          unit: 'pp',
          numeric: true,
          cell: (g) => (g.interval ? `${NB.fixed(100 * g.gap, 1)} (${this.percents(g.interval)})` : '\u2013'),
        },
        { title: 'With motion only', numeric: true, cell: (g) => g.gained },
      ],
      gaps,
      { class: 'small' },
    );
  }

  /** @param {Counts} counts */
  outcomes(counts) {
    /** @param {ConfigurationCounts} c */
    const why = (c) =>
      (c.details || [])
        .slice(0, 3)
        .map((detail) => `${this.reason(detail)} ${NB.fixed((100 * detail.count) / (counts.layouts || 1), 1)} %`)
        .join(', ');
    const layouts = counts.layouts ?? counts.cases - counts.invalid;
    /** @param {ConfigurationCounts} c */
    const notJudged = (c) => NB.grouped(c.not_judged);
    return NB.table(
      `${counts.goal ? `Goal ${NB.words(counts.goal)}` : 'All goals'}: ${NB.grouped(layouts)} ` +
        `valid layouts${counts.invalid ? `, ${NB.grouped(counts.invalid)} invalid` : ''}`,
      [
        { title: 'Configuration', cell: (c) => c.label },
        { title: 'Success rate (95 % CI)', numeric: true, cell: (c) => this.rate(c.success) },
        { title: 'Feasible', numeric: true, cell: (c) => NB.grouped(c.ok) },
        { title: 'Failed criterion', numeric: true, cell: (c) => NB.grouped(c.failed) },
        { title: 'Rejected', numeric: true, cell: (c) => NB.grouped(c.rejected) },
        ...(counts.configurations.some((c) => c.not_judged)
          ? [{ title: 'Not evaluated', numeric: true, cell: notJudged }]
          : []),
        {
          title: 'Best',
          numeric: true,
          cell: (c) => NB.grouped(c.best),
          help: 'feasible, with the largest clearance',
        },
        { title: 'Main failures', text: true, cell: why },
        { title: 'Remark', cell: (c) => c.success?.remark || '' },
      ],
      counts.configurations,
      { class: 'small' },
    );
  }

  /**
   * Why a configuration is infeasible, in words.
   * @param {{ detail: string }} found
   */
  reason({ detail }) {
    const known = this.page.outcomeNames.find(([, name]) => name === detail);
    return known ? known[2] : NB.words(detail);
  }

  /**
   * A table for each metric that is more than rounding.
   * @param {Spread[]} spreads
   */
  spreads(spreads) {
    const shares = [...new Set(spreads.flatMap((each) => each.quantiles.map((quantile) => quantile.p)))].sort(
      (a, b) => a - b,
    );
    const names = [...new Set(spreads.map((each) => each.metric))].filter((name) => !this.isExact(name));
    /** @param {Quantile | undefined} found */
    const cell = (found) => {
      if (!found) return '';
      const interval = found.interval
        ? `${NB.threeDigits(found.interval.low)} to ${NB.threeDigits(found.interval.high)}`
        : '';
      return [
        NB.threeDigits(found.value),
        interval
          ? NB.el('div', { class: 'soft interval', text: interval })
          : found.remark
            ? NB.el('div', { class: 'soft interval', text: '\u2013', title: found.remark })
            : '',
      ];
    };
    return names.map((name) =>
      NB.table(
        `${this.metric(name)}: quantiles, 95 % CI below`,
        [
          { title: 'Configuration', cell: (s) => (s.of === 'best' ? 'best per layout' : s.of) },
          { title: 'Layouts', numeric: true, cell: (s) => NB.grouped(s.count) },
          { title: 'Mean', numeric: true, cell: (s) => NB.threeDigits(s.mean) },
          ...shares.map((p) => ({
            title: p === 0 ? 'Minimum' : p === 1 ? 'Maximum' : `P${NB.significant(100 * p)}`,
            numeric: true,
            cell: (/** @type {Spread} */ s) => cell(s.quantiles.find((quantile) => quantile.p === p)),
          })),
        ],
        spreads.filter((each) => each.metric === name),
        { class: 'small' },
      ),
    );
  }

  /** @param {Effects} effects */
  effects(effects) {
    /** @type {{ [response: string]: string }} */
    const words = {
      any_works: 'Any configuration feasible',
      working: 'Number of feasible configurations',
      best_clearance_mm: 'Clearance of the best configuration (mm)',
      least_tip_error_mm: 'Smallest tip error of feasible configurations (mm)',
    };
    /** @param {string} name */
    const title = (name) => words[name] || (name.startsWith('success ') ? `${name.slice(8)} feasible` : NB.words(name));
    const shown = effects.responses.filter(
      (response) => !(response.response.endsWith('_mm') && Math.abs(response.mean ?? 0) < NB.ROUNDING_MM),
    );
    /** @param {Effects['responses'][number]['main'][number]} m */
    const share = (m) =>
      m.share === null ? '\u2013' : m.share <= (m.noise ?? 0) ? 'not significant' : NB.fixed(100 * m.share, 1);
    return shown.map((response) =>
      NB.el(
        'div',
        null,
        NB.table(
          `${title(response.response)}: share of variance explained by each factor`,
          [
            { title: 'Factor', cell: (m) => NB.words(effects.axes[m.axis].name) },
            { title: 'Share', unit: '%', numeric: true, cell: share },
            {
              title: 'Chance level',
              unit: '%',
              help: '95th percentile of the share by chance alone',
              numeric: true,
              cell: (m) => NB.fixed(m.noise === null ? NaN : 100 * m.noise, 1),
            },
            { title: 'Mean over the factor', cell: (m) => NB.trend(m.bins.map((bin) => bin.mean)) },
          ],
          [...response.main].sort((a, b) => (b.share || 0) - (a.share || 0)),
          { class: 'small' },
        ),
        response.interactions.some((m) => m.share > m.noise)
          ? NB.table(
              `${title(response.response)}: interactions of factor pairs`,
              [
                {
                  title: 'Factors',
                  cell: (m) => m.axes.map((axis) => NB.words(effects.axes[axis].name)).join(' and '),
                },
                { title: 'Share', unit: '%', numeric: true, cell: (m) => NB.fixed(100 * m.share, 1) },
                { title: 'Chance level', unit: '%', numeric: true, cell: (m) => NB.fixed(100 * m.noise, 1) },
              ],
              response.interactions.filter((m) => m.share > m.noise),
              { class: 'small' },
            )
          : null,
      ),
    );
  }

  /** @param {Regions} regions */
  regions(regions) {
    return regions.maps
      .filter((map) => map.axes.length === 1)
      .map((map) => {
        const axis = regions.axes[map.axes[0]];
        return NB.table(
          `Over ${NB.words(axis.name)}${axis.unit ? ` (${axis.unit})` : ''}`,
          [
            {
              title: axis.unit ? `From .. to (${axis.unit})` : 'Level',
              cell: ({ bin }) => (bin.low === null ? NB.words(bin.label) : bin.label),
            },
            { title: 'Layouts', numeric: true, cell: ({ cell }) => NB.grouped(cell.layouts) },
            {
              title: 'Any feasible',
              unit: '%',
              numeric: true,
              cell: ({ cell }) => NB.fixed((100 * cell.working) / cell.layouts, 1),
            },
            { title: 'Most frequent best', cell: ({ cell }) => cell.winner || 'no clear winner' },
          ],
          map.cells.map((cell, at) => ({ cell, bin: axis.bins[at] })),
          { class: 'small' },
        );
      });
  }

  /**
   * Smallest patient motions that make a configuration infeasible, no bounds.
   * @param {RobustnessResult[]} results
   */
  robustness(results) {
    /** @param {SmallestFound | null | undefined} found */
    const radius = (found) => {
      if (!found) return '\u2013';
      const text = found.found ? NB.fixed(found.found.radius, 1) : `none up to ${NB.significant(found.limit)}`;
      return `${text}${found.impossible ? '*' : ''}${found.settled ? '' : '?'}`;
    };
    /** @param {RobustnessResult} result */
    const why = ({ shift, tilt }) => NB.words((shift.found || tilt.found)?.detail || '');
    return [
      NB.table(
        'Smallest patient motions found that make a configuration infeasible (base scenario)',
        [
          { title: 'Goal', cell: (r) => NB.words(r.goal) },
          { title: 'Configuration', cell: (r) => r.configuration },
          { title: 'Shift', unit: 'mm', numeric: true, cell: (r) => radius(r.shift) },
          { title: 'Rotation', unit: 'deg', numeric: true, cell: (r) => radius(r.tilt) },
          { title: 'Cause', cell: why },
          { title: 'Fixed arm: shift', unit: 'mm', numeric: true, cell: (r) => radius(r.unaware?.shift) },
          { title: 'Fixed arm: rotation', unit: 'deg', numeric: true, cell: (r) => radius(r.unaware?.tilt) },
        ],
        results,
        { class: 'small' },
      ),
      NB.el('p', {
        class: 'soft small',
        text: 'Search results, not bounds. * contains invalid layouts (ignored); ? search not converged.',
      }),
    ];
  }

  /** Definition of each quantity of a case, and its resolution on this page. */
  definitions() {
    const { metrics, exact, factors } = this.study;
    /** @type {{ words: string, unit: string, text: string, step?: number }[]} */
    const rows = [
      {
        words: 'feasible',
        unit: '',
        text: 'the configuration violates no rule and fails no criterion of the scenario',
      },
      { words: 'layout', unit: '', text: 'a valid case: the placement of everything, with one goal' },
      {
        words: 'best per layout',
        unit: '',
        text: 'the feasible configuration with the largest clearance',
      },
      ...metrics.map((metric) => ({
        words: metric.words,
        unit: metric.unit,
        text: metric.description,
        step: metric.column.step,
      })),
      ...exact.map((metric) => ({
        words: metric.words,
        unit: metric.unit,
        text: `${metric.description}; not shown: rounding only, as the arm of this study is ideal`,
      })),
      ...factors
        .filter((factor) => !factor.levels)
        .map((factor) => ({ words: factor.words, unit: factor.unit, text: 'factor', step: factor.column.step })),
    ];
    return NB.table(
      'Definitions; plots and cases on this page are rounded, the tables of statistics are not',
      [
        { title: 'Quantity', cell: (row) => row.words },
        { title: 'Unit', cell: (row) => (row.unit === '1' ? '' : row.unit) },
        { title: 'Definition', text: true, cell: (row) => row.text },
        {
          title: 'Resolution',
          numeric: true,
          cell: (row) => (row.step === undefined ? '' : `\u00b1 ${NB.threeDigits(row.step / 2)}`),
        },
      ],
      rows,
      { class: 'small' },
    );
  }

  provenance() {
    const { manifest } = this.page;
    const { study_id: id, sampling, repeats } = this.summary;
    const { provenance = {}, inputs = {}, seed } = manifest || {};
    const files = Object.entries(inputs);
    /** @type {[name: string, value: string | number | null | undefined][]} */
    const facts = [
      [
        'program',
        provenance.version
          ? `needlebench ${provenance.version} (source ${provenance.source_sha256?.slice(0, 12) ?? 'unknown'})`
          : null,
      ],
      ['study file', this.page.file],
      ['seed of the samples', seed ?? provenance.seed],
      ['arithmetic', provenance.arithmetic],
      ['sampling', sampling],
      ['cases per sampled point', repeats],
      ['hash of everything that affects results', id],
    ];
    return NB.el(
      'div',
      null,
      NB.el(
        'dl',
        null,
        facts
          .filter(([, value]) => value !== null && value !== undefined)
          .flatMap(([name, value]) => [NB.el('dt', { text: name }), NB.el('dd', { text: String(value) })]),
      ),
      files.length
        ? NB.table(
            'Input files',
            [
              { title: 'File', cell: ([file]) => file },
              { title: 'SHA-256', cell: ([, sha256]) => NB.el('code', { text: sha256 }) },
            ],
            files,
            { class: 'small' },
          )
        : null,
      NB.el(
        'details',
        { class: 'no-print' },
        NB.el('summary', { text: 'full content of study.json' }),
        NB.tree(manifest),
      ),
    );
  }

  /**
   * The notable cases, of the best configuration first.
   * @param {Evidence} evidence
   */
  evidence({ invalid = [], fewer_than: fewer = [], configurations = [] }) {
    /** @param {string} text @param {number[]} cases */
    const line = (text, cases) =>
      cases.length ? [NB.el('p', { class: 'small', text }), this.study.caseButtons(cases)] : [];
    /** @param {CasesOf} each */
    const worst = (each) =>
      each.worst
        .filter(({ metric }) => !this.isExact(metric))
        .flatMap(({ metric, cases }) =>
          line(
            `worst ${this.metric(metric)}: ${cases.map((found) => NB.threeDigits(found.value)).join(', ')}`,
            cases.map((found) => found.case),
          ),
        );
    /** @param {CasesOf} each */
    const of = (each) => [...line('infeasible, first cases', each.not_ok || []), ...worst(each)];
    const best = configurations.find((each) => each.of === 'best');
    const others = configurations.filter((each) => each.of !== 'best');
    return NB.el(
      'div',
      null,
      line('no feasible configuration', fewer[0] || []),
      line('invalid layout', invalid),
      best ? worst(best) : null,
      others.length
        ? NB.el(
            'details',
            { class: 'no-print' },
            NB.el('summary', { text: 'by configuration' }),
            others.map((each) => [NB.el('h3', { text: each.of }), of(each)]),
          )
        : null,
    );
  }
}

/** A small curve for a table. */
NB.trend = (values) => {
  const canvas = NB.el('canvas', {
    width: '140',
    height: '26',
    role: 'img',
    'aria-label': values.map((value) => NB.threeDigits(value)).join(', '),
  });
  const context = NB.context(canvas);
  const known = values.filter((value) => value !== null);
  const [low, high] = [Math.min(...known), Math.max(...known)];
  context.strokeStyle = '#0072b2';
  context.fillStyle = '#0072b2';
  context.lineWidth = 1.6;
  context.beginPath();
  values.forEach((value, k) => {
    if (value === null) return;
    const x = values.length > 1 ? 4 + (132 * k) / (values.length - 1) : 70;
    const y = high > low ? 22 - (18 * (value - low)) / (high - low) : 13;
    context.lineTo(x, y);
    context.fillRect(x - 1.5, y - 1.5, 3, 3);
  });
  context.stroke();
  return NB.el(
    'span',
    null,
    canvas,
    NB.el('span', {
      class: 'soft small',
      text: known.length ? ` ${NB.threeDigits(low)} to ${NB.threeDigits(high)}` : '',
    }),
  );
};

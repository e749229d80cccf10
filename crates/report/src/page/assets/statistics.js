// The statistics of a study as tables.
'use strict';

NB.Statistics = class {
  constructor(study) {
    this.study = study;
    this.page = study.page;
  }

  /** A metric of the summary in words. */
  metric(name) {
    const found = this.page.summary.metrics?.find((metric) => metric.name === name);
    return found ? this.study.titleOf(found) : NB.words(name);
  }

  /** What the summary has: known parts as tables, all else as lists. */
  sections() {
    const summary = this.page.summary;
    if (!summary || typeof summary !== 'object') return [];
    const rate = (value) => (value && value.rate !== null && value.rate !== undefined
      ? `${NB.fixed(100 * value.rate, 1)} %${value.interval ? ` (${NB.fixed(100 * value.interval.low, 1)} to ${NB.fixed(100 * value.interval.high, 1)})` : ''}` : '\u2013');
    const done = new Set(['headline', 'of_choice', 'not_ranked', 'over_all_choices', 'replanned', 'mode', 'postures_only', 'schema_version', 'confidence', 'overall', 'goals', 'metrics', 'spreads', 'effects', 'regions', 'choices', 'evidence', 'notes', 'methods', 'criteria', 'not_judged', 'verdict']);
    const sections = [];
    const add = (key, title, open, make) => {
      if (summary[key] === undefined || summary[key] === null) return;
      let content;
      try { content = make(summary[key]); } catch { content = NB.tree(summary[key]); }
      if (content) sections.push(NB.section(title, open, content));
    };
    add('criteria', 'Criteria', true, (criteria) => NB.table('What was checked', [
      { title: 'Criterion', cell: (c) => NB.words(c.criterion) }, { title: 'Of', cell: (c) => c.of || '' }, ...(criteria.some((c) => c.choice) ? [{ title: 'With the best choice', cell: (c) => c.choice || '' }] : []),
      { title: 'Value', numeric: true, cell: (c) => NB.significant(c.value) }, { title: 'Limit', numeric: true, cell: (c) => NB.significant(c.limit) },
      { title: 'Met', cell: (c) => {
        const open = c.value === null || (c.confidence && c.interval === null);
        return NB.el('span', { class: c.pass ? 'good' : 'bad', text: c.pass ? '\u2713 met' : open ? '? not judged' : '\u2717 missed' });
      } },
    ], criteria, { class: 'small' }));
    add('replanned', 'What postures alone overstate', true, ({ cases, of, gaps }) => NB.table(`${cases} of ${of} static cases with their motions planned too, drawn at random`, [
      { title: 'Configuration', cell: (g) => g.of }, { title: 'Ok by posture', numeric: true, cell: (g) => g.by_postures }, { title: 'With a motion', numeric: true, cell: (g) => g.planned },
      { title: 'Gap', unit: 'points', numeric: true, cell: (g) => `${NB.fixed(100 * g.gap, 1)} (${NB.fixed(100 * g.interval.low, 1)} to ${NB.fixed(100 * g.interval.high, 1)})` },
      { title: 'With a motion only', numeric: true, cell: (g) => g.gained },
    ], gaps, { class: 'small' }));
    add('notes', 'Notes', true, (notes) => NB.el('ul', { class: 'plain' }, notes.map((note) => NB.el('li', { text: String(note) }))));
    add('choices', 'Which choice is the best', true, ({ choices, axes }) => NB.table(`Choices of ${axes.map((axis) => NB.words(axis.name)).join(' and ')}, the best first`, [
      { title: 'Choice', cell: (c) => c.label }, { title: 'Cases', numeric: true, cell: (c) => c.cases },
      { title: 'Any works', numeric: true, cell: (c) => rate(c.works) }, { title: 'Enough work', numeric: true, cell: (c) => rate(c.works_k) },
      { title: 'Clearance, 5 %', unit: 'mm', numeric: true, cell: (c) => NB.significant(c.best_clearance_mm?.value) },
      { title: 'Tip error, median', unit: 'mm', numeric: true, cell: (c) => NB.significant(c.tip_error_mm?.value) },
      { title: 'Told apart from the first', cell: (c) => (c.against_first ? (c.against_first.distinguishable ? `yes, ${NB.fixed(100 * c.against_first.difference, 1)} %` : 'no') : '') },
      { title: 'Fails in', cell: (c) => this.study.caseButtons((c.failing || []).slice(0, 5)) },
    ], choices.slice(0, 60), { class: 'small' }));
    const best = summary.of_choice ? `, with the best choice: ${summary.of_choice.label}` : '';
    add('overall', `What became of the configurations${best}`, true, (overall) => [overall, ...(summary.goals || [])].map((counts) => NB.table(
      counts.goal ? `Goal ${NB.words(counts.goal)}: ${counts.cases} cases, ${counts.invalid} invalid` : `All goals: ${counts.cases} cases, ${counts.invalid} invalid`, [
        { title: 'Configuration', cell: (c) => c.label }, { title: 'Ok', numeric: true, cell: (c) => c.ok }, { title: 'Failed', numeric: true, cell: (c) => c.failed },
        { title: 'Rejected', numeric: true, cell: (c) => c.rejected }, { title: 'Best', numeric: true, cell: (c) => c.best },
        { title: 'Success', numeric: true, cell: (c) => rate(c.success) }, { title: '', cell: (c) => c.success?.remark || '' },
      ], counts.configurations, { class: 'small' })));
    add('spreads', `Quantiles${best}`, false, (spreads) => {
      const shares = [...new Set(spreads.flatMap((each) => each.quantiles.map((quantile) => quantile.p)))].sort((a, b) => a - b);
      return NB.table('Quantiles with their intervals', [
        { title: 'Metric', cell: (s) => this.metric(s.metric) }, { title: 'Of', cell: (s) => s.of }, { title: 'Values', numeric: true, cell: (s) => s.count },
        { title: 'Mean', numeric: true, cell: (s) => NB.significant(s.mean) },
        ...shares.map((p) => ({ title: p === 0 ? 'least' : p === 1 ? 'largest' : `${NB.significant(100 * p)} %`, numeric: true, cell: (s) => {
          const found = s.quantiles.find((quantile) => quantile.p === p);
          return found ? NB.el('span', { title: found.interval ? `${NB.significant(found.interval.low)} to ${NB.significant(found.interval.high)}` : found.remark || '', text: NB.significant(found.value) }) : '';
        } })),
      ], spreads, { class: 'small' });
    });
    add('effects', `What the factors do${summary.of_choice ? ', over all choices' : ''}`, false, (effects) => effects.responses.map((response) => NB.el('div', null,
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
    add('evidence', `Cases worth a look${best}`, true, (evidence) => this.evidence(evidence));
    add('regions', `Best configuration by region${summary.of_choice ? ', over all choices' : ''}`, false, (regions) => regions.maps.filter((map) => map.axes.length === 1).map((map) => {
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
      [...this.study.factors.filter((factor) => !factor.levels), ...this.study.metrics].map((each) => NB.el('li', { text: `${NB.words(each.name)}: to \u00b1 ${NB.significant(each.column.step / 2)}` })))));
    return sections;
  }

  evidence(evidence) {
    const parts = [];
    const walk = (value, title) => {
      if (Array.isArray(value) && value.length && value.every((each) => Number.isInteger(each))) {
        parts.push(NB.el('p', { class: 'small', text: title }), this.study.caseButtons(value.slice(0, 20)));
      } else if (Array.isArray(value) && value.length && value.every((each) => each && Number.isInteger(each.case))) {
        parts.push(NB.el('p', { class: 'small', text: `${title}: ${value.slice(0, 5).map((each) => NB.significant(each.value)).join(', ')}${value.length > 5 ? ' \u2026' : ''}` }), this.study.caseButtons(value.slice(0, 20).map((each) => each.case)));
      } else if (Array.isArray(value)) {
        value.forEach((each, at) => walk(each, `${title}${each && (each.of || each.metric) ? ` ${each.of ? NB.words(each.of) : this.metric(each.metric)}` : value.length > 1 ? ` ${at + 1}` : ''}`));
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

// Sections of the page of a run: tables and charts that need no view.
'use strict';

/** A colour, or its number, for each of the eight configurations; labels in the view name them, too. */
NB.ghostColors = [
  NB.palette.orange,
  NB.palette.sky,
  NB.palette.green,
  NB.palette.yellow,
  NB.palette.blue,
  NB.palette.vermillion,
  NB.palette.purple,
  NB.palette.grey,
];

NB.swatch = (color) => {
  const element = NB.el('span', { class: 'swatch', 'aria-hidden': 'true' });
  element.style.background = color;
  return element;
};

/** Several texts in one sentence's list. */
NB.listed = (texts) => texts.filter(Boolean).join('; ');

/** What a criterion is about, in words: `events.press[0].max_recovery_s` is of the first contact. */
NB.criterionWords = (name) => {
  const press = /^events\.press\[(\d+)\]\.(.*)$/.exec(name);
  if (press) return `contact ${Number(press[1]) + 1}: ${NB.words(press[2])}`;
  return NB.words(name);
};

/** The classes of a report's clearances. */
NB.byClass = (clearances) => {
  const all = Object.entries(/** @type {{ [name: string]: ClassMinimum | undefined }} */ (clearances));
  return /** @type {[string, ClassMinimum][]} */ (all.filter(([, found]) => found?.witness_points_m));
};

/** The classes of arm and tool against their surroundings, self-clearance left out. */
NB.around = (page, clearances) => NB.byClass(clearances).filter(([name]) => page.classesAround.includes(name));

/** The clearance, as in the terminal's column of that name: the least distance from the surroundings. */
NB.leastAround = (page, clearances) => {
  const all = NB.around(page, clearances);
  if (!all.length) return null;
  const [name, found] = all.reduce((best, each) => (each[1].minimum_m < best[1].minimum_m ? each : best));
  return { name, ...found };
};

/** Its certified lower bound; null unless every class has one. */
NB.certifiedAround = (page, clearances) => {
  const bounds = NB.around(page, clearances).flatMap(([, found]) => found.certified_lower_bound_m ?? -Infinity);
  const least = Math.min(...bounds);
  return Number.isFinite(least) ? least : null;
};

NB.sections = /** @type {RunSections} */ (
  /** @type {Partial<RunSections>} */ ({
    /** What to choose, and why, before all else; of a motion from a file there is nothing to choose. */
    answer(goal, criteria, trueTarget, isJudged) {
      const { recommended } = goal;
      return [
        recommended
          ? NB.el(
              'p',
              null,
              NB.el('strong', { text: `Recommended: ${recommended.label}. ` }),
              recommended.reason.charAt(0).toUpperCase() + recommended.reason.slice(1),
              '.',
            )
          : isJudged
            ? []
            : NB.el('p', { class: 'error', text: 'Recommended: none, no configuration is feasible.' }),
        NB.sections.route(goal, criteria),
        trueTarget ? NB.el('p', { text: `${trueTarget.charAt(0).toUpperCase()}${trueTarget.slice(1)}.` }) : [],
      ];
    },

    /** Clearance of the planned needle path from bone, vessels and organs; red where it is rejected. */
    route(goal, criteria) {
      const { needle_route: route, fissures_crossed: fissures } = goal;
      const parts = [];
      if (route) {
        // The criterion where it is stricter than the margin.
        const required =
          criteria.find((each) => each.goal === goal.name && each.criterion === 'min_clearance_mm.needle_route')
            ?.limit ?? 0;
        const part = `${NB.words(route.part)} (${route.tissue})`;
        const where =
          route.distance_m < 0
            ? `penetration ${NB.mm(-route.distance_m, 1)} mm into ${part}, clearance`
            : `clearance ${NB.mm(route.distance_m, 1)} mm to ${part},`;
        parts.push(
          NB.el('p', {
            class: route.kept ? '' : 'error',
            text:
              `Needle path${route.kept ? '' : ' rejected'}: ${where} ` +
              `${NB.mm(Math.max(route.margin_m, required), 1)} mm required.`,
          }),
        );
      }
      if (fissures?.length)
        parts.push(
          NB.el('p', { class: 'bad', text: `The needle crosses ${fissures.map(NB.words).join(', ')} of the lung.` }),
        );
      if (goal.needle) {
        const { summary } = goal.needle;
        parts.push(NB.el('p', { text: `${summary.charAt(0).toUpperCase()}${summary.slice(1)}.` }));
      }
      return parts;
    },

    /** All goals at a glance, where there are several. */
    goals(page, choose) {
      const { goals } = page.report;
      if (goals.length < 2) return null;
      /** @param {GoalReport} goal */
      const chosen = (goal) => goal.configurations.find((each) => each.label === goal.recommended?.label);
      /** @param {GoalReport} goal */
      const least = (goal) => {
        const found = chosen(goal);
        return found && NB.leastAround(page.page, found.clearance);
      };
      const table = NB.table(
        'All goals with their recommended configurations',
        [
          { title: 'Goal', cell: (goal) => NB.words(goal.name) },
          { title: 'Recommended', cell: (goal) => goal.recommended?.label || 'none' },
          {
            title: 'Feasible',
            cell: (goal) =>
              `${goal.configurations.filter((each) => each.status === 'ok').length} of ${goal.configurations.length}`,
          },
          {
            title: 'RMS tip error',
            numeric: true,
            cell: (goal) => NB.length(chosen(goal)?.budget?.total.at_target.analytic.rms_m),
          },
          {
            title: 'Clearance',
            unit: 'mm',
            numeric: true,
            cell: (goal) => NB.mm(least(goal)?.minimum_m),
            help: 'minimum distance of arm and tool from the surroundings',
          },
          {
            title: 'Self-clearance',
            unit: 'mm',
            numeric: true,
            cell: (goal) => NB.mm(chosen(goal)?.clearance.self?.minimum_m),
            help: 'minimum distance of arm and tool from themselves',
          },
          {
            title: 'Needle path clearance',
            unit: 'mm',
            numeric: true,
            cell: (goal) => NB.mm(goal.needle_route?.distance_m),
          },
        ],
        goals,
        { class: 'choose small' },
      );
      const rows = NB.tableRows(table);
      NB.rows(rows, (index) => choose(index));
      return { element: table, rows };
    },

    /** Achieved and attainable clearance of the planned motion and of the retreat. */
    margins(c) {
      if (!c.margin) return NB.el('p', { class: 'soft', text: `${c.label} has no planned motion.` });
      /** @param {string} name */
      const retreat = (name) => c.retreat_clearance[name]?.certified_lower_bound_m ?? null;
      /** @type {Column<[name: string, margin: Margin['classes'][string]]>[]} */
      const columns = [
        { title: 'Class', cell: ([name]) => NB.words(name) },
        {
          title: 'Required',
          unit: 'mm',
          numeric: true,
          cell: ([, each]) => NB.mm(each.limit_m),
          help: 'limit of the scenario\u2019s criterion, otherwise of its planning',
        },
        {
          title: 'Attainable',
          unit: 'mm',
          numeric: true,
          cell: ([, each]) => NB.mm(each.attainable_m),
          help: 'minimum over the start, the approach and its end, which every motion includes',
        },
        {
          title: 'Achieved',
          unit: 'mm',
          numeric: true,
          cell: ([, each]) => NB.mm(each.achieved_m),
          help: 'minimum over the whole motion from the start to the goal',
        },
        { title: 'Limiting phase', cell: ([, each]) => NB.words(each.limited_by) },
        {
          title: 'Achieved, retreat',
          unit: 'mm',
          numeric: true,
          cell: ([name]) => (retreat(name) === null ? '\u2013' : NB.mm(retreat(name))),
        },
      ];
      const ends = {
        bound: 'optimal within tolerance',
        proof: 'start, approach or final posture too close, no alternative path helps',
        budget: '`motion_checks` exhausted, a better path may exist',
      };
      return [
        NB.table(`${c.label}: ${ends[c.margin.search]}`, columns, Object.entries(c.margin.classes), { class: 'small' }),
        NB.el('p', {
          class: 'soft small',
          text:
            'Certified lower bounds of the planned motion of the nominal arm. ' +
            'Clearances in the other tables are measured on recorded motions and are slightly larger.',
        }),
      ];
    },

    /** Tip error over the arm and patient population, in total and by source. */
    budget(goal, configuration, charts, name) {
      const with_ = goal.configurations.filter((c) => c.budget || c.budget_failure);
      if (!with_.length) return null;
      const sources = [...new Set(with_.flatMap((c) => (c.budget?.sources || []).map((each) => each.source)))];
      /** @param {BudgetPart | null | undefined} part */
      const rms = (part) => NB.mm(part?.at_target.analytic.rms_m, 2);
      /** @type {Column<ConfigurationReport>[]} */
      const columns = [
        { title: 'Configuration', cell: (c) => c.label },
        { title: 'All sources, RMS', unit: 'mm', numeric: true, cell: (c) => rms(c.budget?.total) },
        {
          title: 'P95',
          unit: 'mm',
          numeric: true,
          cell: (c) => NB.mm(c.budget?.total.at_target.radius_95_m, 2),
          help: '95th percentile over the arm and patient population',
        },
        {
          title: 'At the skin, RMS',
          unit: 'mm',
          numeric: true,
          cell: (c) => NB.mm(c.budget?.total.at_skin?.analytic.rms_m, 2),
        },
        {
          title: 'Dominant source',
          cell: (c) => (c.budget ? NB.words(c.budget.dominant ?? '\u2013') : c.budget_failure),
        },
        ...sources.map((source) => ({
          title: `Only ${NB.words(source)}`,
          unit: 'mm',
          numeric: true,
          cell: (/** @type {ConfigurationReport} */ c) => rms(c.budget?.sources.find((each) => each.source === source)),
        })),
      ];
      const help =
        'Ellipses contain 95 %. x and y are lateral, z is depth; both panels are in mm and have one scale, ' +
        'the same for all configurations of the goal. Bar: share of each source in the mean square error.';
      return [
        charts?.budget
          ? NB.chart(
              `${configuration.label}: tip error distribution`,
              charts.budget,
              NB.fileName(name, goal.name, configuration.label, 'budget'),
              help,
            )
          : null,
        NB.table(
          'RMS tip error over the arm and patient population: all sources combined, and each source alone',
          columns,
          with_,
          { class: 'small' },
        ),
      ];
    },

    /** How likely the needle reaches the lesion and comes close to structures: all configurations, and this one. */
    probability(goal, configuration) {
      const with_ = /** @type {WithProbability[]} */ (goal.configurations.filter((c) => c.probability));
      if (!with_.length) return null;
      const dash = '\u2013';
      const larger = 'Assumed errors \u00d7 1.5';
      /** @type {Column<WithProbability>[]} */
      const columns = [
        { title: 'Configuration', cell: (c) => c.label },
        { title: 'Tip in the lesion', numeric: true, cell: (c) => c.probability.in_lesion?.of_1000 ?? dash },
        { title: larger, numeric: true, cell: (c) => c.probability.in_lesion?.assumed_larger?.of_1000 ?? dash },
        { title: 'Tip within 2 mm of the target', numeric: true, cell: (c) => c.probability.within_2_mm.of_1000 },
        { title: 'Close to a structure', numeric: true, cell: (c) => c.probability.any?.of_1000 ?? dash },
        { title: 'Upper bound', numeric: true, cell: (c) => c.probability.any?.at_most_of_1000 ?? dash },
        {
          title: 'Most often',
          cell: (c) => {
            const [first] = c.probability.structures;
            return first?.probability ? NB.words(first.structure) : dash;
          },
        },
      ];
      const own = configuration.probability;
      /** @type {Column<StructureProbability>[]} */
      const structures = [
        { title: 'Structure', cell: (each) => NB.words(each.structure) },
        { title: 'Tissue', cell: (each) => each.tissue },
        { title: 'Distance', unit: 'mm', numeric: true, cell: (each) => NB.mm(each.distance_m, 1) },
        { title: 'Of 1000 needles', numeric: true, cell: (each) => each.of_1000 },
        { title: larger, numeric: true, cell: (each) => each.assumed_larger?.of_1000 ?? dash },
        { title: 'Upper bound', numeric: true, cell: (each) => each.at_most_of_1000 ?? dash },
        { title: 'Mostly', cell: (each) => (each.mostly ? NB.words(each.mostly) : dash) },
      ];
      const assumed = with_[0].probability.assumed.map((each) => NB.words(each)).join(', ');
      return [
        NB.el('p', {
          class: 'soft small',
          text:
            'Of 1000 needles by this model, not of a patient: estimates with 95 % intervals, and upper bounds ' +
            'without draws. ' +
            `Close: needle surface nearer than ${NB.mm(with_[0].probability.margin_m, 0)} mm. Assumed: ${assumed}.`,
        }),
        NB.table('Of 1000 needles, by configuration', columns, with_, { class: 'small' }),
        own?.structures.length
          ? NB.table(`${configuration.label}: structures that the needle comes close to`, structures, own.structures, {
              class: 'small',
            })
          : null,
      ];
    },

    people(goal) {
      const with_ = /** @type {WithRoom[]} */ (goal.configurations.filter((c) => c.room));
      const regions = [...new Set(with_.flatMap((c) => Object.keys(c.room.regions)))];
      /** @param {Sight} each */
      const who = (each) => `${NB.words(each.person)}, ${each.stature_m.toFixed(2)} m`;
      const sight = [...new Set(with_.flatMap((c) => c.room.sight.map(who)))];
      /** @type {Column<WithRoom>[]} */
      const columns = [
        { title: 'Configuration', cell: (c) => c.label },
        { title: 'Free space', unit: '%', numeric: true, cell: (c) => NB.percent(c.room.free_fraction) },
        ...regions.map((name) => ({
          title: `Free ${NB.regionWords[name] || NB.words(name)}`,
          unit: '%',
          numeric: true,
          cell: (/** @type {WithRoom} */ c) => NB.percent(c.room.regions[name]),
        })),
        ...sight.map((name) => ({
          title: `Line of sight, ${name}`,
          unit: '%',
          numeric: true,
          cell: (/** @type {WithRoom} */ c) => NB.percent(c.room.sight.find((each) => who(each) === name)?.fraction),
        })),
        {
          title: 'Hand cone',
          unit: '\u00b0',
          numeric: true,
          cell: (c) => NB.deg(c.room.hand_cone_half_angle_rad),
          help: 'half-angle of the largest free cone behind the guide',
        },
        {
          title: 'Hand cone limited by',
          cell: (c) => (c.room.hand_cone_blocker ? NB.words(c.room.hand_cone_blocker) : ''),
        },
        { title: 'Elbow', cell: (c) => (c.room.elbow_up ? 'up' : 'down') },
        { title: 'Elbow above the entry', unit: 'mm', numeric: true, cell: (c) => NB.mm(c.room.elbow_over_entry_m, 0) },
      ];
      return [
        NB.el('p', {
          class: 'soft no-print',
          text:
            'Switch on "people and line of sight", "free space" and "hand cone" to see them. Blue lines of sight are ' +
            'free; orange ones end where they are blocked. Orange cubes are occupied by the arm.',
        }),
        with_.length
          ? NB.table(
              'Final posture: free share of the hemisphere about the entry point, and unobstructed share of the ' +
                'lines of sight to entry and needle',
              columns,
              with_,
              { class: 'small' },
            )
          : NB.el('p', { class: 'soft', text: 'No configuration has a posture.' }),
      ];
    },

    /** Evaluated criteria: failed ones first and in full, then a summary by criterion, and all of them folded. */
    criteria({ report, counts, missedAsExpected }) {
      const { criteria, not_judged: open } = report;
      const isExpected = new Set(missedAsExpected.map((index) => criteria[index]));
      const missed = criteria.filter((each) => !each.pass);
      /** @param {CriterionResult} c */
      const limits = (c) => NB.valueAndLimit(c.value, c.limit, c.unit);
      /** @type {Column<CriterionResult | NotJudged>[]} */
      const what = [
        { title: 'Criterion', cell: (c) => NB.criterionWords(c.criterion) },
        { title: 'Goal', cell: (c) => NB.words(c.goal) },
        { title: 'Configuration', cell: (c) => c.label || 'all' },
        { title: 'Engine', cell: (c) => c.engine || '' },
      ];
      /** @type {Column<CriterionResult>[]} */
      const columns = [
        ...what,
        { title: 'Value', numeric: true, cell: (c) => limits(c)[0] },
        { title: 'Limit', numeric: true, cell: (c) => limits(c)[1] },
        {
          title: 'Outcome',
          cell: (c) =>
            NB.el('span', {
              class: c.pass ? 'good' : 'bad',
              text: c.pass ? '\u2713 met' : isExpected.has(c) ? '\u2717 failed, as expected' : '\u2717 failed',
            }),
        },
        { title: 'Remark', text: true, cell: (c) => c.detail },
      ];
      /** @type {Column<NotJudged>[]} */
      const unjudged = [...what, { title: 'Reason', text: true, cell: (c) => c.reason }];
      return NB.section(
        `Evaluation: ${counts}`,
        open.length > 0 || missed.length > 0,
        missed.length ? NB.table('Failed criteria', columns, missed, { class: 'small' }) : null,
        open.length ? NB.table('Not evaluated', unjudged, open, { class: 'small' }) : null,
        NB.sections.summary(criteria),
        NB.el(
          'details',
          { class: 'no-print' },
          NB.el('summary', { text: `All ${criteria.length} results` }),
          NB.table(
            'All evaluated criteria, failed ones first',
            columns,
            [...missed, ...criteria.filter((each) => each.pass)],
            { class: 'small' },
          ),
        ),
      );
    },

    /** A row per criterion: how often it was met, and the value closest to its limit. */
    summary(criteria) {
      /** @type {Map<string, CriterionResult[]>} */
      const groups = new Map();
      for (const each of criteria) groups.set(each.criterion, [...(groups.get(each.criterion) || []), each]);
      // Of those that are missed the one that is farthest off, else the one that is nearest to its limit.
      /** @param {CriterionResult} result */
      const used = ({ value, limit, pass }) =>
        value === null || limit === null
          ? -Infinity
          : ((pass ? -1 : 1) * Math.abs(value - limit)) / (Math.abs(limit) || 1);
      const rows = [...groups].map(([name, all]) => ({
        name,
        all,
        met: all.filter((each) => each.pass).length,
        nearest: all.reduce((best, each) => (used(each) > used(best) ? each : best)),
      }));
      rows.sort((a, b) => (a.met < a.all.length ? 0 : 1) - (b.met < b.all.length ? 0 : 1));
      /** @param {CriterionResult} c */
      const limits = (c) => (c.value === null ? ['', ''] : NB.valueAndLimit(c.value, c.limit, c.unit));
      return NB.table(
        'By criterion, with the value closest to its limit',
        [
          { title: 'Criterion', cell: (row) => NB.criterionWords(row.name) },
          {
            title: 'Met',
            numeric: true,
            cell: (row) =>
              NB.el('span', {
                class: row.met === row.all.length ? 'good' : 'bad',
                text: `${row.met} of ${row.all.length}`,
              }),
          },
          { title: 'Closest value', numeric: true, cell: (row) => limits(row.nearest)[0] },
          { title: 'Limit', numeric: true, cell: (row) => limits(row.nearest)[1] },
          {
            title: 'Where',
            cell: (row) =>
              [NB.words(row.nearest.goal), row.nearest.label, row.nearest.engine].filter(Boolean).join(', '),
          },
          {
            title: 'Remark',
            text: true,
            cell: (row) => (row.nearest.detail && row.name !== 'expected' ? row.nearest.detail : ''),
          },
        ],
        rows,
        { class: 'small' },
      );
    },

    requirements(report) {
      const rows = report.trace || [];
      if (!rows.length) return null;
      /** @type {{ [outcome: string]: string }} */
      const words = { met: '\u2713 met', missed: '\u2717 failed', not_judged: 'not evaluated' };
      /** @type {Column<RequirementTrace>[]} */
      const columns = [
        { title: 'Requirement', cell: (r) => r.requirement },
        { title: 'Criterion', cell: (r) => NB.criterionWords(r.criterion) },
        {
          title: 'Outcome',
          cell: (r) => NB.el('span', { class: r.outcome === 'met' ? 'good' : 'bad', text: words[r.outcome] }),
        },
        { title: 'Met', numeric: true, cell: (r) => String(r.met) },
        { title: 'Failed', numeric: true, cell: (r) => String(r.missed) },
        { title: 'Not evaluated', numeric: true, cell: (r) => String(r.not_judged) },
      ];
      return NB.section(
        `Requirements (${rows.length})`,
        true,
        NB.table('Requirements, their criteria, and how often each was met', columns, rows, {
          class: 'small',
        }),
      );
    },

    provenance(report) {
      const { provenance, notes, scenario, truth } = report;
      return NB.el(
        'div',
        null,
        notes.length
          ? NB.section(
              'Notes',
              true,
              NB.el(
                'ul',
                { class: 'plain' },
                notes.map((note) => NB.el('li', { text: note })),
              ),
            )
          : null,
        truth
          ? NB.el(
              'details',
              { class: 'section no-print' },
              NB.el('summary', null, NB.el('h2', { text: 'Sampled arm and patient (ground truth)' })),
              NB.el('p', {
                class: 'soft',
                text:
                  'One draw of the scenario\u2019s imperfections with its seed; lengths in m, angles in rad. The ' +
                  'RMS tip error is over the whole population, not for this draw.',
              }),
              NB.tree(truth),
            )
          : null,
        NB.section('Provenance', false, NB.provenance(provenance, scenario.file)),
      );
    },
  })
);

/** Contacts, stop and retreat of a goal's configurations; null where the scenario has none. */
NB.sections.events = (page, goal, configuration, charts) => {
  const with_ = /** @type {WithEvents[]} */ (goal.configurations.filter((c) => c.events));
  if (!with_.length) return null;
  return [
    ...NB.sections.press(with_, configuration, charts, goal, page.report.scenario.name),
    ...NB.sections.stop(page, with_),
    ...NB.sections.retract(page, with_),
  ];
};

NB.sections.press = (with_, configuration, charts, goal, name) => {
  const rows = with_.flatMap((c) =>
    c.events.press.flatMap((press, index) => {
      /** @type {[engine: string, measured: PressMeasured | null][]} */
      const staged = press.not_staged ? [['', null]] : Object.entries(press.engines);
      return staged.map(([engine, measured]) => ({ c, press, index, engine, measured }));
    }),
  );
  if (!rows.length) return [];
  /** @param {PressMeasured} measured @param {(episode: PressMeasured['episodes'][number]) => number} value */
  const over = (measured, value) => measured.episodes.map(value);
  /** @param {number | null | undefined} value @param {(value: number) => string} text */
  const or = (value, text) => (value === null || value === undefined ? '\u2013' : text(value));
  /** @param {number} digits @returns {(value: number) => string} */
  const fixed = (digits) => (value) => NB.fixed(value, digits);
  /** @type {Column<PressRow>[]} */
  const columns = [
    { title: 'Configuration', cell: ({ c }) => c.label },
    {
      title: 'Contact',
      text: true,
      cell: ({ press, index }) => `${index + 1}: ${press.solids.map(NB.words).join(' against ')}`,
    },
    { title: 'Engine', cell: ({ engine, press }) => engine || `not staged: ${press.not_staged}` },
    { title: 'Friction', numeric: true, cell: ({ press }) => NB.significant(press.friction) },
    { title: 'Start', unit: 's', numeric: true, cell: ({ measured }) => or(measured?.episodes[0]?.start_s, fixed(3)) },
    {
      title: 'Approach speed',
      unit: 'mm/s',
      numeric: true,
      cell: ({ measured }) => or(measured?.episodes[0]?.approach_speed_m_s, (speed) => NB.fixed(speed * 1e3, 1)),
    },
    {
      title: 'Peak force',
      unit: 'N',
      numeric: true,
      cell: ({ measured }) =>
        measured ? NB.fixed(Math.max(0, ...over(measured, (each) => each.peak_force_n)), 1) : '\u2013',
      help: 'against a rigid surface; depends on the contact stiffness of the engine',
    },
    {
      title: 'Settled force',
      unit: 'N',
      numeric: true,
      cell: ({ measured }) => or(measured?.settled_force_n, fixed(2)),
      help: 'force of the joint servo after settling',
    },
    {
      title: 'Impulse',
      unit: 'N s',
      numeric: true,
      cell: ({ measured }) =>
        measured
          ? NB.fixed(
              over(measured, (each) => each.impulse_ns).reduce((a, b) => a + b, 0),
              2,
            )
          : '\u2013',
    },
    {
      title: 'Deviation from static equilibrium',
      numeric: true,
      cell: ({ measured }) => or(measured?.balance_difference, NB.share),
    },
    {
      title: 'Largest penetration',
      numeric: true,
      cell: ({ measured }) =>
        measured ? NB.length(Math.max(0, ...over(measured, (each) => each.deepest_penetration_m))) : '\u2013',
    },
    { title: 'Recovery time', unit: 's', numeric: true, cell: ({ measured }) => or(measured?.recovery_s, fixed(3)) },
    {
      title: 'Force difference between engines',
      numeric: true,
      cell: ({ press }) => or(press.force_difference, NB.share),
    },
    {
      title: 'Tip difference between engines',
      numeric: true,
      cell: ({ press }) => NB.length(press.tip_difference_settled_m),
    },
  ];
  const own = with_.find((c) => c === configuration);
  /** @param {string} caption @param {PressRow[]} of */
  const table = (caption, of) => NB.table(caption, columns, of, { class: 'small contacts' });
  const shown = (own?.events.press || []).map((press, index) => {
    const svg = charts?.press?.[index];
    const title =
      `${configuration.label}, contact ${index + 1}: ` +
      `${press.solids.map(NB.words).join(' against ')}${press.friction ? `, friction ${press.friction}` : ''}`;
    return svg ? NB.chart(title, svg, NB.fileName(name, goal.name, configuration.label, `contact-${index + 1}`)) : null;
  });
  const means = rows[0].press.force_means;
  return [
    NB.el('h3', { text: 'Prescribed contacts' }),
    NB.el('p', { class: 'bad', text: `These are not the forces on a patient: ${means}.` }),
    NB.el('p', {
      class: 'soft',
      text: 'After planning, the obstacle is moved into the path of the arm.',
    }),
    own
      ? table(
          `${configuration.label}: contacts by engine`,
          rows.filter(({ c }) => c === own),
        )
      : NB.el('p', { text: `${configuration.label} is infeasible: no contact was simulated.` }),
    NB.el(
      'details',
      { class: 'no-print' },
      NB.el('summary', { text: 'Contacts of all configurations' }),
      table('All configurations', rows),
    ),
    own
      ? NB.el(
          'details',
          { open: true },
          NB.el('summary', { text: `Force and clearance over time, ${configuration.label}` }),
          NB.el('div', { class: 'two' }, shown),
        )
      : null,
  ];
};

/** Columns on the clearance of a stop or a retreat. */
NB.clearanceColumns = (page) => [
  {
    title: 'Clearance',
    unit: 'mm',
    numeric: true,
    cell: ({ measured }) => NB.mm(NB.leastAround(page, measured.clearance)?.minimum_m),
    help: 'minimum distance of arm and tool from the surroundings',
  },
  {
    title: 'Certified clearance',
    unit: 'mm',
    numeric: true,
    cell: ({ measured }) => NB.mm(NB.certifiedAround(page, measured.clearance)),
    help: 'certified lower bound of the clearance',
  },
  {
    title: 'Self-clearance',
    unit: 'mm',
    numeric: true,
    cell: ({ measured }) => NB.mm(measured.clearance.self?.minimum_m),
    help: 'minimum distance of arm and tool from themselves',
  },
];

NB.sections.stop = (page, with_) => {
  const rows = with_.flatMap((c) => {
    const { stop } = c.events;
    return stop ? Object.entries(stop.engines).map(([engine, measured]) => ({ c, stop, engine, measured })) : [];
  });
  if (!rows.length) return [];
  /** @type {Column<StopRow>[]} */
  const columns = [
    { title: 'Configuration', cell: ({ c }) => c.label },
    { title: 'Engine', cell: ({ engine }) => engine },
    { title: 'Trigger phase', cell: ({ stop }) => NB.words(stop.phase) },
    { title: 'Trigger time', unit: 's', numeric: true, cell: ({ stop }) => NB.fixed(stop.at_s, 2) },
    { title: 'Stopping time', unit: 's', numeric: true, cell: ({ measured }) => NB.fixed(measured.stopping_time_s, 3) },
    { title: 'Tip travel', unit: 'mm', numeric: true, cell: ({ measured }) => NB.mm(measured.tip_distance_m, 2) },
    {
      title: 'Flange travel',
      unit: 'mm',
      numeric: true,
      cell: ({ measured }) => NB.mm(measured.flange_distance_m, 2),
    },
    { title: 'Path deviation', unit: 'mm', numeric: true, cell: ({ measured }) => NB.mm(measured.off_path_m, 2) },
    ...NB.clearanceColumns(page),
    {
      title: 'Worst-case tip travel',
      unit: 'mm',
      numeric: true,
      cell: ({ stop }) => NB.mm(stop.envelope.worst_tip_distance_m, 2),
      help: 'predicted for stops every 40 ms of the motion to the goal',
    },
    {
      title: 'Worst-case stopping time',
      unit: 's',
      numeric: true,
      cell: ({ stop }) => NB.fixed(stop.envelope.worst_stopping_time_s, 3),
    },
  ];
  const { category, brakes } = rows[0].stop;
  const does = [
    'drives off and brakes on at once',
    'decelerated along the path, then drives off',
    'decelerated along the path, drives stay on',
  ][category];
  return [
    NB.el('h3', { text: 'Emergency stop' }),
    NB.el('p', {
      class: 'soft',
      text:
        `Category ${category} of IEC 60204-1: ${does}. It is triggered at the time with the largest predicted ` +
        'tip travel.',
    }),
    NB.table('Stopping distance', columns, rows, { class: 'small' }),
    brakes
      ? NB.el('p', { class: 'soft small', text: `Brake model derived from published stops: ${brakes.fit}.` })
      : null,
  ];
};

NB.sections.retract = (page, with_) => {
  const rows = with_.flatMap((c) =>
    Object.entries(c.events.retract).map(([engine, measured]) => ({ c, engine, measured })),
  );
  if (!rows.length) return [];
  /** @type {Column<RetractRow>[]} */
  const columns = [
    { title: 'Configuration', cell: ({ c }) => c.label },
    { title: 'Engine', cell: ({ engine }) => engine },
    {
      title: 'Inserted needle length',
      unit: 'mm',
      numeric: true,
      cell: ({ measured }) => NB.mm(measured.inserted_length_m),
    },
    {
      title: 'Straight retreat',
      unit: 'mm',
      numeric: true,
      cell: ({ measured }) => NB.mm(measured.straight_length_m),
    },
    {
      title: 'Needle cleared before rotation',
      cell: ({ measured }) =>
        NB.el('span', {
          class: measured.needle_clears ? 'good' : 'bad',
          text: measured.needle_clears ? '\u2713 yes' : '\u2717 no, withdraw it by hand first',
        }),
    },
    {
      title: 'Lateral guide deviation',
      numeric: true,
      cell: ({ measured }) => NB.length(measured.largest_lateral_deviation_m),
    },
    {
      title: 'Angular guide deviation',
      unit: '\u00b5rad',
      numeric: true,
      cell: ({ measured }) => NB.fixed(measured.largest_angle_rad * 1e6, 3),
    },
    { title: 'Contacts', numeric: true, cell: ({ measured }) => String(measured.contacts.length) },
    ...NB.clearanceColumns(page),
  ];
  return [
    NB.el('h3', { text: 'Retreat' }),
    NB.table(
      'Straight retreat along the needle, then return to the start, with the needle still in the guide',
      columns,
      rows,
      { class: 'small' },
    ),
  ];
};

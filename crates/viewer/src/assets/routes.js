// Needle paths, side by side.
'use strict';

/** Needle paths as columns, what is known of them as rows. */
PLAN.routeRows = (columns, caption) => {
  /** @type {{ title: string, unit: string, cells: Child[] }[]} */
  const rows = [];
  /** @param {string} title @param {string} unit @param {(route: RouteAnswer) => Child} cell */
  const row = (title, unit, cell) =>
    rows.push({ title, unit, cells: columns.map((column) => (column.route ? cell(column.route) : '\u2013')) });
  if (columns.some(({ route }) => route?.judged)) {
    row('Path rules', '', (route) => {
      const { judged } = route;
      if (!judged) return 'not evaluated: find needle paths';
      const unseen = judged.unknown.length
        ? `; not labelled, not evaluated: ${judged.unknown.map(NB.words).join(', ')}`
        : '';
      if (judged.free)
        return NB.el('span', {
          class: unseen ? 'bad' : 'good',
          text: `admissible, odds ratio ${NB.fixed(judged.odds_ratio, 2)}${unseen}`,
        });
      /** @param {number | null} number */
      const value = (number) =>
        judged.unit === 'm'
          ? `${NB.mm(number)} mm`
          : judged.unit === 'rad'
            ? `${NB.deg(number)}\u00b0`
            : NB.fixed(number, 0);
      return NB.el('span', {
        class: 'bad',
        text:
          (judged.bent ??
            `${judged.broken}: ${value(judged.value)}, ${value(judged.limit)} ` +
              `${judged.is_least ? 'required' : 'allowed'}`) + unseen,
      });
    });
  }
  row('Skin to target', 'mm', (route) => NB.mm(route.length_m));
  row('Guide exit to tip', 'mm', (route) =>
    route.insertion_m === null ? '\u2013' : `${NB.mm(route.insertion_m)} (needle length ${NB.mm(route.needle_m)})`,
  );
  if (columns.some(({ route }) => route?.bend))
    row('Bend of the median needle', 'mm', ({ bend }) => {
      if (!bend) return '\u2013';
      const off = bend.tip_m;
      const side = bend.towards
        ? `towards ${PLAN.towards(bend.towards.map((value) => value * Math.sign(off)))}`
        : 'to a side that is not known';
      const aimed = bend.is_aimed ? ', the guide aimed against it' : '';
      return `${NB.mm(Math.abs(off))} ${side}${aimed}${bend.is_force_measured ? '' : ' (forces assumed)'}`;
    });
  row('Angle to skin normal', '\u00b0', (route) => NB.deg(route.skin_angle_rad));
  row('Angle to axial plane', '\u00b0', (route) => NB.deg(route.axial_angle_rad));
  row('Length in lung', 'mm', (route) =>
    route.in_lung_m === null
      ? 'no lung in the label map'
      : `${NB.mm(route.in_lung_m)} \u00b1 ${NB.mm(route.crossing_within_m)}`,
  );
  row('Lung entries', '', (route) => (route.lung_entries === null ? '\u2013' : String(route.lung_entries)));
  for (const tissue of ['bone', 'vessel', 'organ']) {
    if (!columns.some(({ route }) => route?.tissues.some((each) => each.tissue === tissue))) continue;
    row(`Distance to ${tissue}`, 'mm', (route) => {
      const known = route.tissues.find((each) => each.tissue === tissue);
      if (!known) return '\u2013';
      const off = known.surface_p99_m === null ? '' : ` \u00b1 ${NB.mm(known.surface_p99_m, 2)}`;
      return NB.el('span', {
        class: known.kept ? 'good' : 'bad',
        text:
          `${NB.mm(known.distance_m)}${off} to ${known.words}${known.is_bent ? ' as tissue bends it' : ''}, ` +
          `${known.kept ? '' : 'rejected: '}${NB.mm(known.margin_m)} required`,
      });
    });
  }
  if (columns.some(({ route }) => route?.fissures.length))
    row('Fissures crossed', '', (route) => route.fissures.map(NB.words).join(', ') || 'none');
  row('Structures passed', 'mm from skin', (route) =>
    route.crossings
      .map((each) => `${NB.words(each.name)} ${NB.mm(each.from_m, 0)}\u2013${NB.mm(each.to_m, 0)}`)
      .join(', '),
  );
  if (columns.some(({ reach }) => reach?.preview))
    rows.push({
      title: 'Feasible configurations',
      unit: 'of 8',
      cells: columns.map(({ route, reach }) => {
        if (!reach?.preview) return '\u2013';
        const { working } = reach.preview;
        return route?.refusal
          ? NB.el('span', { class: 'bad', text: `none (${working} reachable, path rejected)` })
          : String(working);
      }),
    });
  /** @type {Column<(typeof rows)[number]>[]} */
  const heads = [
    {
      title: 'Quantity',
      cell: ({ title, unit }) => [title, NB.el('span', { class: 'unit', text: unit ? ` (${unit})` : '' })],
    },
    ...columns.map(({ name }, index) => ({
      title: name,
      cell: (/** @type {{ cells: Child[] }} */ { cells }) => cells[index],
    })),
  ];
  return NB.table(caption, heads, rows, { class: 'small route' });
};

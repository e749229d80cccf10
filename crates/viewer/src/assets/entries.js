// The entry map: the skin as seen from the target, what rejects a needle path, how admissible ones compare, and in
// which configurations the best of them are feasible.
'use strict';

class EntryMap {
  /**
   * `planner` has the needle and is told of entries that are picked.
   * @param {Planner} planner
   */
  constructor(planner) {
    this.planner = planner;
    /** @type {RoutePlan | null} */
    this.plan = null;
    /** @type {{ message: string }[]} */
    this.notes = [];
    /** @type {string | undefined} */
    this.of = undefined;
    /** @type {number[] | null} */
    this.at = null;
    /** @type {number[][]} */
    this.directions = [];
    /** @type {{ index: Index, color: string }[] | null} */
    this.free = null;
    /** @type {HTMLCanvasElement | null} */
    this.image = null;
    this.drawn = '';
    this.leastOdds = 1;
    /** @type {HTMLCanvasElement} */
    this.canvas = NB.el('canvas', {
      class: 'entry-map',
      tabindex: '0',
      role: 'application',
      hidden: true,
      'aria-label':
        'Entry map: directions from the target to the skin. Arrow keys move a cursor, Enter selects the entry there.',
      onclick: (event) => this.clicked(event),
      onkeydown: (event) => this.key(event),
      onpointermove: (event) => this.say(this.near(this.pointed(event))),
    });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.button = NB.el('button', { type: 'button', onclick: () => this.find() }, 'Find needle paths');
    this.status = NB.el('p', {
      class: 'soft',
      role: 'status',
      text: 'Evaluates 20\u202f000 directions by the path rules and checks the best ones for the robot.',
    });
    this.said = NB.el('p', { class: 'entry-said', 'aria-live': 'polite' });
    this.legend = NB.el('p', { class: 'entry-legend' });
    this.table = NB.el('div');
    this.remarks = NB.el('div');
    this.latest = new Latest('entries', (answer, body) => this.answered(answer, body));
    // On paper the needle's own row has the result of the path rules.
    this.element = NB.el(
      'section',
      { class: 'panel no-print' },
      NB.el('h2', { text: 'Entry map' }),
      NB.el('div', { class: 'tabs' }, this.button),
      this.status,
      this.canvas,
      this.said,
      this.legend,
      this.table,
      this.remarks,
    );
  }

  /**
   * What the map is of.
   * @param {NeedleChoice} needle
   */
  static key({ goal, target }) {
    return JSON.stringify([goal, target]);
  }

  /** Another needle: a map of another target is no map of this one. */
  needleChanged() {
    const { needle } = this.planner.state;
    this.button.disabled = !needle.target;
    if (this.of !== undefined && this.of !== EntryMap.key(needle)) {
      this.latest.forget();
      this.of = undefined;
      this.plan = null;
      this.show('The target has changed.');
    }
    this.draw();
  }

  find() {
    const { goal, target } = this.planner.state.needle;
    if (!target) return;
    this.of = EntryMap.key({ goal, target });
    this.plan = null;
    this.show('Evaluating directions ...');
    this.latest.ask({ aim: { goal, target }, robot: false });
  }

  /** @param {Answered<EntriesAnswer>} answer @param {Questions['entries'][0]} body */
  answered(answer, body) {
    if (this.of !== EntryMap.key(body.aim)) return;
    if (answer.problem) this.planner.complain(answer.problem);
    if (answer.refused) {
      this.plan = null;
      this.of = undefined;
      this.show(`${answer.refused.message}${answer.refused.hint ? ` (${answer.refused.hint})` : ''}`, 'error');
      return;
    }
    const { plan } = answer;
    this.plan = plan;
    this.notes = answer.remarks;
    const unknown = this.planner.facts.robot_is_unknown;
    const free =
      `${plan.free.toLocaleString('en')} of ${plan.tried.toLocaleString('en')} directions are admissible by the ` +
      'scan\u2019s voxels';
    if (!body.robot && !unknown && plan.routes.length) {
      this.show(`${free}; checking the best ${plan.routes.length} for the robot ...`);
      this.latest.ask({ aim: body.aim, robot: true });
    } else if (!plan.routes.length) this.show(`${free}.`);
    else if (unknown) this.show(`${free}. Robot not evaluated: ${unknown}.`);
    else if (plan.chosen)
      this.show(
        `${free}. Path ${plan.chosen.route + 1} is the best one that is feasible in at least ${plan.wanted} of 8 ` +
          'configurations.',
      );
    else this.show(`${free}; none of the best is feasible in at least ${plan.wanted} of 8 configurations.`);
    // The needle that is shown can be evaluated by the path rules now.
    this.planner.askRoute();
  }

  /**
   * Everything anew.
   * @param {string} status
   * @param {string} [kind]
   */
  show(status, kind = 'soft') {
    this.status.textContent = status;
    this.status.className = kind;
    this.canvas.hidden = !this.plan;
    this.at = null;
    this.said.textContent = '';
    this.leastOdds = this.plan ? Math.min(...this.plan.map.odds_ratio.filter((odds) => odds !== null)) : 1;
    const { azimuth_deg: azimuths = [], elevation_deg: elevations = [] } = this.plan?.map || {};
    this.directions = azimuths.map((azimuth, index) => [azimuth, elevations[index]]);
    this.showLegend();
    this.showTable();
    NB.clear(
      this.remarks,
      ((this.plan && this.notes) || []).map((remark) =>
        NB.el('p', { class: 'soft', text: `Note: ${remark.message}.` }),
      ),
    );
    this.image = null;
    this.draw();
  }

  showLegend() {
    if (!this.plan) {
      NB.clear(this.legend);
      return;
    }
    const { rules, free } = this.planner.facts.route_colours;
    NB.clear(this.legend, [
      PLAN.swatch(PLAN.rgb(free[0]), 'admissible, lowest odds ratio'),
      PLAN.swatch(PLAN.rgb(free[1]), 'twice the lowest odds ratio or more'),
      ...this.plan.refused.map(({ rule, count }) =>
        PLAN.swatch(
          PLAN.rgb(rules[rule]?.[1] || [0, 0, 0]),
          `${rules[rule]?.[0] || rule} ${count.toLocaleString('en')}`,
        ),
      ),
    ]);
  }

  // ---- the picture: azimuth to the right, the sine of the elevation up, so that equal areas are equal solid angles

  /** @param {number[]} direction */
  place([azimuth, elevation]) {
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    return [(w * (azimuth + 180)) / 360, (h * (1 - Math.sin((elevation * Math.PI) / 180))) / 2];
  }

  /** @param {MouseEvent} event */
  pointed(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /**
   * The admissible direction closest to a place of the picture, or else any.
   * @param {number[]} place
   */
  near([x, y]) {
    if (!this.plan) return null;
    const { rule } = this.plan.map;
    let best = { index: -1, worth: Infinity };
    for (let index = 0; index < this.directions.length; index++) {
      const [u, v] = this.place(this.directions[index]);
      const off = Math.hypot(u - x, v - y);
      // An admissible one a few pixels away is meant.
      const worth = rule[index] === null ? off - 3 : off;
      if (worth < best.worth) best = { index, worth };
    }
    return best.index < 0 ? null : best.index;
  }

  /** @param {number | null} index */
  say(index) {
    if (index === null || !this.plan) return;
    const { map } = this.plan;
    const { rules } = this.planner.facts.route_colours;
    const [azimuth, elevation] = this.directions[index];
    const where =
      `${NB.fixed(Math.abs(azimuth), 0)}\u00b0 ${azimuth < 0 ? 'right' : 'left'} of anterior, ` +
      `${NB.fixed(Math.abs(elevation), 0)}\u00b0 ${elevation < 0 ? 'caudal' : 'cranial'}`;
    const depth = map.depth_m[index] === null ? '' : `, depth ${NB.mm(map.depth_m[index], 0)} mm`;
    const broken = map.rule[index];
    const rule = broken === null ? null : map.rules[broken];
    const how =
      rule === null
        ? `admissible, odds ratio ${NB.fixed(map.odds_ratio[index], 2)}`
        : `${rules[rule]?.[0] || rule}${this.found(rule, map.value[index], map.limit[index])}`;
    this.said.textContent = `${where}${depth}: ${how}`;
  }

  /** @param {string} rule @param {number | null} value @param {number | null} limit */
  found(rule, value, limit) {
    if (value === null || !['bone', 'vessel', 'organ', 'throw', 'bent', 'needle_too_short'].includes(rule)) return '';
    return rule === 'needle_too_short'
      ? `, ${NB.mm(value)} mm, needle reach ${NB.mm(limit)} mm`
      : `, ${NB.mm(value)} mm, ${NB.mm(limit)} mm required`;
  }

  /** @param {MouseEvent} event */
  clicked(event) {
    this.take(this.near(this.pointed(event)));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (!this.plan) return;
    /** @type {{ [key: string]: number[] | undefined }} */
    const moves = { ArrowLeft: [-2, 0], ArrowRight: [2, 0], ArrowUp: [0, 2], ArrowDown: [0, -2] };
    const steps = moves[event.key];
    if (steps) {
      event.preventDefault();
      const [azimuth, elevation] = this.at || [0, 0];
      this.at = [((azimuth + steps[0] + 540) % 360) - 180, Math.min(Math.max(elevation + steps[1], -88), 88)];
      this.say(this.near(this.place(this.at)));
      this.draw();
    } else if ((event.key === 'Enter' || event.key === ' ') && this.at) {
      event.preventDefault();
      this.take(this.near(this.place(this.at)));
    }
  }

  /**
   * Selects the entry in a direction of the map.
   * @param {number | null} index
   */
  take(index) {
    if (index === null || !this.plan) return;
    this.say(index);
    const depth = this.plan.map.depth_m[index];
    if (depth === null) return;
    this.enter(this.directions[index], depth);
  }

  /**
   * The place so deep from the target in a direction, m of the scan.
   * @param {RoutePlan} plan
   * @param {number[]} direction
   * @param {number} depth
   */
  onSkin(plan, [azimuth, elevation], depth) {
    const [a, e] = [azimuth, elevation].map((degrees) => (degrees * Math.PI) / 180);
    const outwards = [Math.cos(e) * Math.sin(a), -Math.cos(e) * Math.cos(a), Math.sin(e)];
    const { target_in_phantom_m: target, phantom_origin_in_ct_m: origin } = plan;
    return target.map((value, axis) => value + origin[axis] + depth * outwards[axis]);
  }

  /**
   * Colour of an admissible direction: by its odds ratio relative to the lowest one, up to twice.
   * @param {RoutePlan} plan
   * @param {number} index
   */
  shade(plan, index) {
    const { free } = this.planner.facts.route_colours;
    const share = Math.min(Math.max(Math.log2((plan.map.odds_ratio[index] ?? 0) / this.leastOdds), 0), 1);
    return PLAN.rgb(free[0].map((value, channel) => Math.round(value + (free[1][channel] - value) * share)));
  }

  /** @param {number[]} direction @param {number} depth @param {string | null} [configuration] */
  enter(direction, depth, configuration) {
    if (!this.plan) return;
    const place_m = this.onSkin(this.plan, direction, depth);
    this.planner.change({ entry: { place_m }, ...(configuration ? { configuration } : {}) });
    this.planner.look(this.planner.within(this.planner.indexOf(place_m).map(Math.round)));
  }

  /** @param {RoutePlan} plan */
  render(plan) {
    const { map } = plan;
    const { rules } = this.planner.facts.route_colours;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const image = document.createElement('canvas');
    [image.width, image.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    const context = NB.context(image);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = '#f7f7f7';
    context.fillRect(0, 0, w, h);
    // An even grid: each has the same area, and a little more so that no paper shows.
    const across = 1.25 * Math.sqrt((w * h) / this.directions.length);
    /** @param {number} index */
    const color = (index) =>
      map.rule[index] === null
        ? this.shade(plan, index)
        : PLAN.rgb(rules[map.rules[map.rule[index]]]?.[1] || [0, 0, 0]);
    // Admissible ones last: none of them is to be hidden.
    for (const freeOnes of [false, true]) {
      this.directions.forEach((direction, index) => {
        if ((map.rule[index] === null) !== freeOnes) return;
        const [x, y] = this.place(direction);
        context.fillStyle = color(index);
        context.fillRect(x - across / 2, y - across / 2, across, across);
      });
    }
    return image;
  }

  draw() {
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!this.plan || !w || !h) return;
    const size = `${w} ${h}`;
    if (!this.image || this.drawn !== size) {
      this.image = this.render(this.plan);
      this.drawn = size;
    }
    [this.canvas.width, this.canvas.height] = [this.image.width, this.image.height];
    const context = NB.context(this.canvas);
    context.drawImage(this.image, 0, 0);
    const ratio = this.image.width / w;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = '12px system-ui, sans-serif';
    /** @param {string} words @param {number} x @param {number} y @param {CanvasTextAlign} [align] */
    const write = (words, x, y, align = 'center') => {
      context.textAlign = align;
      context.textBaseline = 'middle';
      context.lineWidth = 3;
      context.strokeStyle = 'rgba(255, 255, 255, 0.9)';
      context.strokeText(words, x, y);
      context.fillStyle = '#000';
      context.fillText(words, x, y);
    };
    write('R', this.place([-90, 0])[0], h - 9);
    write('A', this.place([0, 0])[0], h - 9);
    write('L', this.place([90, 0])[0], h - 9);
    write('P', 7, h - 9);
    write('P', w - 7, h - 9);
    write('S', 7, 10);
    write('I', 7, h - 24);
    for (const [index, route] of [...this.plan.routes.slice(0, 8).entries()].reverse())
      this.ring(context, this.place(route.direction_deg), String(index + 1), write);
    const { chosen } = this.plan;
    if (chosen && chosen.route >= 8)
      this.ring(context, this.place(this.plan.routes[chosen.route].direction_deg), String(chosen.route + 1), write);
    const { route } = this.planner;
    if (route) {
      const way = route.entry_m.map((value, axis) => value - route.target_m[axis]);
      const at = this.place([
        (Math.atan2(way[0], -way[1]) * 180) / Math.PI,
        (Math.atan2(way[2], Math.hypot(way[0], way[1])) * 180) / Math.PI,
      ]);
      this.cross(context, at, '#000', PLAN.COLORS.needle);
    }
    if (this.at) this.cross(context, this.place(this.at), '#fff', '#000');
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number[]} place
   * @param {string} words
   * @param {(words: string, x: number, y: number) => void} write
   */
  ring(context, [x, y], words, write) {
    context.strokeStyle = '#000';
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x, y, 4, 0, 2 * Math.PI);
    context.stroke();
    write(words, x + 10, y - 6);
  }

  /** @param {CanvasRenderingContext2D} context @param {number[]} place @param {string} outer @param {string} inner */
  cross(context, [x, y], outer, inner) {
    for (const { style, width } of [
      { style: outer, width: 5 },
      { style: inner, width: 2.5 },
    ]) {
      context.strokeStyle = style;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(x - 7, y);
      context.lineTo(x + 7, y);
      context.moveTo(x, y - 7);
      context.lineTo(x, y + 7);
      context.stroke();
    }
  }

  /**
   * Admissible entries near a slice, as dots: `draw(index, color)`.
   * @param {number} axis
   * @param {number} slice
   * @param {number} within_mm
   * @param {(index: Index, color: string) => void} draw
   */
  entriesNear(axis, slice, within_mm, draw) {
    if (!this.plan) return;
    const { map } = this.plan;
    const { plan } = this;
    this.free ??= this.directions.flatMap((direction, index) => {
      const depth = map.depth_m[index];
      if (map.rule[index] !== null || depth === null) return [];
      return [{ index: this.planner.indexOf(this.onSkin(plan, direction, depth)), color: this.shade(plan, index) }];
    });
    const spacing = 1e3 * this.planner.facts.spacing_m[axis];
    for (const entry of this.free)
      if (Math.abs(entry.index[axis] - slice) * spacing <= within_mm) draw(entry.index, entry.color);
  }

  // ---- the best paths

  showTable() {
    this.free = null;
    const { plan } = this;
    if (!plan?.routes.length) {
      NB.clear(this.table);
      return;
    }
    const chosen = plan.chosen?.route;
    const shown = plan.routes
      .map((route, index) => ({ route, index }))
      .filter(({ index }) => index < 8 || index === chosen);
    /** @param {{ route: PlannedRoute }} row */
    const best = ({ route }) => route.configurations.find(({ label }) => label === route.best);
    const asked = plan.routes.some(({ configurations }) => configurations.length);
    /** @param {PlannedRoute['margins']} margins */
    const nearest = (margins) => {
      const known = margins.flatMap(({ part, distance_m, obstacle }) =>
        part === null || distance_m === null ? [] : [{ distance_m, obstacle }],
      );
      const [least] = known.sort((a, b) => a.distance_m - b.distance_m);
      return least ? `${NB.mm(least.distance_m)} ${NB.words(least.obstacle)}` : 'none near';
    };
    /** @type {Column<{ route: PlannedRoute, index: number }>[]} */
    const columns = [
      {
        title: 'Path',
        cell: ({ route, index }) =>
          NB.el(
            'button',
            {
              type: 'button',
              title: route.best || '',
              onclick: () => this.enter(route.direction_deg, route.depth_m, route.best),
            },
            `Use ${index + 1}${index === chosen ? ' (recommended)' : ''}`,
          ),
      },
      { title: 'Depth', unit: 'mm', numeric: true, cell: ({ route }) => NB.mm(route.depth_m, 0) },
      { title: 'Odds ratio', numeric: true, cell: ({ route }) => NB.fixed(route.risk.odds_ratio, 2) },
      { title: 'Nearest structure', unit: 'mm', cell: ({ route }) => nearest(route.margins) },
    ];
    const bend = plan.routes.find((route) => route.bend)?.bend;
    if (bend)
      columns.push(
        { title: 'Bend', unit: 'mm', numeric: true, cell: ({ route }) => NB.mm(Math.abs(route.bend?.tip_m ?? NaN)) },
        { title: 'Nearest, bent', unit: 'mm', cell: ({ route }) => (route.bend ? nearest(route.bend.margins) : '') },
      );
    if (asked) {
      columns.push(
        { title: 'Feasible in', unit: 'of 8', numeric: true, cell: ({ route }) => String(route.working) },
        { title: 'Clearance', unit: 'mm', numeric: true, cell: (row) => NB.mm(best(row)?.clearance_m) },
        {
          title: 'Lateral error',
          unit: 'mm',
          numeric: true,
          cell: (row) => NB.mm(best(row)?.error?.target_lateral_rms_m),
        },
        {
          title: 'Free space',
          unit: '%',
          numeric: true,
          cell: (row) => NB.fixed(100 * (best(row)?.free_fraction ?? NaN), 0),
        },
      );
    }
    const unseen = plan.margins.filter(({ known }) => !known).map(({ obstacle }) => NB.words(obstacle));
    NB.clear(
      this.table,
      NB.table('Representative paths, best first', columns, shown, { class: 'small' }),
      NB.el('p', {
        class: 'soft',
        text:
          'Odds ratio: pneumothorax, relative to a path without risk factors; for ranking only, not a probability. ' +
          'Nearest structure: lower bound of the needle\u2019s distance from bone, vessels and organs. ' +
          (bend
            ? 'Bend: of the median needle\u2019s tip in tissue; nearest, bent: that of the needle so bent' +
              `${bend.towards_in_phantom ? '' : ', the least of twelve directions of its bend'}. `
            : '') +
          'Feasible in: ' +
          'configurations that satisfy all limits and, with their own tip error, the required clearances of the ' +
          'path. Clearance, lateral error (RMS) and free space are those of the best configuration; postures only, ' +
          'motions not planned. Free space: share of the hemisphere of 0.35 m about the entry that arm and tool ' +
          'leave free.',
      }),
      unseen.length
        ? NB.el('p', {
            class: 'bad',
            text: `Not labelled in this scan: ${unseen.join(', ')}. Distances from these are unknown.`,
          })
        : null,
    );
  }
}

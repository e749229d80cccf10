// The page of a roll map: feasible rolls, clearances, and reasons for rejection.
'use strict';

/** Colour and hatching of feasible rolls and of the rules that reject; the text under the cursor names them, too. */
NB.ruleStyle = (colors, name) => {
  const at = Object.keys(colors).indexOf(name);
  return [colors[name] || '#999999', name === 'works' || name === 'unreachable' || at < 0 ? 0 : (at % 3) + 1];
};

/** What a roll is optimised for. */
NB.aims = {
  clearance: 'clearance',
  joint_margin: 'joint-limit margin',
  singularity: 'distance from singularities',
  tip_accuracy: 'tip accuracy',
  balanced: 'all aims combined',
};

class AtlasPage {
  /** @type {number} */ goalIndex;
  /** @type {HTMLTableRowElement[]} */ sideRows;
  /** @type {HTMLTableCellElement[]} */ sideCells;
  /** @type {Axes | undefined} */ axes;
  /** @type {Map<string, RuleStyle>} */ used;
  /** @type {string | undefined} */ legendNames;

  /** @param {AtlasDocument} page @param {HTMLElement} app */
  constructor(page, app) {
    this.page = page;
    /** @type {{ [name: string]: boolean }} */
    this.layers = {
      robot: true,
      tool: true,
      table: true,
      gantry: true,
      mount: true,
      obstacle: true,
      skin: true,
      beside: true,
      assumed: true,
      bone: true,
      organ: true,
      vessel: true,
      lesion: true,
      marker: true,
      corridor: false,
      collision: false,
      needle: true,
    };
    this.view = new View(page.scene, `Cell of ${page.scenario}`);
    this.arm = this.view.arm('arm');
    this.curves = new Curves({
      height: 240,
      label: 'Clearance by class over roll',
      xTitle: 'roll (deg)',
      yTitle: 'clearance (mm)',
      seek: (roll) => this.setRoll(roll),
    });
    this.strips = new Canvas(300, 'Feasibility of each configuration over roll', (...all) => this.paint(...all));
    this.stripLegend = NB.el('div', { class: 'legend' });
    /** @param {PointerEvent} event */
    const pick = (event) => {
      if (!(event.buttons & 1) || !this.axes) return;
      const box = this.strips.canvas.getBoundingClientRect();
      const row = 7 - Math.round(this.axes.yAt(event.clientY - box.top));
      if (event.type === 'pointerdown' && row >= 0 && row < 8) this.setBranch(row);
      this.setRoll(this.axes.xAt(event.clientX - box.left));
    };
    this.strips.canvas.addEventListener('pointerdown', pick);
    this.strips.canvas.addEventListener('pointermove', pick);
    this.goalButtons = page.goals.map((goal, index) =>
      NB.el(
        'button',
        {
          type: 'button',
          role: 'radio',
          onclick: () => this.setGoal(index),
          onkeydown: (event) => {
            const step = NB.ARROWS[event.key];
            if (!step) return;
            event.preventDefault();
            const to = (index + step + page.goals.length) % page.goals.length;
            this.setGoal(to);
            this.goalButtons[to].focus();
          },
        },
        NB.words(goal.name),
      ),
    );
    this.slider = NB.el('input', {
      type: 'range',
      min: '0',
      max: '360',
      step: '1',
      value: '0',
      'aria-label': 'Roll, degrees',
      oninput: (event) => this.setRoll(Number(event.target.value)),
    });
    this.clock = NB.el('span', { class: 'clock', role: 'status' });
    this.side = NB.el('div', { class: 'panel' });
    this.table = NB.el('div');
    this.title = NB.el('h3');
    const present = new Set(page.scene.parts.map((part) => part.group));
    const layerNames = {
      robot: 'robot',
      tool: 'tool',
      collision: 'collision shapes',
      table: 'table',
      gantry: 'gantry',
      mount: 'mount',
      obstacle: 'obstacles',
      skin: 'skin',
      beside: 'arms, couch, objects',
      assumed: 'assumed body',
      bone: 'bones',
      organ: 'organs',
      vessel: 'vessels',
      lesion: 'lesions',
      marker: 'markers',
      corridor: 'access zone',
      needle: 'needle axis',
    };
    app.append(
      NB.el('p', {
        class: 'soft',
        text:
          'Every configuration over the roll of the guide about the needle: feasible roll ranges, clearance of ' +
          'the final posture, and the reason for rejection elsewhere. Motions are not planned.',
      }),
      NB.el(
        'div',
        { class: 'bar' },
        NB.el('strong', { text: 'Goal' }),
        NB.el('div', { class: 'tabs', role: 'radiogroup', 'aria-label': 'Goal' }, this.goalButtons),
        NB.copyLink(),
        NB.pngButton(this.view, '3D view', () => this.fileName(`${NB.plain.shown.millimetres(this.roll / 1e3)}deg`)),
      ),
      NB.el(
        'div',
        { class: 'grid' },
        NB.el(
          'div',
          null,
          this.view.element,
          NB.el(
            'div',
            { class: 'replay', role: 'group', 'aria-label': 'Roll' },
            NB.el('span', { text: 'Roll' }),
            this.slider,
            this.clock,
          ),
          NB.el(
            'section',
            { class: 'panel curves' },
            NB.el(
              'div',
              { class: 'figure-head' },
              NB.el('h3', { text: 'Feasibility over roll' }),
              NB.saveButton('SVG', 'Feasibility over roll', () => [
                `${this.fileName('atlas')}.svg`,
                this.stripsSvg(),
                'image/svg+xml',
              ]),
            ),
            this.strips.element,
            this.stripLegend,
          ),
          NB.el(
            'section',
            { class: 'panel' },
            NB.el(
              'div',
              { class: 'figure-head' },
              this.title,
              NB.saveButton('SVG', 'Clearance over roll', () => [
                `${this.fileName('clearance')}.svg`,
                this.curves.svg(this.title.textContent),
                'image/svg+xml',
              ]),
            ),
            this.curves.element,
          ),
        ),
        NB.el(
          'div',
          null,
          this.side,
          NB.el(
            'div',
            { class: 'panel no-print' },
            NB.el('h3', { text: 'Show' }),
            Object.entries(layerNames)
              .filter(([name]) => present.has(name) || name === 'needle')
              .map(([name, text]) =>
                NB.checkbox(text, this.layers[name], (on) => {
                  this.layers[name] = on;
                  this.applyLayers();
                }),
              ),
          ),
        ),
      ),
      NB.section('Feasible roll ranges', true, this.table),
      NB.section('Provenance', false, NB.provenance(page.provenance)),
    );
    this.branchIndex = 0;
    this.roll = 0;
    this.setGoal(0);
    this.applyLayers();
    this.fromAddress(NB.address.read());
    NB.address.watch((choices) => this.fromAddress(choices));
  }

  /**
   * Shows what the page's address asks for: goal, configuration, roll in degrees.
   * @param {AddressChoices} choices
   */
  fromAddress({ goal, configuration, roll }) {
    const at = this.page.goals.findIndex((each) => each.name === goal);
    if (at >= 0 && at !== this.goalIndex) this.setGoal(at);
    const index = this.goal.branches.findIndex((each) => each.label === configuration);
    if (index >= 0 && index !== this.branchIndex) this.setBranch(index);
    if (roll !== undefined && Number.isFinite(Number(roll))) this.setRoll(Number(roll));
  }

  /** @param {...string} words */
  fileName(...words) {
    return NB.fileName(this.page.scenario, this.goal.name, this.branch.label, ...words);
  }

  applyLayers() {
    for (const [name, on] of Object.entries(this.layers)) {
      if (['robot', 'tool', 'collision', 'corridor'].includes(name)) this.arm.layer(name, on);
      if (name !== 'collision' && name !== 'corridor' && name !== 'tool') this.view.show(name, on);
    }
    this.view.draw();
  }

  get goal() {
    return this.page.goals[this.goalIndex];
  }

  get branch() {
    return this.decode(this.goal.branches[this.branchIndex]);
  }

  /** @param {Branch} branch @returns {DecodedBranch} */
  decode(branch) {
    if (!branch.decoded) {
      branch.decoded = {
        rules: NB.array(branch.rules),
        joints: branch.joints.map(NB.array),
        surplus: NB.array(branch.surplus),
        curves: Object.entries(branch.curves).map(([name, column]) => [
          name,
          NB.array(column).map((value) => value * 1e3),
        ]),
      };
    }
    return { ...branch, ...branch.decoded };
  }

  /** @param {number} index */
  setGoal(index) {
    this.goalIndex = index;
    this.goalButtons.forEach((button, at) => {
      button.setAttribute('aria-checked', String(at === index));
      button.tabIndex = at === index ? 0 : -1;
    });
    const { view, goal } = this;
    view.empty('needle');
    const [x, y, z] = goal.guideExit;
    const length = this.page.scene.needleLength * 0.6;
    view.rod(
      'needle',
      [x - goal.axis[0] * length, y - goal.axis[1] * length, z - goal.axis[2] * length],
      goal.target,
      0.0012,
      [0, 0.45, 0.32, 1],
    );
    view.ball('needle', goal.target, 0.004, [0.84, 0.37, 0, 1]);
    view.label('needle', 'target', goal.target);
    if (goal.entry) {
      view.ball('needle', goal.entry, 0.0035, [0, 0.45, 0.7, 1]);
      view.label('needle', 'entry', goal.entry);
    }
    view.frame(
      [
        ...NB.aboutBase(this.page.scene.chain.base, 0.55),
        goal.target.map((v) => v - 0.25),
        goal.target.map((v) => v + 0.25),
      ],
      NB.direction(this.page.scene.chain.base, goal.target, goal.axis),
    );
    this.slider.step = String(360 / goal.rolls);
    this.slider.max = String(360 - 360 / goal.rolls);
    this.sideTable();
    this.rangeTable();
    const best = this.freest(goal);
    const { ranges } = goal.branches[Math.max(best, 0)];
    const [range] = [...ranges].sort((a, b) => b.width_rad - a.width_rad);
    this.setBranch(Math.max(best, 0));
    this.setRoll(range ? (range.best[goal.aim].roll_rad * 180) / Math.PI : 0);
  }

  /** @param {number} index */
  setBranch(index) {
    this.branchIndex = index;
    NB.mark(this.sideRows, index);
    const { branch, goal } = this;
    this.title.textContent = `Clearance over roll: ${branch.label}`;
    const x = Float32Array.from({ length: goal.rolls }, (_, k) => (360 * k) / goal.rolls);
    const bands = branch.ranges.flatMap((range) =>
      this.pieces(range).map(([from, to]) => ({ from, to, text: 'feasible', color: '#e3f0f9' })),
    );
    this.curves.set(
      branch.curves.map(([name, y]) => ({ name, x, y, ...NB.styleOf(name) })),
      bands,
      [0, 360],
    );
    this.setRoll(this.roll);
  }

  /**
   * A range as pieces of 0 to 360 degrees.
   * @param {RollRange} range
   */
  pieces(range) {
    if (range.is_whole_circle) return [[0, 360]];
    const from = ((((range.from_rad * 180) / Math.PI) % 360) + 360) % 360;
    const to = from + (range.width_rad * 180) / Math.PI;
    return to > 360
      ? [
          [from, 360],
          [0, to - 360],
        ]
      : [[from, to]];
  }

  /** @param {number} roll */
  setRoll(roll) {
    const { goal, branch } = this;
    const at = ((Math.round((roll / 360) * goal.rolls) % goal.rolls) + goal.rolls) % goal.rolls;
    this.roll = (360 * at) / goal.rolls;
    this.slider.value = String(this.roll);
    const joints = branch.joints.map((column) => column[at]);
    const has = joints.every((value) => !Number.isNaN(value));
    this.arm.show(has);
    if (has) this.arm.pose(this.page.scene.chain, joints);
    const rule = branch.rules[at];
    const text = rule === 255 ? '\u2713 feasible' : `\u2717 ${NB.words(branch.ruleNames[rule])}`;
    const where = `${NB.fixed(this.roll, 1)}\u00b0 \u00b7 ${branch.label}`;
    this.clock.textContent = `${where}: ${text}${has ? '' : ', no posture'}`;
    this.slider.setAttribute('aria-valuetext', this.clock.textContent);
    this.curves.seek(this.roll);
    this.strips.draw();
    this.view.draw();
    NB.address.write({ goal: goal.name, configuration: branch.label, roll: String(Math.round(this.roll * 1e3) / 1e3) });
    goal.branches.forEach((each, index) => {
      const decoded = this.decode(each);
      const code = decoded.rules[at];
      this.sideCells[index].replaceChildren(
        code === 255
          ? NB.el('span', { class: 'good', text: '\u2713 feasible' })
          : NB.el('span', { class: 'off', text: NB.words(each.ruleNames[code]) }),
      );
    });
  }

  sideTable() {
    /** @param {Branch} branch */
    const total = (branch) => this.turns(branch);
    const table = NB.table(
      'Choose a configuration',
      [
        { title: 'Configuration', cell: (b) => b.label },
        { title: 'At this roll', cell: () => '' },
        { title: 'Feasible range', unit: 'deg', numeric: true, cell: (b) => NB.deg(total(b), 0) },
      ],
      this.goal.branches,
      { class: 'choose small full' },
    );
    this.sideRows = NB.tableRows(table);
    this.sideCells = this.sideRows.map((row) => row.cells[1]);
    NB.rows(this.sideRows, (index) => this.setBranch(index));
    NB.clear(
      this.side,
      table,
      this.goal.fixedRoll === null
        ? null
        : NB.el('p', { class: 'soft small', text: `Roll fixed by the goal: ${NB.deg(this.goal.fixedRoll)}\u00b0.` }),
    );
  }

  /**
   * Width of all feasible roll ranges of a configuration.
   * @param {Branch | DecodedBranch} branch
   */
  turns(branch) {
    return branch.ranges.reduce((sum, range) => sum + (range.is_whole_circle ? 2 * Math.PI : range.width_rad), 0);
  }

  /**
   * The configuration with the largest feasible roll range, the first of equals; -1 where none is feasible.
   * @param {AtlasGoal} goal
   */
  freest(goal) {
    return goal.branches.reduce(
      (best, branch, at) =>
        branch.ranges.length && (best < 0 || this.turns(branch) > this.turns(goal.branches[best])) ? at : best,
      -1,
    );
  }

  rangeTable() {
    const { goal } = this;
    const rows = goal.branches.flatMap((branch, index) => {
      const ranges = branch.ranges.length ? branch.ranges : [null];
      return ranges.map((range) => ({ branch, range, index }));
    });
    /** @param {RollRange['before'] | undefined} found */
    const edge = (found) => (found ? `${NB.words(found.rule)}: ${found.detail}` : '');
    const table = NB.table(
      `Goal ${NB.words(goal.name)}: reason for rejection before and after each range; best roll for ` +
        `${NB.aims[goal.aim] || NB.words(goal.aim)}`,
      [
        { title: 'Configuration', cell: ({ branch }) => branch.label },
        {
          title: 'From',
          unit: 'deg',
          numeric: true,
          cell: ({ range }) => (range ? (range.is_whole_circle ? 'full circle' : NB.deg(range.from_rad, 2)) : 'none'),
        },
        {
          title: 'To',
          unit: 'deg',
          numeric: true,
          cell: ({ range }) =>
            range && !range.is_whole_circle
              ? `${NB.deg(range.to_rad % (2 * Math.PI), 2)}${range.to_rad > 2 * Math.PI ? ', past 360' : ''}`
              : '',
        },
        { title: 'Rejected before', text: true, cell: ({ range }) => edge(range?.before) },
        { title: 'Rejected after', text: true, cell: ({ range }) => edge(range?.after) },
        {
          title: 'Best roll',
          unit: 'deg',
          numeric: true,
          cell: ({ range }) => (range ? NB.deg(range.best[goal.aim].roll_rad, 2) : ''),
        },
        {
          title: 'Smallest distance there',
          unit: 'mm',
          help: 'over all classes that change with the roll, self-clearance included',
          numeric: true,
          cell: ({ range }) => (range ? NB.mm(range.best[goal.aim].least_clearance_m) : ''),
        },
        {
          title: 'Pair',
          cell: ({ range }) => [...new Set((range?.best[goal.aim].pair || []).map(NB.words))].join(' to '),
        },
      ],
      rows,
      { class: 'choose small' },
    );
    const elements = NB.tableRows(table);
    NB.rows(elements, (at) => {
      NB.mark(elements, at);
      this.setBranch(rows[at].index);
      if (rows[at].range) this.setRoll((rows[at].range.best[goal.aim].roll_rad * 180) / Math.PI);
    });
    const freest = this.freest(goal);
    NB.mark(
      elements,
      Math.max(
        rows.findIndex(({ index }) => index === freest),
        0,
      ),
    );
    const working = goal.branches.filter((branch) => branch.ranges.length).length;
    let answer = `${working} of ${goal.branches.length} configurations feasible`;
    if (freest >= 0) {
      const branch = goal.branches[freest];
      answer += `; largest roll range: ${branch.label}, ${NB.deg(this.turns(branch), 0)} of 360\u00b0`;
    }
    NB.clear(this.table, NB.el('p', null, NB.el('strong', { text: `${answer}.` })), table);
  }

  /** @param {Painter} context @param {number} width @param {number} height */
  paint(context, width, height) {
    const { goal } = this;
    const left = width < 420 ? 106 : 150;
    const box = { left, top: 8, width: width - left - 16, height: height - 50 };
    const axes = new Axes(
      box,
      { low: 0, high: 360, title: 'roll (deg)' },
      { low: -0.5, high: 7.5, title: '', labels: goal.branches.map((branch) => branch.label).reverse() },
    );
    this.axes = axes;
    axes.draw(context);
    /** @type {Map<string, RuleStyle>} */
    const used = new Map();
    const h = (box.height / 8) * 0.7;
    goal.branches.forEach((each, row) => {
      const branch = this.decode(each);
      const y = axes.py(7 - row) - h / 2;
      let start = 0;
      for (let at = 1; at <= goal.rolls; at++) {
        if (at < goal.rolls && branch.rules[at] === branch.rules[start]) continue;
        const rule = branch.rules[start];
        const name = rule === 255 ? 'works' : branch.ruleNames[rule];
        const style = NB.ruleStyle(this.page.ruleColors, name);
        used.set(name, style);
        // A roll stands for half a step on both sides.
        const [from, to] = [
          axes.px(Math.max(0, (360 * (start - 0.5)) / goal.rolls)),
          axes.px(Math.min(360, (360 * (at - 0.5)) / goal.rolls)),
        ];
        this.block(context, style, from, y, to - from, h);
        start = at;
      }
      // The exact ends of the ranges.
      context.strokeStyle = '#000';
      context.lineWidth = 1.5;
      for (const range of each.ranges) {
        for (const [from, to] of this.pieces(range))
          context.strokeRect(axes.px(from), y, axes.px(to) - axes.px(from), h);
        const best = axes.px(((range.best[goal.aim].roll_rad * 180) / Math.PI + 360) % 360);
        context.fillStyle = '#fff';
        context.beginPath();
        context.moveTo(best, y + 3);
        context.lineTo(best + 5, y + h / 2);
        context.lineTo(best, y + h - 3);
        context.lineTo(best - 5, y + h / 2);
        context.closePath();
        context.fill();
        context.stroke();
      }
      if (row === this.branchIndex) {
        context.fillStyle = '#0072b2';
        context.fillRect(box.left - 4, y, 3, h);
      }
    });
    const at = Math.round(axes.px(this.roll)) + 0.5;
    context.strokeStyle = '#000';
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(at, box.top);
    context.lineTo(at, box.top + box.height);
    context.stroke();
    const mark = this.fixedMark(goal);
    if (mark !== null) {
      context.setLineDash([4, 3]);
      const fixed = axes.px(mark);
      context.beginPath();
      context.moveTo(fixed, box.top);
      context.lineTo(fixed, box.top + box.height);
      context.stroke();
      context.setLineDash([]);
    }
    this.used = used;
    const names = [...used.keys()].join();
    if (names !== this.legendNames) {
      this.legendNames = names;
      /** @param {[name: string, style: RuleStyle]} rule */
      const key = ([name, style]) => {
        const canvas = NB.el('canvas', { width: '26', height: '14', 'aria-hidden': 'true' });
        this.block(NB.context(canvas), style, 0, 0, 26, 14);
        return NB.el('span', { class: 'key' }, canvas, name === 'works' ? 'feasible' : NB.words(name));
      };
      const rejecting = [...used].filter(([name]) => name !== 'works');
      NB.clear(
        this.stripLegend,
        [...used].filter(([name]) => name === 'works').map(key),
        rejecting.length ? NB.el('strong', { class: 'small', text: 'Rejected by:' }) : null,
        rejecting.map(key),
        NB.el('span', {
          class: 'soft small',
          text:
            'Black frame: feasible range with exact limits; diamond: its best ' +
            `roll${this.fixedMark(this.goal) === null ? '' : '; dashed line: roll fixed by the goal'}.`,
        }),
      );
    }
  }

  stripsSvg() {
    const title = `${NB.words(this.goal.name)}: feasibility over roll`;
    /** @param {string} name */
    const words = (name) => (name === 'works' ? 'feasible' : `rejected by: ${NB.words(name)}`);
    /** @type {Mark[]} */
    const legend = [...this.used].map(([name, style]) => ({
      text: words(name),
      draw: (context, x, y) => this.block(context, style, x - 13, y - 6, 26, 12),
    }));
    const svg = NB.paper(title, (...all) => this.paint(...all), 230, legend);
    this.strips.draw();
    return svg;
  }

  /** @param {AtlasGoal} goal */
  fixedMark(goal) {
    return goal.fixedRoll === null ? null : ((((goal.fixedRoll * 180) / Math.PI) % 360) + 360) % 360;
  }

  /**
   * @param {Painter} context
   * @param {RuleStyle} style
   * @param {number} x
   * @param {number} y
   * @param {number} width
   * @param {number} height
   */
  block(context, [color, hatch], x, y, width, height) {
    context.save();
    context.fillStyle = color;
    context.fillRect(x, y, width, height);
    context.beginPath();
    context.rect(x, y, width, height);
    context.clip();
    context.strokeStyle = 'rgba(255, 255, 255, 0.75)';
    context.lineWidth = 1.3;
    const lines = [[], [1], [-1], [1, -1]][hatch];
    for (const side of lines) {
      for (let from = Math.floor(x / 9) * 9 - height; from < x + width + height; from += 9) {
        context.beginPath();
        context.moveTo(from, side > 0 ? y + height : y);
        context.lineTo(from + height, side > 0 ? y : y + height);
        context.stroke();
      }
    }
    context.restore();
  }
}

NB.start((page, app) => {
  NB.current = new AtlasPage(page, app);
});

// The page of a run without goals: a test by ISO 9283, or an excitation run.
'use strict';

class TestPage {
  /** @type {TestCharts} */ test;
  /** @type {TestReport} */ measured;
  /** @type {number} */ engine;
  /** @type {number} */ poseIndex;
  /** @type {HTMLButtonElement[]} */ poseButtons;
  /** @type {HTMLElement} */ note;
  /** @type {number} */ spread;

  /**
   * @param {RunDocument} page
   * @param {HTMLElement} app
   * @param {View} view
   * @param {{ [name: string]: boolean }} shown
   */
  constructor(page, app, view, shown) {
    this.page = page;
    this.view = view;
    this.report = page.report;
    this.arm = view.arm('arm');
    for (const [name, on] of Object.entries(shown)) view.show(name, on);
    for (const group of ['collision', 'corridor']) this.arm.layer(group, false);
    if (page.iso9283 && page.report.iso9283) this.buildTest(app, page.iso9283, page.report.iso9283);
    else this.buildOther(app);
  }

  /** @param {HTMLElement} app */
  buildOther(app) {
    this.arm.pose(this.page.scene.chain, this.page.start);
    this.view.frame(NB.aboutBase(this.page.scene.chain.base, 0.55), [-0.75, 0.45, -0.55]);
    app.append(
      this.view.element,
      NB.el('p', { class: 'soft', text: 'Arm in its start posture.' }),
      NB.section(
        'Excitation run',
        true,
        NB.el('p', {
          text: 'Certified clearances by motion are in report.json; the logs are in the files named here.',
        }),
        NB.tree(this.report.excitation),
      ),
    );
  }

  /** @param {HTMLElement} app @param {TestCharts} test @param {TestReport} report */
  buildTest(app, test, report) {
    const { view } = this;
    this.test = test;
    this.measured = report;
    this.engine = 0;
    const engines = test.engines.map((each) => each.engine);
    this.poseButtons = test.commanded.map((_, index) =>
      NB.el('button', { type: 'button', 'aria-pressed': 'false', onclick: () => this.setPose(index) }, `P${index + 1}`),
    );
    this.note = NB.el('p', { class: 'soft', role: 'status' });
    this.spread = this.spreadFactor();
    const { protocol } = report;
    app.append(
      NB.el('p', {
        text:
          `The arm moves from P1 to P5 and back as ${protocol.configuration}, at ` +
          `${NB.percent(protocol.speed_share)} % of its rated joint speeds, with ` +
          `${NB.significant(protocol.load_kg)} kg at the flange. A tracker measures the attained positions; its ` +
          `noise has a standard deviation of ${NB.length(protocol.tracker_noise_m)} per axis.`,
      }),
      NB.el(
        'div',
        { class: 'grid' },
        NB.el(
          'div',
          null,
          NB.el(
            'div',
            { class: 'bar no-print', role: 'group', 'aria-label': 'Pose' },
            NB.el('span', { text: 'Pose' }),
            this.poseButtons,
            engines.length > 1
              ? NB.select(
                  'Engine',
                  engines.map((name, at) => [String(at), name]),
                  '0',
                  (value) => {
                    this.engine = Number(value);
                    this.drawSpread();
                  },
                )
              : null,
            NB.pngButton(view, 'ISO 9283 poses', NB.fileName(this.report.scenario.name, 'poses')),
          ),
          view.element,
          this.note,
        ),
        NB.el('div', null, NB.el('div', { class: 'panel' }, this.results(), this.remarks())),
      ),
      NB.section(
        'Attained positions',
        true,
        test.engines.map(({ engine, attained }) =>
          NB.chart(
            `${engine}: attained positions about the command`,
            attained,
            NB.fileName(this.report.scenario.name, 'attained', engine),
            'Positions in the controller\u2019s base frame, all poses to one scale. AP: distance of the mean ' +
              'from the command; RP: mean distance from the mean plus three standard deviations.',
          ),
        ),
      ),
      NB.section(
        'Stabilisation',
        true,
        test.engines.map(({ engine, stabilisation }) =>
          NB.chart(
            `${engine}: distance from the attained position after the motion`,
            stabilisation,
            NB.fileName(this.report.scenario.name, 'stabilisation', engine),
          ),
        ),
      ),
      NB.section('All test results', true, this.tables()),
    );
    const spots = test.commanded;
    const middle = spots[0];
    view.frame(
      [...NB.aboutBase(this.page.scene.chain.base, 0.55), ...spots],
      NB.direction(this.page.scene.chain.base, middle, [0, 0, -1]),
    );
    // The path of a cycle: P5 P4 P3 P2 P1.
    spots.forEach((at, index) => {
      view.rod('needle', at, spots[(index + spots.length - 1) % spots.length], 0.0012, [0.35, 0.38, 0.42, 1], true);
      view.ball('needle', at, 0.006, [0.84, 0.37, 0, 1], true);
      view.label('needle', `P${index + 1}`, at);
    });
    this.setPose(Math.min(Math.max(Number(NB.address.read().pose || 1) - 1, 0), spots.length - 1) || 0);
    this.drawSpread();
  }

  /** Power of ten by which the spread is drawn larger, so that it is seen beside the arm. */
  spreadFactor() {
    const most = Math.max(...Object.values(this.measured.engines).map((each) => each.ap_m + each.rp_m), 1e-12);
    return 10 ** Math.max(0, Math.floor(Math.log10(0.05 / most)));
  }

  /** @param {number} index */
  setPose(index) {
    this.poseIndex = index;
    for (const [at, button] of this.poseButtons.entries()) button.setAttribute('aria-pressed', String(at === index));
    this.arm.pose(this.page.scene.chain, this.measured.protocol.joints_rad[index]);
    const attained = Object.values(this.measured.engines)[this.engine]?.poses[index];
    this.note.textContent =
      `The arm is in the commanded pose P${index + 1}. Blue points: attained positions, deviations from the ` +
      `command magnified ${this.spread.toLocaleString('en')} times` +
      `${attained ? ` (AP ${NB.length(attained.ap_m)}, RP ${NB.length(attained.rp_m)})` : ''}.`;
    NB.address.write({ pose: String(index + 1) });
    this.view.draw();
  }

  drawSpread() {
    const { view, test } = this;
    view.empty('attained');
    const run = test.engines[this.engine];
    test.commanded.forEach((at, index) => {
      const offsets = run ? NB.array(run.offsets[index]) : [];
      for (let k = 0; k < offsets.length; k += 3) {
        view.ball(
          'attained',
          at.map((value, axis) => value + this.spread * offsets[k + axis]),
          0.004,
          [0, 0.45, 0.7, 1],
          true,
        );
      }
    });
    this.setPose(this.poseIndex);
  }

  results() {
    const rows = Object.entries(this.measured.engines);
    /** @param {TestMeasured} each @param {'time_s' | 'overshoot_m'} key */
    const worst = (each, key) => {
      const all = each.stabilisation.map((s) => s[key]);
      const known = all.filter((value) => value !== null);
      return known.length < all.length ? null : Math.max(...known);
    };
    return NB.table(
      'Worst case over all poses',
      [
        { title: 'Engine', cell: ([engine]) => engine },
        {
          title: 'Accuracy AP',
          numeric: true,
          cell: ([, each]) => NB.length(each.ap_m),
          help: 'distance of the mean from the command',
        },
        { title: 'Repeatability RP', numeric: true, cell: ([, each]) => NB.length(each.rp_m) },
        {
          title: 'Multi-directional variation vAP',
          numeric: true,
          cell: ([, each]) => NB.length(each.vap_m),
          help: 'distance between the means of approaches from different directions',
        },
        {
          title: 'Stabilisation time',
          unit: 's',
          numeric: true,
          cell: ([, each]) => NB.fixed(worst(each, 'time_s'), 3),
        },
        { title: 'Overshoot', numeric: true, cell: ([, each]) => NB.length(worst(each, 'overshoot_m')) },
        {
          title: 'Peak torque',
          unit: '% of limit',
          numeric: true,
          cell: ([, each]) => NB.percent(each.peak_torque_ratio),
        },
      ],
      rows,
      { class: 'small full' },
    );
  }

  /** Remarks that qualify the numbers, before the numbers. */
  remarks() {
    const remarks = Object.entries(this.measured.engines).filter(([, each]) => each.remark);
    return [...new Set(remarks.map(([, each]) => each.remark))].map((remark) => {
      const of = remarks.filter(([, each]) => each.remark === remark).map(([engine]) => engine);
      return NB.el('p', { class: 'bad', text: `${of.join(' and ')}: ${remark}.` });
    });
  }

  tables() {
    return Object.entries(this.measured.engines).map(([engine, each]) => {
      /** @type {PoseRow[]} */
      const rows = each.poses.map((pose) => ({
        pose,
        settled: each.stabilisation.find((s) => s.pose === pose.pose),
        direction: each.directional.find((d) => d.pose === pose.pose),
      }));
      return [
        NB.table(
          `${engine}: by pose; ${each.cycles_simulated} cycles simulated, readings with tracker noise`,
          [
            { title: 'Pose', cell: ({ pose }) => `P${pose.pose}` },
            { title: 'Measured', numeric: true, cell: ({ pose }) => `${pose.count} readings` },
            { title: 'AP', numeric: true, cell: ({ pose }) => NB.length(pose.ap_m) },
            ...['x', 'y', 'z'].map((axis, k) => ({
              title: `AP ${axis}`,
              numeric: true,
              cell: (/** @type {PoseRow} */ { pose }) => NB.length(pose.ap_xyz_m[k]),
            })),
            { title: 'RP', numeric: true, cell: ({ pose }) => NB.length(pose.rp_m) },
            { title: 'vAP', numeric: true, cell: ({ direction }) => NB.length(direction?.vap_m) },
            {
              title: 'Stabilisation time',
              unit: 's',
              numeric: true,
              cell: ({ settled }) => NB.fixed(settled?.time_s, 3),
            },
            {
              title: 'After motion end',
              unit: 's',
              numeric: true,
              cell: ({ settled }) => NB.fixed(settled?.after_motion_s, 3),
              help: 'negative: before its end',
            },
            { title: 'Overshoot', numeric: true, cell: ({ settled }) => NB.length(settled?.overshoot_m) },
          ],
          rows,
          { class: 'small' },
        ),
        each.drift
          ? NB.el('p', {
              text:
                `Drift at P${each.drift.pose}: accuracy ${NB.length(each.drift.dap_m)}, repeatability ` +
                `${NB.length(each.drift.drp_m)}.`,
            })
          : null,
      ];
    });
  }
}

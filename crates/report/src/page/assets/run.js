// The page of a run.
'use strict';

class RunPage {
  /** @type {number} */ goalIndex;
  /** @type {number} */ configurationIndex;
  /** @type {ArmView} */ arm;
  /** @type {ArmView} */ other;
  /** @type {{ name: string, arm: ArmView | null }[]} */ ghostArms;
  /** @type {HTMLButtonElement[]} */ goalButtons;
  /** @type {{ element: HTMLElement, rows: HTMLElement[] } | null} */ goalTable;
  /** @type {Explore} */ explore;
  /** @type {Curves} */ curves;
  /** @type {HTMLElement} */ answer;
  /** @type {HTMLElement} */ side;
  /** @type {HTMLElement} */ details;
  /** @type {HTMLElement} */ table;
  /** @type {HTMLElement} */ margins;
  /** @type {HTMLElement} */ budget;
  /** @type {HTMLElement} */ budgetSection;
  /** @type {HTMLElement} */ likely;
  /** @type {HTMLElement} */ people;
  /** @type {HTMLElement} */ events;
  /** @type {HTMLElement} */ now;
  /** @type {HTMLElement[]} */ sideRows;
  /** @type {HTMLElement[]} */ tableRows;
  /** @type {HTMLButtonElement} */ playButton;
  /** @type {HTMLInputElement} */ slider;
  /** @type {HTMLElement} */ clock;
  /** @type {HTMLSelectElement} */ engineSelect;
  /** @type {HTMLElement} */ apart;
  /** @type {Nearest | null} */ pinned;
  /** @type {MotionRun[][]} */ pairs;
  /** @type {MotionRun[]} */ shown;
  /** @type {number[] | null} */ joints;
  /** @type {number} */ end;
  /** @type {boolean} */ playing;

  /** @param {RunDocument} page @param {HTMLElement} app */
  constructor(page, app) {
    this.page = page;
    this.report = page.report;
    /** @type {Set<number>} */
    this.ghosts = new Set();
    /** @type {{ [name: string]: boolean }} */
    this.layers = {
      robot: true,
      tool: true,
      collision: false,
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
      needle: true,
      witness: true,
      people: false,
      space: false,
      cone: false,
      ellipsoids: true,
    };
    this.magnify = 10;
    this.time = 0;
    this.speed = 1;
    app.append(this.head());
    this.view = new View(page.scene, `Cell of ${this.report.scenario.name}`);
    if (this.report.goals.length) this.build(app);
    else this.buildWithoutGoals(app);
    app.append(
      NB.sections.criteria(this.page),
      NB.sections.requirements(this.report) || '',
      NB.sections.provenance(this.report),
    );
    this.fromAddress(NB.address.read());
    NB.address.watch((choices) => this.fromAddress(choices));
  }

  /**
   * Shows what the page's address asks for: goal, configuration, time.
   * @param {AddressChoices} choices
   */
  fromAddress({ goal, configuration, time }) {
    if (!this.report.goals.length) return;
    const at = this.report.goals.findIndex((each) => each.name === goal);
    if (at >= 0 && at !== this.goalIndex) this.setGoal(at);
    const index = this.goal.configurations.findIndex((each) => each.label === configuration);
    if (index >= 0 && index !== this.configurationIndex) this.setConfiguration(index);
    const seconds = Number(time);
    if (time !== undefined && Number.isFinite(seconds) && this.shown.length)
      this.seek(Math.min(Math.max(seconds, 0), this.end));
  }

  toAddress() {
    const isEnd = !this.shown?.length || this.time >= this.end;
    NB.address.write({
      goal: this.goal.name,
      configuration: this.configuration.label,
      time: isEnd ? null : this.time.toFixed(2),
    });
  }

  head() {
    const { verdict, engine_failures: failures } = this.report;
    const bar = NB.el(
      'div',
      { class: 'bar' },
      NB.verdict(verdict),
      NB.el('span', { text: this.page.counts }),
      NB.copyLink(),
      failures.map((each) =>
        NB.el('span', {
          class: 'error',
          text: `${each.engine} failed${each.during ? ` during ${each.during}` : ''}: ${each.message}`,
        }),
      ),
    );
    // What the verdict rests on stands beside it.
    const notes = this.page.qualifying.map((text) => NB.el('li', { text: `note: ${text}` }));
    return NB.el('div', null, bar, notes.length ? NB.el('ul', { class: 'plain' }, notes) : null, this.judged());
  }

  /** What is said of a motion from a file: where it holds, its limits, its clearances beside those of plans. */
  judged() {
    if (!this.page.judged) return null;
    return this.page.judged.map(({ lines, header, rows }) =>
      lines
        ? lines.map((text) => NB.el('p', { text }))
        : NB.table(
            'Least clearances of the motion beside those of plans to the same goal',
            (header ?? []).map((title, at) => ({
              title,
              numeric: at > 0 && at !== 3,
              cell: (/** @type {string[]} */ row) => row[at],
            })),
            rows ?? [],
          ),
    );
  }

  /** @param {HTMLElement} app */
  build(app) {
    const view = this.view;
    this.arm = view.arm('arm');
    this.other = view.arm('other', { color: [0.9, 0.62, 0], opacity: 0.35 });
    this.ghostArms = Array.from({ length: 8 }, (_, index) => ({ name: `ghost${index}`, arm: null }));
    const goals = this.report.goals;
    this.goalButtons = goals.map((goal, index) =>
      NB.el(
        'button',
        {
          type: 'button',
          role: 'radio',
          'aria-checked': 'false',
          onclick: () => this.setGoal(index),
          onkeydown: (event) => {
            const step = NB.ARROWS[event.key];
            if (!step) return;
            event.preventDefault();
            const to = (index + step + goals.length) % goals.length;
            this.setGoal(to);
            this.goalButtons[to].focus();
          },
        },
        NB.words(goal.name),
      ),
    );
    this.goalTable = NB.sections.goals(this, (index) => this.setGoal(index));
    this.answer = NB.el('div', { class: 'answer' });
    this.explore = new Explore(this);
    // On paper, the table below says the same.
    this.side = NB.el('div', { class: 'panel no-print' });
    this.details = NB.el('div', { class: 'panel' });
    this.table = NB.el('div');
    this.margins = NB.el('div');
    this.budget = NB.el('div');
    this.likely = NB.el('div');
    this.people = NB.el('div');
    this.events = NB.el('div');
    this.now = NB.el('div', { class: 'now small', role: 'status', 'aria-live': 'off' });
    this.curves = new Curves({
      height: 250,
      label: 'Clearance by class over time',
      xTitle: 'time (s)',
      yTitle: 'clearance (mm)',
      seek: (time) => {
        this.pause();
        this.seek(time);
      },
    });
    const hasEvents = goals.some((goal) => goal.configurations.some((each) => each.events));
    const hasProbability = goals.some((goal) => goal.configurations.some((each) => each.probability));
    this.budgetSection = NB.section('Tip error budget', true, this.budget);
    app.append(
      this.goalTable?.element || '',
      NB.el(
        'div',
        { class: 'bar' },
        NB.el('strong', { text: 'Goal' }),
        NB.el('div', { class: 'tabs', role: 'radiogroup', 'aria-label': 'Goal' }, this.goalButtons),
      ),
      this.answer,
      NB.el(
        'div',
        { class: 'grid' },
        NB.el(
          'div',
          null,
          this.viewBar(),
          view.element,
          this.replayBar(),
          this.now,
          this.explore.element,
          NB.el(
            'div',
            { class: 'figure-head' },
            NB.el('h3', { text: 'Clearance over time' }),
            NB.saveButton('SVG', 'Clearance over time', () => [
              `${this.fileName('clearance')}.svg`,
              this.curves.svg(`${this.configuration.label}: clearance over time`),
              'image/svg+xml',
            ]),
          ),
          this.curves.element,
        ),
        NB.el('div', null, this.side, this.details, this.layerPanel()),
      ),
      NB.section('Comparison of configurations', true, this.table),
      this.budgetSection,
      hasProbability ? NB.section('How likely: lesion and structures', true, this.likely) : '',
      hasEvents ? NB.section('Contact, emergency stop, retreat', true, this.events) : '',
      NB.section('Clearance of the planned motion', false, this.margins),
      NB.section('Free space and line of sight', false, this.people),
    );
    this.setGoal(0);
  }

  /** @param {HTMLElement} app */
  buildWithoutGoals(app) {
    this.test = new TestPage(this.page, app, this.view, this.layers);
  }

  /** @param {...string} words */
  fileName(...words) {
    return NB.fileName(this.report.scenario.name, this.goal.name, this.configuration.label, ...words);
  }

  /**
   * Base and shoulders of the arm, and points of the goal.
   * @param {Point[]} points
   */
  framed(points) {
    return [...NB.aboutBase(this.page.scene.chain.base, 0.55), ...points];
  }

  /** @param {Point} target @param {Point} axis */
  direction(target, axis) {
    return NB.direction(this.page.scene.chain.base, target, axis);
  }

  viewBar() {
    /** @param {string} name @param {() => Viewpoint} make */
    const look = (name, make) => NB.el('button', { type: 'button', onclick: () => this.aim(make()) }, name);
    const entry = () => this.goal.entry_m || this.goal.target_m;
    return NB.el(
      'div',
      { class: 'bar no-print', role: 'group', 'aria-label': 'Viewpoint' },
      NB.el('button', { type: 'button', onclick: () => this.view.reset() }, 'Whole cell'),
      look('Front', () => ({ direction: [0, 1, -0.12] })),
      look('Side', () => ({ direction: [-1, 0, -0.12] })),
      look('From above', () => ({ direction: [0, 0.02, -1] })),
      look('Needle', () => {
        const d = this.direction(this.goal.target_m, this.goal.axis);
        return { direction: d, distance: 0.55, middle: entry() };
      }),
      NB.pngButton(this.view, '3D view', () => this.fileName(`${this.time.toFixed(2)}s`)),
      NB.el('span', {
        class: 'soft small',
        text: 'drag: rotate \u00b7 wheel or pinch: zoom \u00b7 right button: pan',
      }),
    );
  }

  /** @param {Viewpoint} viewpoint */
  aim({ direction, distance, middle }) {
    const home = this.view.home;
    if (home) this.view.look(direction, distance || home.distance, middle || home.middle);
  }

  layerPanel() {
    /** @param {string} name @param {string} text */
    const box = (name, text) =>
      NB.checkbox(text, this.layers[name], (on) => {
        this.layers[name] = on;
        this.applyLayers();
      });
    const present = new Set(this.page.scene.parts.map((part) => part.group));
    const parts = [
      ['robot', 'robot'],
      ['tool', 'tool'],
      ['collision', 'collision shapes'],
      ['table', 'table'],
      ['gantry', 'gantry'],
      ['mount', 'mount'],
      ['obstacle', 'obstacles'],
      ['skin', 'skin'],
      ['beside', 'arms, couch, objects'],
      ['assumed', 'assumed body'],
      ['bone', 'bones'],
      ['organ', 'organs'],
      ['vessel', 'vessels'],
      ['lesion', 'lesions'],
      ['marker', 'markers'],
      ['corridor', 'access zone'],
    ].filter(([name]) => present.has(name));
    const hasBudget = this.report.goals.some((goal) => goal.configurations.some((each) => each.budget));
    return NB.el(
      'div',
      { class: 'panel no-print' },
      NB.el('h3', { text: 'Show' }),
      NB.el(
        'div',
        { role: 'group', 'aria-label': 'Parts of the picture' },
        parts.map(([name, text]) => box(name, text)),
        box('needle', 'needle axis'),
        box('cone', 'hand cone'),
        box('people', 'people and line of sight'),
        box('space', 'free space'),
        box('witness', 'closest pair'),
        hasBudget ? box('ellipsoids', 'error ellipsoids') : null,
      ),
      NB.el(
        'div',
        { class: 'bar' },
        hasBudget
          ? NB.select(
              'Error ellipsoid scale',
              [
                ['1', 'true size'],
                ['5', '5 \u00d7'],
                ['10', '10 \u00d7'],
                ['20', '20 \u00d7'],
              ],
              '10',
              (value) => {
                this.magnify = Number(value);
                this.drawBudget();
              },
            )
          : null,
      ),
    );
  }

  replayBar() {
    this.playButton = NB.el(
      'button',
      { type: 'button', onclick: () => (this.playing ? this.pause() : this.play()) },
      '\u25b6 Play',
    );
    this.slider = NB.el('input', {
      type: 'range',
      min: '0',
      max: '1',
      step: '0.01',
      value: '0',
      'aria-label': 'Motion time',
      oninput: (event) => {
        this.pause();
        this.seek(Number(event.target.value));
      },
    });
    this.clock = NB.el('span', { class: 'clock', role: 'status', 'aria-live': 'off' });
    this.engineSelect = NB.el('select', { 'aria-label': 'Engine', onchange: () => this.showMotion() });
    this.apart = NB.el('span', { class: 'soft' });
    const speed = NB.select(
      'Speed',
      [
        ['0.1', '0.1 \u00d7'],
        ['0.25', '0.25 \u00d7'],
        ['0.5', '0.5 \u00d7'],
        ['1', '1 \u00d7'],
        ['2', '2 \u00d7'],
        ['4', '4 \u00d7'],
      ],
      '1',
      (value) => {
        this.speed = Number(value);
      },
    );
    return NB.el(
      'div',
      { class: 'replay', role: 'group', 'aria-label': 'Replay' },
      this.playButton,
      this.slider,
      this.clock,
      speed,
      this.engineSelect,
      this.apart,
    );
  }

  get goal() {
    return this.report.goals[this.goalIndex];
  }

  get extra() {
    return this.page.goals[this.goalIndex];
  }

  get configuration() {
    return this.goal.configurations[this.configurationIndex];
  }

  get own() {
    return this.extra.configurations[this.configurationIndex];
  }

  /** @param {number} index */
  setGoal(index) {
    this.goalIndex = index;
    this.goalButtons.forEach((button, at) => {
      button.setAttribute('aria-checked', String(at === index));
      button.tabIndex = at === index ? 0 : -1;
    });
    const view = this.view;
    const { target_m: target, axis, entry_m: entry } = this.goal;
    view.empty('needle');
    const tool = this.page.scene.needleLength;
    const [x, y, z] = this.extra.guideExit;
    const behind = [x - axis[0] * tool * 0.6, y - axis[1] * tool * 0.6, z - axis[2] * tool * 0.6];
    view.rod('needle', behind, target, 0.0012, [0, 0.45, 0.32, 1]);
    // What tissue makes of it: the median needle.
    const bent = this.goal.needle?.path_in_world_m ?? [];
    bent.slice(1).forEach((point, at) => {
      view.rod('needle', bent[at], point, 0.0009, [0.8, 0.1, 0.1, 1], true);
    });
    if (bent.length) view.label('needle', 'bent', bent[bent.length - 1]);
    view.ball('needle', target, 0.004, [0.84, 0.37, 0, 1]);
    view.label('needle', 'target', target);
    if (entry) {
      view.ball('needle', entry, 0.0035, [0, 0.45, 0.7, 1]);
      view.label('needle', 'entry', entry);
    }
    this.drawPeople();
    this.sideTable();
    this.configurationTable();
    NB.clear(
      this.answer,
      NB.sections.answer(this.goal, this.report.criteria, this.extra.trueTarget, Boolean(this.page.judged)),
    );
    NB.clear(this.people, NB.sections.people(this.goal));
    if (this.goalTable) NB.mark(this.goalTable.rows, index);
    const around = [
      [-0.25, -0.25, -0.1],
      [0.25, 0.25, 0.3],
    ].map((offset) => offset.map((value, k) => target[k] + value));
    view.frame(this.framed(around), this.direction(target, axis));
    const { recommended } = this.goal;
    const first = recommended
      ? this.goal.configurations.findIndex((each) => each.label === recommended.label)
      : Math.max(
          0,
          this.goal.configurations.findIndex((each) => each.joints_rad),
        );
    this.drawGhosts();
    this.setConfiguration(first);
    this.applyLayers();
  }

  /** @param {number} index */
  setConfiguration(index) {
    this.pause();
    this.configurationIndex = index;
    NB.mark(this.sideRows, index);
    NB.mark(this.tableRows, index);
    this.pinned = null;
    const { runs } = this.own;
    // Two engines at a time: all pairs of them.
    this.pairs = runs.flatMap((second, at) => runs.slice(0, at).map((first) => [first, second]));
    NB.clear(
      this.engineSelect,
      this.pairs.map(([first, second], at) =>
        NB.el('option', {
          value: at ? `pair ${at}` : 'both',
          text: `${runs.length > 2 ? `${first.engine} and ${second.engine}` : 'both engines'}, second in orange`,
        }),
      ),
      runs.map((run, at) =>
        NB.el('option', { value: String(at), text: `${run.engine}${run.stopped ? ' (stopped)' : ''}` }),
      ),
      runs.length ? null : NB.el('option', { value: '', text: 'no motion recorded' }),
    );
    const apart_m = this.configuration.engine_difference?.peak_tip_m;
    this.apart.textContent =
      apart_m === undefined
        ? ''
        : `Largest tip difference between engines: ${NB.length(apart_m)}. The second is seen only where they differ.`;
    this.showDetails();
    this.showSections();
    this.drawRoom();
    this.drawBudget();
    this.showMotion();
    this.drawGhosts();
  }

  /** The sections below, for this configuration. */
  showSections() {
    const { goal, configuration } = this;
    const { charts } = this.own;
    const name = this.report.scenario.name;
    const budget = NB.sections.budget(goal, configuration, charts, name);
    this.budgetSection.hidden = !budget;
    NB.clear(this.budget, budget || []);
    NB.clear(this.likely, NB.sections.probability(goal, configuration) || []);
    NB.clear(this.margins, NB.sections.margins(configuration));
    NB.clear(this.events, NB.sections.events(this.page, goal, configuration, charts) || []);
  }

  /** @param {MotionRun} run @returns {DecodedRun} */
  decode(run) {
    if (!run.decoded) {
      run.decoded = {
        time: NB.array(run.time),
        joints: run.joints.map(NB.array),
        curveTime: NB.array(run.curveTime),
        curves: Object.entries(run.curves).map(([name, column]) => [
          name,
          NB.array(column).map((value) => value * 1e3),
        ]),
      };
      if (run.nearest)
        run.decoded.nearest = {
          ...run.nearest,
          time: NB.array(run.nearest.time),
          pair: NB.array(run.nearest.pair),
          points: run.nearest.points.map(NB.array),
        };
    }
    return run.decoded;
  }

  showMotion() {
    const { runs } = this.own;
    const choice = this.engineSelect.value;
    const pair = this.pairs[choice === 'both' ? 0 : Number(/^pair (\d+)$/.exec(choice)?.[1])];
    this.shown = pair || (runs[Number(choice)] && choice !== '' ? [runs[Number(choice)]] : []);
    const has = this.shown.length > 0;
    for (const control of [this.playButton, this.slider, this.engineSelect]) control.disabled = !has;
    this.other.show(this.shown.length > 1);
    const curves = this.shown.flatMap((run, at) => {
      const { curveTime, curves: found } = this.decode(run);
      return found.map(([name, y]) => ({
        name,
        x: curveTime,
        y,
        ...NB.styleOf(name),
        width: at ? 4 : 1.8,
        color: at ? `${NB.styleOf(name).color}55` : NB.styleOf(name).color,
      }));
    });
    this.end = has ? Math.max(...this.shown.map((run) => this.decode(run).time.at(-1) ?? 0)) : 1;
    const tints = ['#f1f4f7', '#e6ecf2'];
    const bands = has
      ? this.configuration.motion.map((phase, at) => ({
          from: phase.start_s,
          to: Math.min(phase.end_s, this.end),
          text: phase.phase,
          color: tints[at % 2],
        }))
      : [];
    this.slider.max = String(this.end);
    this.curves.set(curves, bands, [0, this.end]);
    this.seek(has ? this.end : 0);
  }

  /**
   * Poses the arms at a time of the motion, or in the final posture where there is none.
   * @param {number} time
   */
  seek(time) {
    this.explore.leave();
    this.time = time;
    this.slider.value = String(time);
    const { configuration } = this;
    const chain = this.page.scene.chain;
    if (this.shown.length) {
      const phase = configuration.motion.find((each) => time <= each.end_s) || configuration.motion.at(-1);
      this.clock.textContent = `${time.toFixed(2)} of ${this.end.toFixed(2)} s \u00b7 ${phase ? phase.phase : ''}`;
      this.slider.setAttribute('aria-valuetext', this.clock.textContent);
      this.shown.forEach((run, at) => {
        const { time: times, joints } = this.decode(run);
        const q = joints.map((column) => NB.at(times, column, time));
        (at ? this.other : this.arm).pose(this.page.realChain, q);
        if (!at) this.joints = q;
      });
      this.arm.show(true);
    } else {
      this.clock.textContent = configuration.joints_rad ? 'final posture, no motion' : 'no posture';
      this.arm.show(Boolean(configuration.joints_rad));
      if (configuration.joints_rad) this.arm.pose(chain, configuration.joints_rad);
      this.joints = configuration.joints_rad;
    }
    this.curves.seek(this.shown.length ? time : null);
    if (this.pinned && this.pinned.time_s !== null && Math.abs(this.pinned.time_s - time) > 1e-9) this.pinned = null;
    this.drawWitness();
    if (!this.playing) this.toAddress();
  }

  play() {
    if (!this.shown.length) return;
    if (this.time >= this.end - 1e-3) this.seek(0);
    this.playing = true;
    this.playButton.textContent = '\u275a\u275a Pause';
    let last = performance.now();
    /** @param {number} now */
    const step = (now) => {
      if (!this.playing) return;
      const time = Math.min(this.time + ((now - last) / 1e3) * this.speed, this.end);
      last = now;
      this.seek(time);
      if (time >= this.end) this.pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.explore.leave();
    if (this.playing) {
      this.playing = false;
      this.toAddress();
    }
    if (this.playButton) this.playButton.textContent = '\u25b6 Play';
  }

  applyLayers() {
    for (const [name, on] of Object.entries(this.layers)) {
      if (['robot', 'tool', 'collision', 'corridor'].includes(name)) {
        for (const arm of [this.arm, this.other]) arm.layer(name, on);
      } else this.view.show(name, on);
    }
    this.view.group('robot').visible = this.layers.robot;
    this.explore.applyLayers();
    this.view.draw();
  }

  /** Postures of other configurations, each in its colour and with its name. */
  drawGhosts() {
    /** @param {string} hex */
    const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
    this.view.empty('ghost labels');
    this.ghostArms.forEach((ghost, index) => {
      const configuration = this.goal.configurations[index];
      const joints = configuration?.joints_rad;
      const on = this.ghosts.has(index) && joints ? joints : null;
      const color = NB.ghostColors[index];
      if (on && !ghost.arm) ghost.arm = this.view.arm(ghost.name, { color: rgb(color), opacity: 0.45 });
      if (!ghost.arm) return;
      ghost.arm.show(Boolean(on));
      if (!on) return;
      ghost.arm.pose(this.page.scene.chain, on);
      if (!this.view.works) return;
      // Beside the wrist, where those that share an elbow are apart.
      const at = NB.forward(this.page.scene.chain, on)[3].elements.slice(12, 15);
      const label = this.view.label('ghost labels', configuration.label, at);
      if (label) label.style.borderLeft = `6px solid ${color}`;
    });
    this.view.draw();
  }

  /**
   * The closest pair at a time of the motion that is shown, or in the final posture; null where none is known.
   * @param {number} time
   * @returns {Nearest | null}
   */
  nearestAt(time) {
    const run = this.shown[0];
    if (!run) return this.leastOf(this.configuration);
    const { curveTime, curves } = this.decode(run);
    const { nearest } = this.decode(run.nearest ? run : this.own.runs[0]);
    if (!nearest) return null;
    let after = nearest.time.findIndex((each) => each >= time);
    if (after < 0) after = nearest.time.length - 1;
    const before = Math.max(after - 1, 0);
    const share = after > before ? (time - nearest.time[before]) / (nearest.time[after] - nearest.time[before]) : 0;
    const at = share < 0.5 ? before : after;
    const pair = nearest.pair[at];
    if (pair === undefined || pair === 255) return null;
    // Between two samples of one pair its points move steadily; of two pairs the nearer sample's is shown.
    const same = nearest.pair[before] === nearest.pair[after];
    /** @param {number} axis */
    const point = (axis) =>
      same
        ? nearest.points[axis][before] + share * (nearest.points[axis][after] - nearest.points[axis][before])
        : nearest.points[axis][at];
    const name = nearest.classes[pair];
    const curve = curves.find(([each]) => each === name);
    if (!curve) return null;
    return {
      name,
      pair: nearest.names[pair],
      time_s: time,
      minimum_m: NB.at(curveTime, curve[1], time) / 1e3,
      witness_points_m: [[0, 1, 2].map(point), [3, 4, 5].map(point)],
    };
  }

  /**
   * The clearance over the whole motion: the least distance of arm and tool from the surroundings.
   * @param {ConfigurationReport} configuration
   * @returns {Nearest | null}
   */
  leastOf(configuration) {
    return NB.leastAround(this.page, configuration.clearance);
  }

  /** The closest pair at the time that is shown; a row of the table pins the minimum of its class, at its time. */
  drawWitness() {
    const view = this.view;
    view.empty('witness');
    const found = this.pinned || this.nearestAt(this.time);
    /** @param {{ pair: string[] }} each */
    const pairWords = (each) => [...new Set(each.pair.map(NB.words))].join(' to ');
    if (found && view.works) {
      const color = new THREE.Color(NB.styleOf(found.name).color);
      const rgba = [color.r, color.g, color.b]
        .map((c) => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055))
        .concat(1);
      const [a, b] = found.witness_points_m;
      view.rod('witness', a, b, 0.002, rgba, true);
      for (const end of [a, b]) view.ball('witness', end, 0.005, rgba, true);
      const when = !this.shown.length || found.time_s === null ? '' : ` at ${found.time_s.toFixed(2)} s`;
      const what = this.pinned ? `minimum, ${NB.words(found.name)}` : pairWords(found);
      view.label(
        'witness',
        `${what}: ${NB.mm(found.minimum_m)} mm${when}`,
        a.map((value, k) => (value + b[k]) / 2),
      );
    }
    this.sayNearest(this.pinned ? this.nearestAt(this.time) : found, pairWords);
    view.draw();
  }

  /** @param {Nearest | null} found @param {(each: { pair: string[] }) => string} pairWords */
  sayNearest(found, pairWords) {
    const least = this.leastOf(this.configuration);
    const now =
      found &&
      NB.el('p', {
        text:
          `Closest pair ${this.shown.length ? `at ${this.time.toFixed(2)} s` : 'in the final posture'}: ` +
          `${pairWords(found)}, ${NB.mm(found.minimum_m)} mm.`,
      });
    const all =
      least &&
      this.shown.length &&
      NB.el(
        'p',
        null,
        `Clearance over the whole motion: ${pairWords(least)}, ${NB.mm(least.minimum_m)} ` +
          `mm${least.time_s === null ? '. ' : ` at ${least.time_s.toFixed(2)} s. `}`,
        least.time_s === null
          ? null
          : NB.el(
              'button',
              {
                type: 'button',
                class: 'no-print save',
                onclick: () => {
                  this.pause();
                  this.seek(Math.min(least.time_s ?? this.end, this.end));
                },
              },
              'Go there',
            ),
      );
    const own = this.configuration.clearance.self;
    if (all && own) all.append(`Self-clearance (inherent): ${pairWords(own)}, ${NB.mm(own.minimum_m)} mm. `);
    if (this.playing && this.now.firstChild && now) {
      // The button stays where it is.
      this.now.firstChild.replaceWith(now);
      return;
    }
    NB.clear(this.now, now || '', all || '');
  }

  drawPeople() {
    const view = this.view;
    view.empty('space');
    const { people, sector } = this.extra.room;
    view.people(people);
    if (sector && view.works) {
      const half = new THREE.Mesh(NB.cone(Math.PI / 2, sector.radius), view.material([0, 0.62, 0.45, 0.16]));
      half.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, -1), new THREE.Vector3().fromArray(sector.outwards));
      half.position.fromArray(sector.center);
      half.renderOrder = 18;
      view.add('space', half);
    }
  }

  /** Lines of sight, occupied space and hand cone of the configuration. */
  drawRoom() {
    const view = this.view;
    view.empty('taken');
    view.sight([]);
    view.empty('cone');
    const { room } = this.own;
    const measured = this.configuration.room;
    if (room && measured && view.works) {
      view.sight(NB.array(room.sight));
      if (room.taken) view.add('taken', view.surface(room.taken, [0.84, 0.37, 0, 0.35]));
      view.handCone(room.guideEntry, measured.hand_cone_half_angle_rad, measured.hand_cone_length_m);
    }
    // It belongs to a layer with other things in it.
    view.group('space').add(view.group('taken'));
    view.draw();
  }

  /** Ellipsoids that hold 95 % of a normal distribution: 2.7955 standard deviations. */
  drawBudget() {
    const view = this.view;
    view.empty('ellipsoids');
    const total = this.configuration.budget?.total;
    if (total && view.works) {
      const turn = new THREE.Matrix4().makeRotationFromQuaternion(
        new THREE.Quaternion().fromArray(this.extra.guideExit, 3),
      );
      for (const { where, at, color, moments } of [
        { where: 'target', at: this.goal.target_m, color: [0, 0.45, 0.7, 0.55], moments: total.at_target.analytic },
        { where: 'skin', at: this.goal.entry_m, color: [0.84, 0.37, 0, 0.55], moments: total.at_skin?.analytic },
      ]) {
        if (!at || !moments) continue;
        const spread = NB.cholesky(moments.covariance_m2);
        const scale = 2.7955 * this.magnify;
        const columns = [0, 1, 2].map((k) =>
          new THREE.Vector3(spread[0][k], spread[1][k], spread[2][k])
            .applyMatrix4(turn)
            .multiplyScalar(scale)
            .toArray(),
        );
        const bias = new THREE.Vector3().fromArray(moments.bias_m).applyMatrix4(turn).multiplyScalar(this.magnify);
        const center = at.map((value, k) => value + bias.getComponent(k));
        view.ellipsoid('ellipsoids', center, columns, color);
        view.label(
          'ellipsoids',
          `${this.magnify === 1 ? '' : `\u00d7 ${this.magnify}: `}95 % at ${where}, longest semi-axis ` +
            `${NB.mm(2.7955 * NB.longest(moments.covariance_m2), 1)} mm`,
          center,
        );
      }
    }
    view.draw();
  }

  /** @param {ConfigurationReport} configuration */
  status(configuration) {
    const recommended = this.goal.recommended?.label === configuration.label;
    const words = {
      ok: ['good', '\u2713 feasible'],
      failed: ['bad', '\u2717 failed'],
      rejected: ['off', '\u2013 rejected'],
    };
    const missed = this.report.criteria.some(
      (each) =>
        !each.pass &&
        each.criterion !== 'expected' &&
        each.goal === this.goal.name &&
        each.label === configuration.label,
    );
    const open = configuration.not_judged > 0 && !missed;
    const isExpected =
      configuration.status === 'failed' &&
      this.page.missedAsExpected.some(
        (index) =>
          this.report.criteria[index].goal === this.goal.name &&
          this.report.criteria[index].label === configuration.label,
      );
    const [style, text] = open
      ? ['bad', '? incomplete']
      : isExpected
        ? ['off', '\u2717 failed, as expected']
        : words[configuration.status];
    return [
      NB.el('span', { class: style, text }),
      recommended ? NB.el('span', { class: 'good', text: ' \u2605', title: 'recommended' }) : '',
    ];
  }

  sideTable() {
    /** @type {Column<ConfigurationReport>[]} */
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      {
        title: 'Ghost',
        help: 'also show this posture',
        cell: (c) =>
          NB.el(
            'span',
            { class: 'pick' },
            NB.el('input', {
              type: 'checkbox',
              'aria-label': `ghost of ${c.label}`,
              checked: this.ghosts.has(this.goal.configurations.indexOf(c)),
              disabled: !c.joints_rad,
              onclick: (event) => event.stopPropagation(),
              onchange: (event) => {
                const at = this.goal.configurations.indexOf(c);
                if (event.target.checked) this.ghosts.add(at);
                else this.ghosts.delete(at);
                this.drawGhosts();
              },
            }),
            NB.swatch(NB.ghostColors[this.goal.configurations.indexOf(c)]),
          ),
      },
      { title: 'Status', cell: (c) => this.status(c) },
      ...NB.metricColumns(this.extra.columns.side),
    ];
    const table = NB.table('Choose a configuration (\u2605 recommended)', columns, this.goal.configurations, {
      class: 'choose small full',
    });
    this.sideRows = NB.tableRows(table);
    NB.rows(this.sideRows, (index) => this.setConfiguration(index));
    const all = NB.el(
      'button',
      {
        type: 'button',
        class: 'no-print',
        onclick: () => {
          const on = this.ghosts.size === 0;
          this.ghosts = new Set(on ? this.goal.configurations.keys() : []);
          this.sideTable();
          NB.mark(this.sideRows, this.configurationIndex);
          this.drawGhosts();
        },
      },
      this.ghosts.size ? 'Hide all ghosts' : 'Show all ghosts',
    );
    NB.clear(this.side, table, all);
  }

  showDetails() {
    const c = this.configuration;
    /** @param {string} before @param {CriterionResult | Rejection} each */
    const item = (before, each) => {
      const [value, limit] = NB.valueAndLimit(each.value, each.limit, each.unit);
      const measured = each.value === null ? '' : `: ${value}, limit ${limit}`;
      const engine = each.engine ? ` (${each.engine})` : '';
      const detail = each.detail ? `. ${each.detail.charAt(0).toUpperCase()}${each.detail.slice(1)}` : '';
      return NB.el('li', { text: `${before}${measured}${engine}${detail}.` });
    };
    const reasons = c.rejections.map((each) => item(`Rejected, ${NB.words(each.rule)}`, each));
    const failed = this.report.criteria
      .filter((each) => !each.pass && each.goal === this.goal.name && each.label === c.label)
      .map((each) => item(`Failed, ${NB.criterionWords(each.criterion)}`, each));
    const classes = NB.byClass(c.clearance);
    /** @type {Column<[name: string, found: ClassMinimum]>[]} */
    const columns = [
      { title: 'Class', cell: ([name]) => [NB.sample(NB.styleOf(name)), ` ${NB.words(name)}`] },
      { title: 'Minimum', unit: 'mm', numeric: true, cell: ([, found]) => NB.mm(found.minimum_m) },
      {
        title: 'Pair and time',
        cell: ([, found]) =>
          `${[...new Set(found.pair.map(NB.words))].join(' to ')}, ` +
          `${NB.words(found.phase)}${found.time_s === null ? '' : ` ${found.time_s.toFixed(2)} s`}`,
      },
    ];
    const caption = this.own.runs.length
      ? 'Minimum by class over the whole motion; a row shows where and when'
      : 'Minimum by class in the final posture; a row shows where';
    const table = NB.table(caption, columns, classes, { class: 'choose small full' });
    const rows = NB.tableRows(table);
    NB.rows(rows, (index) => {
      const [name, found] = classes[index];
      NB.mark(rows, index);
      this.pause();
      if (found.time_s !== null && this.shown.length) this.seek(Math.min(found.time_s, this.end));
      this.pinned = { name, ...found, time_s: found.time_s === null ? null : this.time };
      this.drawWitness();
    });
    NB.mark(rows, -1);
    if (rows[0]) rows[0].tabIndex = 0;
    NB.clear(
      this.details,
      NB.el('h3', { text: c.label }),
      NB.el(
        'p',
        { class: 'small' },
        c.joints_rad
          ? `Joints ${c.joints_rad.map((q) => `${NB.deg(q)}\u00b0`).join(', ')}; roll about the needle ` +
              `${NB.deg(c.roll_rad)}\u00b0`
          : 'No posture.',
      ),
      reasons.length || failed.length ? NB.el('ul', { class: 'plain small' }, reasons, failed) : null,
      classes.length ? table : null,
    );
  }

  configurationTable() {
    /** @type {Column<ConfigurationReport>[]} */
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      { title: 'Status', cell: (c) => this.status(c) },
      { title: 'Rank', numeric: true, cell: (c) => (c.ranking ? String(c.ranking.rank) : '\u2013') },
      {
        title: 'Pareto set',
        cell: (c) => (c.pareto ? 'yes' : c.dominated_by ? `no: dominated by ${c.dominated_by.label}` : ''),
        help: 'yes: no other feasible configuration is as good in everything and better in something',
      },
      { title: 'Score', unit: 'of 100', numeric: true, cell: (c) => NB.fixed(c.ranking && 100 * c.ranking.score, 1) },
      {
        title: 'First rejection',
        text: true,
        cell: (c) => (c.rejections[0] ? `${NB.words(c.rejections[0].rule)}: ${c.rejections[0].detail}` : ''),
      },
      ...NB.metricColumns(this.extra.columns.table),
    ];
    const table = NB.table(
      `${NB.words(this.goal.name)}: clearances are minima over the recorded motions of all engines; certified ones ` +
        'also hold between samples',
      columns,
      this.goal.configurations,
      { class: 'choose small' },
    );
    this.tableRows = NB.tableRows(table);
    NB.rows(this.tableRows, (index) => this.setConfiguration(index));
    const ranking = this.extra.charts.ranking;
    NB.clear(
      this.table,
      table,
      ranking
        ? NB.el(
            'details',
            { class: 'no-print' },
            NB.el('summary', { text: 'Score breakdown' }),
            NB.chart(
              `${NB.words(this.goal.name)}: ranking`,
              ranking,
              NB.fileName(this.report.scenario.name, this.goal.name, 'ranking'),
            ),
          )
        : null,
    );
  }
}

/** Largest standard deviation of a covariance in any direction, by its powers. */
NB.longest = (covariance) => {
  let v = [1, 1, 1];
  let size = 0;
  for (let k = 0; k < 200; k++) {
    const next = covariance.map((row) => row.reduce((sum, each, at) => sum + each * v[at], 0));
    size = Math.hypot(...next);
    if (!size) return 0;
    v = next.map((each) => each / size);
  }
  return Math.sqrt(size);
};

/** Lower triangle of a covariance, `L L^T`; what rounding makes negative counts as zero. */
NB.cholesky = (a) => {
  const l = [
    [0, 0, 0],
    [0, 0, 0],
    [0, 0, 0],
  ];
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j <= i; j++) {
      let sum = a[i][j];
      for (let k = 0; k < j; k++) sum -= l[i][k] * l[j][k];
      if (i === j) l[i][j] = Math.sqrt(Math.max(sum, 0));
      else l[i][j] = l[j][j] > 0 ? sum / l[j][j] : 0;
    }
  }
  return l;
};

NB.start((page, app) => {
  NB.current = new RunPage(page, app);
});

// The planner: what is chosen, what is shown of it, and what is saved.
'use strict';

PLAN.WINDOWS = { lung: [-1350, 150], soft: [-160, 240], bone: [-500, 1300] };
PLAN.WINDOW_NAMES = { lung: 'Lung (\u2212600/1500)', soft: 'Soft (40/400)', bone: 'Bone (400/1800)' };

class Planner {
  // Set as soon as there is a planner.
  /** @type {Volume} */ volume;
  /** @type {Uint16Array | undefined} */ labels;
  /** @type {Map<number, number>} */ labelColors;
  /** @type {boolean | undefined} */ showsLabels;
  /** @type {PlaceAnswer} */ place;
  /** @type {RouteAnswer | null} */ route;
  /** @type {ReachAnswer | null} */ reach;
  /** @type {Refusal | null} */ refused;
  /** @type {(MotionAnswer & { refused?: undefined }) | { refused: Refusal } | null} */ motion;
  /** @type {TipError | null} */ tip;
  /** @type {object} */ comparing;
  /** @type {string | null} */ complaint;
  /** @type {ReturnType<typeof setTimeout> | undefined} */ keeping;
  /** @type {boolean | undefined} */ dragging;
  /** @type {boolean | undefined} */ conflict;
  /** @type {boolean | undefined} */ writing;
  /** @type {boolean | undefined} */ again;
  // The page.
  /** @type {Room} */ room;
  /** @type {Slice[]} */ slices;
  /** @type {Probe[]} */ probes;
  /** @type {{ [name: string]: HTMLButtonElement }} */ tools;
  /** @type {{ [name: string]: HTMLButtonElement }} */ windows;
  /** @type {Map<string, Labelled<HTMLInputElement>>} */ markerBoxes;
  /** @type {Labelled<HTMLSelectElement> | undefined} */ goalSelect;
  /** @type {Labelled<HTMLInputElement>} */ labelsBox;
  /** @type {HTMLInputElement} */ planName;
  /** @type {HTMLInputElement} */ routeName;
  /** @type {HTMLTextAreaElement} */ notes;
  /** @type {HTMLButtonElement} */ undoButton;
  /** @type {HTMLButtonElement} */ redoButton;
  /** @type {HTMLButtonElement} */ saveButton;
  /** @type {HTMLButtonElement} */ playButton;
  /** @type {HTMLElement} */ status;
  /** @type {HTMLElement} */ banner;
  /** @type {HTMLElement} */ readout;
  /** @type {HTMLElement} */ numbers;
  /** @type {HTMLElement} */ configurations;
  /** @type {HTMLElement} */ comparison;
  /** @type {HTMLElement} */ labelLegend;
  /** @type {HTMLElement} */ kept;
  /** @type {HTMLElement} */ targetText;
  /** @type {HTMLElement} */ entryText;
  /** @type {HTMLElement} */ saved;
  /** @type {HTMLElement} */ clock;
  /** @type {HTMLElement} */ notesOnPaper;
  /** @type {HTMLElement} */ printed;

  /** @param {CaseFacts} facts @param {Session} session @param {PlanDocument} page @param {HTMLElement} app */
  constructor(facts, session, page, app) {
    this.facts = facts;
    this.page = page;
    this.app = app;
    this.version = session.version;
    /** @type {Undoable[]} */
    this.undone = [];
    /** @type {Undoable[]} */
    this.done = [];
    this.tool = 'crosshair';
    /** @type {{ target: Index | null, entry: Index | null }} */
    this.shown = { target: null, entry: null };
    this.probe = { turn: 0, depth: 0, set: false };
    const middle = facts.size.map((count) => Math.floor(count / 2));
    /** @type {PlanState} */
    this.state = {
      notes: '',
      window_hu: PLAN.WINDOWS.lung,
      crosshair: middle,
      hidden_markers: [],
      needle: {},
      routes: [],
      ...Object.fromEntries(Object.entries(PLAN.taken(session)).filter(([, value]) => value !== null)),
    };
    if (session.version === 0) this.state.needle = this.firstNeedle();
    this.greys = PLAN.greys(this.state.window_hu);
    this.quick = new Latest('route', (answer, body, took) => this.routed(answer, body, took));
    this.bounds = new Latest('reach', (answer, body, took) => this.bounded(answer, body, took));
    this.exact = new Latest('reach', (answer) => this.reached(answer));
    this.entryMap = new EntryMap(this);
    this.planned = new Latest('motion', (answer, body) => this.moved(answer, body));
    this.people = new People(this);
    this.simulation = new Simulation(this);
    this.where = new Latest('place', (answer) => this.placed(answer));
    /** @type {number[]} */
    this.latencies = [];
    /** @type {number[]} */
    this.reachWaits = [];
    this.build();
  }

  /**
   * The scenario's own first goal.
   * @returns {NeedleChoice}
   */
  firstNeedle() {
    const goal = this.facts.goals[0];
    if (!goal) return this.facts.lesions[0] ? { target: { lesion: this.facts.lesions[0].name } } : {};
    /** @type {NeedleChoice} */
    const needle = { goal: goal.name };
    if (goal.lesion) needle.target = { lesion: goal.lesion };
    else if (goal.target_m) needle.target = { place_m: goal.target_m };
    if (goal.entry_m) needle.entry = { place_m: goal.entry_m };
    return needle;
  }

  /** @param {Index} index */
  within(index) {
    return index.map((value, axis) => Math.min(Math.max(value, 0), this.facts.size[axis] - 1));
  }

  /** @param {Point} place */
  indexOf(place) {
    return place.map((metres, axis) => (metres - this.facts.first_voxel_m[axis]) / this.facts.spacing_m[axis]);
  }

  // ---- the page

  build() {
    this.status = NB.el('p', { class: 'status', role: 'status', 'aria-live': 'polite' });
    this.banner = NB.el('div', { class: 'banner', role: 'alert' });
    this.slices = Object.values(PLAN.PLANES).map((plane) => new Slice(plane, this));
    this.probes = [new Probe('along', this), new Probe('across', this)];
    this.readout = NB.el('p', { class: 'readout', role: 'status', 'aria-live': 'polite' });
    this.room = new Room(this.page, this.facts);
    const heading = NB.el(
      'header',
      { class: 'top' },
      NB.el('h1', { text: `Plan: ${this.facts.name}` }),
      NB.el(
        'p',
        null,
        'Research software: ',
        NB.el('strong', { text: 'not a medical device.' }),
        ' Radiological convention: the patient\u2019s right is on the left of the image.',
      ),
    );
    const panes = NB.el(
      'div',
      { class: 'panes' },
      this.slices.map((slice) => slice.element),
      NB.el(
        'figure',
        { class: 'slice' },
        this.room.view.element,
        NB.el(
          'figcaption',
          null,
          NB.el('span', { class: 'slice-title', text: 'Room' }),
          NB.el('span', { class: 'no-print' }, this.people.boxes),
          this.playButtons(),
        ),
      ),
      this.probes.map((probe) => probe.element),
    );
    this.numbers = NB.el('div');
    this.configurations = NB.el('div');
    this.comparison = NB.el('div');
    const side = NB.el(
      'aside',
      { class: 'side', 'aria-label': 'Plan' },
      this.needlePanel(),
      this.entryMap.element,
      NB.el('section', { class: 'panel' }, NB.el('h2', { text: 'Needle' }), this.numbers),
      NB.el(
        'section',
        { class: 'panel' },
        NB.el('h2', { text: 'Configurations' }),
        this.configurations,
        this.people.text,
      ),
      this.routesPanel(),
      this.markersPanel(),
      this.notesPanel(),
      this.simulation.element,
    );
    NB.clear(
      this.app,
      heading,
      this.banner,
      this.toolbar(),
      NB.el('div', { class: 'planner' }, NB.el('div', { class: 'pictures' }, panes, this.readout), side),
      this.signature(),
    );
    this.showTool();
    this.showWindow();
    this.showMarkers();
    this.showRoutes();
    this.needleChanged();
    this.look(this.state.crosshair, false);
    window.addEventListener('keydown', (event) => this.key(event));
    window.addEventListener('beforeprint', () => {
      this.printed.textContent = new Date().toLocaleString();
    });
  }

  toolbar() {
    this.tools = Object.fromEntries(
      Object.entries({ crosshair: 'Move crosshair', target: 'Set target', entry: 'Set entry' }).map(([name, words]) => [
        name,
        NB.el(
          'button',
          {
            type: 'button',
            role: 'radio',
            'aria-checked': 'false',
            onclick: () => {
              this.tool = name;
              this.showTool();
            },
          },
          words,
        ),
      ]),
    );
    this.windows = Object.fromEntries(
      Object.entries(PLAN.WINDOW_NAMES).map(([name, words]) => [
        name,
        NB.el(
          'button',
          {
            type: 'button',
            role: 'radio',
            'aria-checked': 'false',
            onclick: () => this.setWindow(PLAN.WINDOWS[name]),
          },
          words,
        ),
      ]),
    );
    this.undoButton = NB.el('button', { type: 'button', onclick: () => this.undo(), title: 'Ctrl+Z' }, 'Undo');
    this.redoButton = NB.el('button', { type: 'button', onclick: () => this.redo(), title: 'Ctrl+Shift+Z' }, 'Redo');
    this.labelsBox = NB.checkbox('Label outlines', false, (checked) => this.showLabels(checked));
    this.labelLegend = NB.el('span', { class: 'entry-legend' });
    this.kept = NB.el('span', { class: 'soft', role: 'status' });
    return NB.el(
      'div',
      { class: 'bar no-print' },
      NB.el('div', { class: 'tabs', role: 'radiogroup', 'aria-label': 'Click action' }, Object.values(this.tools)),
      NB.el(
        'div',
        { class: 'tabs', role: 'radiogroup', 'aria-label': 'Window: centre and width, HU' },
        Object.values(this.windows),
      ),
      NB.el(
        'div',
        { class: 'tabs' },
        this.undoButton,
        this.redoButton,
        NB.el('button', { type: 'button', onclick: () => window.print() }, 'Print'),
      ),
      this.labelsBox,
      this.labelLegend,
      this.kept,
    );
  }

  showTool() {
    for (const [name, button] of Object.entries(this.tools))
      button.setAttribute('aria-checked', String(name === this.tool));
  }

  showWindow() {
    for (const [name, button] of Object.entries(this.windows))
      button.setAttribute('aria-checked', String(String(PLAN.WINDOWS[name]) === String(this.state.window_hu)));
  }

  /**
   * Outlines of the labels of the voxels; the labels are loaded when they are first shown.
   * @param {boolean} wanted
   */
  async showLabels(wanted) {
    this.showsLabels = wanted;
    const { labels } = this.facts;
    const { sky, green, orange, purple, yellow, vermillion, blue, grey } = NB.palette;
    const palette = [sky, green, orange, purple, yellow, vermillion, blue, grey];
    /** @param {number} at */
    const color = (at) => palette[at % palette.length];
    if (wanted && !this.labels) {
      this.labelLegend.textContent = 'Loading labels ...';
      try {
        const [n, m, l] = this.facts.size;
        this.labels = new Uint16Array(
          (
            await PLAN.bytes('labels', 2 * n * m * l, (share) => {
              this.labelLegend.textContent = `Loading labels: ${Math.round(100 * share)} %`;
            })
          ).buffer,
        );
      } catch (error) {
        this.complain(error);
        this.labelsBox.control.checked = false;
        NB.clear(this.labelLegend);
        return;
      }
      this.labelColors = new Map(
        labels.map(({ label }, at) => {
          const [red, green, blue] = [1, 3, 5].map((from) => parseInt(color(at).slice(from, from + 2), 16));
          return [label, (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0];
        }),
      );
    }
    NB.clear(
      this.labelLegend,
      this.showsLabels ? labels.map(({ name }, at) => PLAN.swatch(color(at), NB.words(name))) : [],
    );
    this.draw();
  }

  /** @param {number[]} window_hu */
  setWindow(window_hu) {
    this.state.window_hu = window_hu;
    this.greys = PLAN.greys(window_hu);
    this.showWindow();
    this.draw();
    this.keepSoon();
  }

  needlePanel() {
    this.targetText = NB.el('dd');
    this.entryText = NB.el('dd');
    const lesions = this.facts.lesions.map((lesion) =>
      NB.el(
        'button',
        {
          type: 'button',
          onclick: () => {
            this.change({ target: { lesion: lesion.name } });
            this.look(this.within(lesion.index.map(Math.round)));
          },
        },
        `Target: ${NB.words(lesion.name)}`,
      ),
    );
    if (this.facts.goals.length > 1) {
      this.goalSelect = NB.select(
        'Goal of the scenario',
        this.facts.goals.map(({ name }) => [name, NB.words(name)]),
        this.state.needle.goal ?? '',
        (goal) => this.change({ goal }),
      );
    }
    this.planName = NB.el('input', {
      type: 'text',
      value: this.facts.plan_file,
      size: '18',
      'aria-label': 'File name of the plan',
      maxlength: '64',
      spellcheck: 'false',
    });
    this.saveButton = NB.el('button', { type: 'button', onclick: () => this.savePlan() }, 'Save plan');
    this.saved = NB.el('p', { class: 'soft', role: 'status' });
    return NB.el(
      'section',
      { class: 'panel' },
      NB.el('h2', { text: 'Target and entry' }),
      this.goalSelect,
      NB.el(
        'div',
        { class: 'tabs no-print' },
        lesions,
        NB.el(
          'button',
          { type: 'button', onclick: () => this.put('target', this.state.crosshair) },
          'Set target at crosshair (T)',
        ),
        NB.el(
          'button',
          { type: 'button', onclick: () => this.put('entry', this.state.crosshair) },
          'Set entry at crosshair (E)',
        ),
      ),
      NB.el(
        'dl',
        null,
        NB.el('dt', { text: 'Target' }),
        this.targetText,
        NB.el('dt', { text: 'Entry' }),
        this.entryText,
      ),
      NB.el(
        'p',
        { class: 'soft' },
        'Scan coordinates in mm: left, posterior, superior (LPS). The entry is the point where the line from the ' +
          'target through the clicked point leaves the skin.',
      ),
      NB.el('div', { class: 'bar no-print' }, this.planName, this.saveButton),
      this.saved,
    );
  }

  // ---- the crosshair

  /**
   * Moves the crosshair to a voxel.
   * @param {Index} index
   * @param {boolean} [keep]
   */
  look(index, keep = true) {
    this.state.crosshair = index;
    this.where.ask({ index });
    this.draw();
    if (keep) this.keepSoon();
  }

  /** @param {number} axis @param {number} by */
  step(axis, by) {
    if (!this.volume) return;
    const index = this.state.crosshair.slice();
    index[axis] += by;
    this.look(this.within(index));
  }

  /** @param {Answered<PlaceAnswer>} answer */
  placed(answer) {
    if (answer.problem) this.complain(answer.problem);
    if (answer.refused) return;
    const [x, y, z] = answer.ct_mm;
    const names = [x < 0 ? 'right' : 'left', y < 0 ? 'anterior' : 'posterior', z < 0 ? 'inferior' : 'superior'];
    const place = [x, y, z].map((value) => NB.fixed(value, 2)).join(', ');
    this.place = answer;
    this.readout.textContent =
      `Crosshair: voxel ${this.state.crosshair.join(', ')}; (${place}) mm LPS (${names.join(', ')} of the ` +
      `scan origin); ${NB.minus(String(answer.hu))} HU; ` +
      `${answer.label ? NB.words(answer.label) : 'outside the body'}`;
  }

  // ---- the needle

  /** @param {string} what @param {Index} index */
  put(what, index) {
    if (!this.volume) return;
    this.change({ [what]: { index: index.slice() } });
    this.tool = 'crosshair';
    this.showTool();
    this.look(this.within(index.map(Math.round)));
  }

  /** @param {NeedleChoice} needle */
  change(needle) {
    this.remember();
    this.state.needle = { ...this.state.needle, ...needle };
    this.needleChanged();
    this.keepSoon();
  }

  beginDrag() {
    this.remember();
    this.dragging = true;
    this.latencies = [];
    this.reachWaits = [];
  }

  /** @param {'target' | 'entry'} what @param {Index} index */
  drag(what, index) {
    this.state.needle = { ...this.state.needle, [what]: { index } };
    this.shown = { ...this.shown, [what]: index };
    this.draw();
    this.askRoute();
  }

  endDrag() {
    this.dragging = false;
    this.needleChanged();
    this.keepSoon();
  }

  /** @returns {NeedleAim | null} */
  aim() {
    const { goal, target, entry } = this.state.needle;
    return target && entry ? { goal, target, entry } : null;
  }

  /** @param {PlaceAim | null | undefined} aim */
  pointOf(aim) {
    if (!aim) return null;
    if (aim.index) return aim.index;
    if (aim.place_m) return this.indexOf(aim.place_m);
    return this.facts.lesions.find((lesion) => lesion.name === aim.lesion)?.index || null;
  }

  needleChanged() {
    const { target, entry } = this.state.needle;
    this.shown = { target: this.pointOf(target), entry: this.pointOf(entry) };
    this.motion = null;
    this.tip = null;
    this.planned.forget();
    this.people.forget();
    this.room.stop();
    if (this.goalSelect) this.goalSelect.control.value = this.state.needle.goal || this.facts.goals[0].name;
    if (this.aim()) this.askRoute();
    else {
      this.route = null;
      this.reach = null;
      this.refused = null;
      this.showRoute();
      this.showReach();
    }
    this.entryMap.needleChanged();
    this.showUndo();
    this.draw();
  }

  /** Numbers and configurations at once: neither waits for the other. */
  askRoute() {
    const aim = this.aim();
    if (!aim) return;
    this.exact.forget();
    this.quick.ask({ aim });
    // Few directions about the needle; all of them, which takes longer, once the needle rests.
    if (!this.facts.robot_is_unknown) this.bounds.ask({ aim, quick: true });
  }

  /** @param {Answered<RouteAnswer>} answer @param {object} _ @param {number} took */
  routed(answer, _, took) {
    if (this.dragging) this.latencies.push(took);
    if (!this.aim()) return;
    if (answer.problem) this.complain(answer.problem);
    this.refused = answer.refused || null;
    this.route = answer.refused ? null : answer;
    if (this.route && !this.dragging) this.shown = { target: this.route.target_index, entry: this.route.entry_index };
    if (this.route)
      this.probe.depth = Math.min(this.probe.depth || 1e3 * this.route.length_m, 1e3 * this.route.length_m);
    if (this.route && !this.probe.set) {
      this.probe.depth = 1e3 * this.route.length_m;
    }
    this.tip = null;
    this.motion = null;
    this.people.forget();
    this.showRoute();
    this.draw();
    this.entryMap.draw();
    if (!this.route || this.route.not_placed) {
      this.bounds.forget();
      this.exact.forget();
      this.reach = null;
      this.showReach();
    }
  }

  /** @param {Answered<ReachAnswer>} answer @param {Questions['reach'][0]} body @param {number} took */
  bounded(answer, body, took) {
    if (this.dragging) this.reachWaits.push(took);
    this.reached(answer);
    if (!this.dragging && this.aim() && !answer.problem) this.exact.ask({ aim: body.aim });
  }

  /** @param {Answered<ReachAnswer>} answer */
  reached(answer) {
    if (answer.problem) {
      this.complain(answer.problem);
      return;
    }
    this.reach = answer.refused ? null : answer;
    this.showReach();
    const label = this.state.needle.configuration;
    const known = this.reach?.preview?.configurations.find((each) => each.label === label);
    if (known?.joints_rad && !this.dragging) this.room.pose(known.joints_rad);
    const aim = this.aim();
    if (label && !this.dragging && aim && this.reach?.preview && !this.reach.quick)
      this.planned.ask({ aim, configuration: label });
  }

  /** @param {Answered<MotionAnswer>} answer @param {Questions['motion'][0]} body */
  moved(answer, body) {
    if (answer.problem) {
      this.complain(answer.problem);
      return;
    }
    if (body.configuration !== this.state.needle.configuration || this.dragging) return;
    this.motion = answer.refused ? { refused: answer.refused } : answer;
    this.tip = answer.refused ? null : answer.tip;
    this.people.ask(answer.refused ? null : answer.end_joints_rad);
    this.showReach();
    this.draw();
  }

  /** @param {string} configuration */
  choose(configuration) {
    this.remember();
    this.state.needle = { ...this.state.needle, configuration };
    this.motion = null;
    this.tip = null;
    this.people.forget();
    this.room.stop();
    if (this.reach) this.reached(this.reach);
    this.showUndo();
    this.draw();
    this.keepSoon();
  }

  /** @param {'along' | 'across'} kind @param {number} step */
  turnProbe(kind, step) {
    if (!this.route) return;
    this.probe.set = true;
    if (kind === 'along') this.probe.turn = (this.probe.turn + (step * Math.PI) / 36) % (2 * Math.PI);
    else this.probe.depth = Math.min(Math.max(this.probe.depth + step, 0), 1e3 * this.route.length_m);
    this.draw();
  }

  draw() {
    if (!this.volume) return;
    for (const picture of [...this.slices, ...this.probes]) picture.draw();
    // Of a drag the slices follow at once, the room when it ends.
    if (!this.dragging) this.room.needle(this.route);
  }

  // ---- numbers

  /** @param {Point} place */
  millimetres(place) {
    return `(${place.map((metres) => NB.mm(metres, 2)).join(', ')}) mm`;
  }

  showRoute() {
    const { target, entry } = this.state.needle;
    const lesion = this.facts.lesions.find((each) => each.name === target?.lesion);
    this.targetText.textContent = target
      ? [lesion && NB.words(lesion.name), this.route && this.millimetres(this.route.target_m)]
          .filter(Boolean)
          .join(', ')
      : 'not set';
    this.entryText.textContent = entry ? (this.route ? this.millimetres(this.route.entry_m) : '') : 'not set';
    this.saveButton.disabled = !this.route || Boolean(this.route.not_placed);
    this.simulation.allow(!this.saveButton.disabled);
    if (this.refused) {
      NB.clear(
        this.numbers,
        NB.el('p', { class: 'error', text: this.refused.message }),
        this.refused.hint ? NB.el('p', { text: this.refused.hint }) : null,
      );
      return;
    }
    if (!this.route) {
      NB.clear(
        this.numbers,
        NB.el('p', { text: target ? 'Click the entry point on the skin.' : 'Choose a lesion, or click the target.' }),
      );
      return;
    }
    const { not_placed: unplaced } = this.route;
    NB.clear(
      this.numbers,
      this.route.refusal ? NB.el('p', { class: 'error', text: `Needle path rejected: ${this.route.refusal}.` }) : null,
      unplaced
        ? [
            NB.el('p', { class: 'error', text: `${unplaced.message}.` }),
            unplaced.hint ? NB.el('p', { text: `Try ${unplaced.hint}.` }) : null,
          ]
        : null,
      PLAN.routeRows([{ name: 'value', route: this.route }], 'Straight needle path from skin to target'),
      Math.abs(this.route.entry_moved_m) > 5e-3
        ? NB.el('p', {
            text:
              `The chosen point is ${NB.mm(Math.abs(this.route.entry_moved_m))} mm ` +
              `${this.route.entry_moved_m > 0 ? 'inside' : 'outside'} the skin; the entry is on the line from ` +
              'it to the target.',
          })
        : null,
    );
  }

  showReach() {
    if (this.facts.robot_is_unknown) {
      NB.clear(this.configurations, NB.el('p', { text: `Robot not evaluated: ${this.facts.robot_is_unknown}.` }));
      return;
    }
    const { preview, quick, reasons = [] } = this.reach || {};
    if (!preview) {
      NB.clear(this.configurations, NB.el('p', { class: 'soft', text: 'Choose a target and an entry first.' }));
      return;
    }
    const chosen = this.state.needle.configuration;
    const counted = quick
      ? `At least ${preview.working} of 8 feasible (12 roll angles checked, full check running)`
      : `${preview.working} of 8 feasible (postures only)`;
    const { refusal } = this.route || {};
    const list = NB.table(
      counted,
      [
        { title: 'Configuration', cell: ({ each }) => each.label },
        {
          title: refusal ? 'Reachable' : 'Feasible',
          cell: ({ each }) =>
            NB.el('span', {
              class: each.works && !refusal ? 'good' : 'bad',
              text: each.works ? (refusal ? 'reachable, path rejected' : 'yes') : quick ? 'checking' : 'no',
            }),
        },
        { title: 'Closest pair', unit: 'mm', numeric: true, cell: ({ each }) => NB.mm(each.nearest?.distance_m) },
        {
          title: 'Pair or reason',
          text: true,
          cell: ({ each, reason }) => (each.works ? (each.nearest?.pair || []).map(NB.words).join(' \u2013 ') : reason),
        },
      ],
      preview.configurations.map((each, index) => ({ each, reason: reasons[index] })),
      {
        class: 'choose small',
        row: ({ each }) => ({
          'aria-selected': String(each.label === chosen),
          tabindex: each.label === chosen || !chosen ? '0' : '-1',
        }),
      },
    );
    const rows = NB.tableRows(list);
    NB.rows(rows, (index) => this.choose(preview.configurations[index].label));
    const focused = NB.tableRows(this.configurations).findIndex((row) => row.matches(':focus'));
    NB.clear(
      this.configurations,
      refusal
        ? NB.el('p', { class: 'error', text: `No configuration can be used, needle path rejected: ${refusal}.` })
        : null,
      list,
      this.chosenText(),
    );
    if (focused >= 0) rows[focused].focus();
  }

  chosenText() {
    const { motion } = this;
    const chosen = this.state.needle.configuration;
    this.playButton.disabled = !motion || motion.refused !== undefined || !motion.time_s.length;
    if (!chosen) return NB.el('p', { class: 'soft', text: 'Choose a configuration to see its motion and tip error.' });
    if (!motion) return NB.el('p', { class: 'soft', text: `Planning the motion of ${chosen} ...` });
    if (motion.refused) return NB.el('p', { class: 'error', text: motion.refused.message });
    const first = motion.rejections[0];
    const how = first
      ? NB.el('p', { class: 'bad', text: `${chosen}: ${first.words}. ${first.detail}.` })
      : NB.el('p', {
          class: this.route?.refusal ? 'bad' : 'good',
          text: `${chosen}: motion of ${NB.fixed(motion.time_s.at(-1), 1)} s planned, all clearances satisfied${
            this.route?.refusal ? '; needle path rejected' : ''
          }.`,
        });
    const tip = motion.tip
      ? NB.el('p', {
          text:
            `RMS tip error at the target: ${NB.mm(motion.tip.rms_m, 2)} mm, ` +
            `${NB.mm(motion.tip.lateral_rms_m, 2)} mm lateral. The outline on the slices contains 95 % of tip ` +
            'positions, to scale.',
        })
      : NB.el('p', {
          class: 'soft',
          text: motion.tip_unknown
            ? `RMS tip error unknown: ${motion.tip_unknown}.`
            : 'RMS tip error unknown without a motion.',
        });
    return NB.el('div', null, how, tip);
  }

  playButtons() {
    this.playButton = NB.el(
      'button',
      {
        type: 'button',
        disabled: true,
        onclick: () => {
          if (!this.motion || this.motion.refused) return;
          this.room.play(this.motion, (time, whole) => {
            this.clock.textContent = `${NB.fixed(time, 1)} of ${NB.fixed(whole, 1)} s`;
          });
        },
      },
      'Play motion',
    );
    this.clock = NB.el('span', { class: 'soft' });
    return NB.el(
      'span',
      { class: 'no-print' },
      this.playButton,
      ' ',
      NB.el('button', { type: 'button', onclick: () => this.room.home(this.route) }, 'Show needle'),
      ' ',
      this.clock,
    );
  }

  // ---- needle paths side by side

  routesPanel() {
    this.routeName = NB.el('input', {
      type: 'text',
      size: '16',
      maxlength: '64',
      'aria-label': 'Name of the path',
      value: '',
    });
    return NB.el(
      'section',
      { class: 'panel' },
      NB.el('h2', { text: 'Comparison of paths' }),
      NB.el(
        'div',
        { class: 'bar no-print' },
        this.routeName,
        NB.el('button', { type: 'button', onclick: () => this.keepRoute() }, 'Keep path'),
      ),
      this.comparison,
    );
  }

  keepRoute() {
    if (!this.route) return;
    this.remember();
    const taken = new Set(this.state.routes.map(({ name }) => name));
    let name = this.routeName.value.trim() || `path ${this.state.routes.length + 1}`;
    for (let n = 2; taken.has(name); n++) name = `${name.replace(/ \d+$/, '')} ${n}`;
    this.state.routes = [...this.state.routes, { name, needle: structuredClone(this.state.needle) }].slice(-20);
    this.routeName.value = '';
    this.showRoutes();
    this.showUndo();
    this.keepSoon();
  }

  async showRoutes() {
    const { routes } = this.state;
    if (!routes.length) {
      NB.clear(this.comparison, NB.el('p', { class: 'soft', text: 'Keep a path to compare others with it.' }));
      return;
    }
    const asked = {};
    this.comparing = asked;
    const answers = await Promise.all(
      routes.map(async ({ name, needle }) => {
        const { goal, target, entry } = needle;
        try {
          const [route, reach] = await Promise.all(
            ['route', 'reach'].map((path) => PLAN.ask(path, { body: { aim: { goal, target, entry } } })),
          );
          return { name, needle, route: route.refused ? null : route, reach: reach.refused ? null : reach };
        } catch (error) {
          this.complain(error);
          return { name, needle, route: null, reach: null };
        }
      }),
    );
    if (asked !== this.comparing) return;
    const buttons = answers.map((each, index) =>
      NB.el(
        'span',
        { class: 'pick' },
        NB.el(
          'button',
          {
            type: 'button',
            onclick: () => {
              this.change(structuredClone(each.needle));
            },
          },
          `Use ${each.name}`,
        ),
        NB.el(
          'button',
          {
            type: 'button',
            'aria-label': `Delete ${each.name}`,
            onclick: () => {
              this.remember();
              this.state.routes = this.state.routes.filter((_, at) => at !== index);
              this.showRoutes();
              this.showUndo();
              this.keepSoon();
            },
          },
          '\u00d7',
        ),
      ),
    );
    NB.clear(this.comparison, PLAN.routeRows(answers, 'Kept paths'), NB.el('div', { class: 'tabs no-print' }, buttons));
  }

  // ---- markers, notes

  markersPanel() {
    const { markers, registration } = this.facts;
    if (!markers.length || !registration)
      return NB.el(
        'section',
        { class: 'panel' },
        NB.el('h2', { text: 'Markers' }),
        NB.el('p', { text: 'No markers registered.' }),
      );
    this.markerBoxes = new Map(
      markers.map(({ name }) => [
        name,
        NB.checkbox('', true, (checked) => {
          this.remember();
          const hidden = this.state.hidden_markers.filter((each) => each !== name);
          this.state.hidden_markers = checked ? hidden : [...hidden, name];
          this.showMarkers();
          this.showUndo();
          this.keepSoon();
        }),
      ]),
    );
    for (const [name, box] of this.markerBoxes) box.control.setAttribute('aria-label', `Show ${NB.words(name)}`);
    const table = NB.table(
      'Registration residuals',
      [
        { title: 'Marker', cell: ({ name }) => NB.words(name) },
        { title: 'Shown', cell: ({ name }) => this.markerBoxes.get(name) },
        { title: 'Residual', unit: 'mm', numeric: true, cell: (each) => NB.mm(each.residual_m, 2) },
        { title: 'Expected', unit: 'mm RMS', numeric: true, cell: (each) => NB.mm(each.expected_residual_m, 2) },
        { title: 'Leave-one-out', unit: 'mm', numeric: true, cell: (each) => NB.mm(each.by_the_others_m, 2) },
      ],
      markers,
      { class: 'small' },
    );
    const suspects = registration.suspects.length
      ? NB.el('p', { class: 'bad', text: `Possibly moved: ${registration.suspects.map(NB.words).join(', ')}.` })
      : null;
    const errors = this.facts.lesions
      .filter((lesion) => lesion.registration_rms_m !== null)
      .map((lesion) =>
        NB.el('p', {
          text: `TRE at ${NB.words(lesion.name)}: ${NB.mm(lesion.registration_rms_m, 2)} mm RMS.`,
        }),
      );
    return NB.el(
      'section',
      { class: 'panel' },
      NB.el('h2', { text: 'Markers' }),
      table,
      NB.el('p', {
        text:
          `FRE ${NB.mm(registration.fre_rms_m, 2)} mm RMS ` +
          `(${NB.mm(registration.expected_fre_rms_m, 2)} expected); FRE does not predict the TRE.`,
      }),
      errors,
      suspects,
    );
  }

  showMarkers() {
    for (const { name } of this.facts.markers) {
      const visible = !this.state.hidden_markers.includes(name);
      const box = this.markerBoxes.get(name);
      if (box) box.control.checked = visible;
      this.room.marker(name, visible);
    }
    this.draw();
  }

  notesPanel() {
    this.notes = NB.el('textarea', {
      rows: '3',
      maxlength: '20000',
      'aria-label': 'Notes',
      oninput: () => {
        this.state.notes = this.notes.value;
        this.showNotes();
        this.keepSoon();
      },
    });
    this.notesOnPaper = NB.el('p', { class: 'print-only' });
    this.showNotes();
    return NB.el('section', { class: 'panel' }, NB.el('h2', { text: 'Notes' }), this.notes, this.notesOnPaper);
  }

  /** On the page, and on paper. */
  showNotes() {
    if (this.notes.value !== this.state.notes) this.notes.value = this.state.notes;
    this.notesOnPaper.textContent = this.state.notes;
  }

  signature() {
    this.printed = NB.el('span');
    return NB.el(
      'p',
      { class: 'print-only signature' },
      'Printed ',
      this.printed,
      '. Research software, not a medical device. Planned by: ______________________  Date: ______________  ' +
        'Signature: ______________________',
    );
  }

  // ---- what is saved

  /** What undo brings back. */
  remember() {
    this.done.push(this.undoable());
    if (this.done.length > 200) this.done.shift();
    this.undone = [];
  }

  undoable() {
    return structuredClone({
      needle: this.state.needle,
      hidden_markers: this.state.hidden_markers,
      routes: this.state.routes,
    });
  }

  undo() {
    this.back(this.done, this.undone);
  }

  redo() {
    this.back(this.undone, this.done);
  }

  /** @param {Undoable[]} from @param {Undoable[]} to */
  back(from, to) {
    if (!from.length) return;
    to.push(this.undoable());
    Object.assign(this.state, from.pop());
    this.everything();
    this.keepSoon();
  }

  everything() {
    this.needleChanged();
    this.showMarkers();
    this.showRoutes();
    this.showUndo();
  }

  showUndo() {
    this.undoButton.disabled = !this.done.length;
    this.redoButton.disabled = !this.undone.length;
  }

  keepSoon() {
    if (!this.volume) return;
    this.kept.textContent = 'not saved yet';
    clearTimeout(this.keeping);
    this.keeping = setTimeout(() => this.keep(), 400);
  }

  async keep() {
    if (this.conflict) return;
    if (this.writing) {
      this.again = true;
      return;
    }
    this.writing = true;
    try {
      const { version } = await PLAN.ask('session', {
        method: 'PUT',
        body: { version: this.version, state: this.state },
      });
      this.version = version;
      this.kept.textContent = this.again ? 'not saved yet' : 'saved';
      if (this.complaint === 'keeping') this.calm();
    } catch (error) {
      this.kept.textContent = 'not saved';
      const theirs = error instanceof Problem && error.status === 409 && error.body.session;
      if (theirs) this.meet(error, theirs);
      else
        this.complain(error, 'keeping', NB.el('button', { type: 'button', onclick: () => this.keep() }, 'Try again'));
    }
    this.writing = false;
    if (this.again) {
      this.again = false;
      this.keep();
    }
  }

  /**
   * Another tab was first: nothing is lost either way.
   * @param {Problem} error
   * @param {Session} theirs
   */
  meet(error, theirs) {
    this.conflict = true;
    this.complain(
      error,
      'conflict',
      NB.el(
        'button',
        {
          type: 'button',
          onclick: () => {
            this.remember();
            Object.assign(
              this.state,
              Object.fromEntries(Object.entries(PLAN.taken(theirs)).filter(([, value]) => value !== null)),
            );
            this.version = theirs.version;
            this.conflict = false;
            this.calm();
            this.showNotes();
            this.setWindow(this.state.window_hu);
            this.everything();
            this.look(this.state.crosshair);
          },
        },
        'Load the other version',
      ),
      NB.el(
        'button',
        {
          type: 'button',
          onclick: () => {
            this.version = theirs.version;
            this.conflict = false;
            this.calm();
            this.keep();
          },
        },
        'Keep this version',
      ),
    );
  }

  /** @param {{ message: string, hint?: string | null }} error @param {string} [about] @param {...Child} buttons */
  complain(error, about = 'other', ...buttons) {
    this.complaint = about;
    NB.clear(this.banner, NB.el('p', null, NB.el('strong', { text: `${error.message}. ` }), error.hint || ''), buttons);
    this.banner.classList.add('shown');
  }

  calm() {
    this.complaint = null;
    this.banner.classList.remove('shown');
    NB.clear(this.banner);
  }

  /** What is saved as a plan. */
  plan() {
    return { aim: this.aim(), configuration: this.state.needle.configuration, name: this.planName.value.trim() };
  }

  async savePlan() {
    try {
      const { file, left_out: leftOut, refusal } = await PLAN.write('plan', this.plan(), this.saved);
      this.saved.textContent = refusal
        ? `Saved as ${file}, marked as rejected: ${refusal}.`
        : `Saved as ${file}; ready for \`needlebench run\`.${PLAN.withoutGoals(leftOut)}`;
      this.saved.className = refusal ? 'bad' : 'good';
    } catch (error) {
      this.saved.textContent = `Not saved: ${error.message}${error.hint ? ` (${error.hint})` : ''}`;
      this.saved.className = 'bad';
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (
      !(event.ctrlKey || event.metaKey) ||
      /** @type {Element} */ (event.target).closest('input[type="text"], textarea')
    )
      return;
    const name = event.key.toLowerCase();
    if (name === 'z') {
      event.preventDefault();
      if (event.shiftKey) this.redo();
      else this.undo();
    }
    if (name === 'y') {
      event.preventDefault();
      this.redo();
    }
  }
}

/** What of a session is the page's own. */
PLAN.taken = ({ schema_version, version, ...state }) => state;

/** Opens the case. */
PLAN.open = async () => {
  const app = NB.byId('app');
  const loading = NB.byId('loading');
  try {
    if (!/^[0-9a-f]{32}$/.test(PLAN.token))
      throw new Problem(401, {
        error: 'the address lacks its token',
        hint: 'open the whole address that `needlebench view` prints',
      });
    loading.textContent = 'Loading the patient ...';
    const [facts, session, scene] = await Promise.all([
      PLAN.ask('case'),
      PLAN.ask('session'),
      PLAN.fetch('scene').then((response) => response.arrayBuffer()),
    ]);
    const page = NB.unpack(scene);
    for (const [name, words] of Object.entries(page.words || {})) NB.dictionary.set(name, words);
    document.title = `needlebench: plan of ${facts.name}`;
    const coming = Volume.load(facts.size, facts.spacing_m, (share) => {
      loading.textContent = `Loading the volume: ${Math.round(100 * share)} %`;
    });
    const volume = await coming;
    const planner = new Planner(facts, session, page, app);
    PLAN.planner = planner;
    planner.volume = volume;
    planner.draw();
    requestAnimationFrame(() =>
      requestAnimationFrame(() => {
        NB.timing.firstView = performance.now();
        document.documentElement.dataset.ready = 'true';
      }),
    );
  } catch (error) {
    NB.clear(
      app,
      NB.el('h1', { text: 'needlebench' }),
      NB.el('p', { class: 'error', role: 'alert', text: `This patient cannot be shown: ${error.message}.` }),
      error.hint ? NB.el('p', { text: error.hint }) : null,
    );
    if (!(error instanceof Problem)) throw error;
  }
};
document.addEventListener('DOMContentLoaded', PLAN.open);

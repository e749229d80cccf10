// The page of a run.
'use strict';

NB.RunPage = class {
  constructor(page, app) {
    this.page = page;
    this.report = page.report;
    this.ghosts = new Set();
    this.layers = {
      robot: true, tool: true, collision: false, table: true, gantry: true, mount: true, obstacle: true, skin: true, bone: true,
      organ: true, vessel: true, lesion: true, marker: true, corridor: false, needle: true, witness: true,
      people: false, space: false, cone: false, ellipsoids: true,
    };
    this.witness = 'least';
    this.magnify = 10;
    this.time = 0;
    this.speed = 1;
    app.append(this.head());
    this.view = new NB.View(page.scene, `Cell of ${this.report.scenario.name}`);
    if (this.report.goals.length) this.build(app);
    else this.buildWithoutGoals(app);
    app.append(this.criteria(), this.requirements(), this.provenance());
  }

  head() {
    const { verdict, criteria, not_judged: open, engine_failures: failures } = this.report;
    const met = criteria.filter((each) => each.pass).length;
    const all = criteria.length + open.length;
    const counts = open.length
      ? `${criteria.length} of ${all} criteria judged, ${met === criteria.length ? 'all' : `${met} of them`} met; ${open.length} not judged`
      : `${met} of ${criteria.length} criteria met`;
    return NB.el('div', { class: 'bar' },
      NB.verdict(verdict),
      NB.el('span', { text: counts }),
      failures.map((each) => NB.el('span', { class: 'error', text: `${each.engine} failed${each.during ? ` during ${each.during}` : ''}: ${each.message}` })));
  }

  build(app) {
    const view = this.view;
    this.arm = view.arm('arm');
    this.other = view.arm('other', { color: [0.9, 0.62, 0], opacity: 0.35 });
    this.ghostArms = Array.from({ length: 8 }, (_, index) => {
      const made = { name: `ghost${index}`, arm: null };
      return made;
    });
    const goals = this.report.goals;
    this.goalButtons = goals.map((goal, index) => NB.el('button', {
      type: 'button', role: 'radio', 'aria-checked': 'false',
      onclick: () => this.setGoal(index),
      onkeydown: (event) => {
        const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
        if (!step) return;
        event.preventDefault();
        const to = (index + step + goals.length) % goals.length;
        this.setGoal(to);
        this.goalButtons[to].focus();
      },
    }, NB.words(goal.name)));
    // On paper, the table below says the same.
    this.side = NB.el('div', { class: 'panel no-print' });
    this.details = NB.el('div', { class: 'panel' });
    this.table = NB.el('div');
    this.budget = NB.el('div');
    this.people = NB.el('div');
    this.curves = new NB.Curves({
      height: 250, label: 'Clearance of each class over the time of the motion', xTitle: 'time (s)', yTitle: 'clearance (mm)',
      seek: (time) => { this.pause(); this.seek(time); },
    });
    app.append(
      NB.el('div', { class: 'bar' }, NB.el('strong', { text: 'Goal' }),
        NB.el('div', { class: 'tabs', role: 'radiogroup', 'aria-label': 'Goal' }, this.goalButtons)),
      NB.el('div', { class: 'grid' },
        NB.el('div', null, this.viewBar(), view.element, this.replayBar(), this.curves.element),
        NB.el('div', null, this.side, this.details, this.layerPanel())),
      NB.section('Configurations', true, this.table),
      NB.section('Error budget', true, this.budget),
      NB.section('People and free space', false, this.people));
    this.setGoal(0);
  }

  buildWithoutGoals(app) {
    const arm = this.view.arm('arm');
    arm.pose(this.page.scene.chain, this.page.start);
    for (const [name, on] of Object.entries(this.layers)) this.view.show(name, on);
    for (const group of ['collision', 'corridor']) arm.layer(group, false);
    this.view.frame(this.framed([]), [-0.75, 0.45, -0.55]);
    const [title, what] = this.report.excitation
      ? ['Excitation', 'Proven clearances by motion are in report.json; the logs are in the files named there.']
      : ['ISO 9283', 'The table of the test and its curves are in report.json and in the files named there.'];
    app.append(this.view.element, NB.section(title, false, NB.el('p', { text: what }),
      NB.tree(this.report.excitation || this.report.iso9283)));
  }

  /** Base and shoulders of the arm, and points of the goal. */
  framed(points) {
    return [...NB.aboutBase(this.page.scene.chain.base, 0.55), ...points];
  }

  direction(target, axis) { return NB.direction(this.page.scene.chain.base, target, axis); }

  viewBar() {
    const look = (name, make) => NB.el('button', { type: 'button', onclick: () => this.aim(make()) }, name);
    const entry = () => this.goal.entry_m || this.goal.target_m;
    return NB.el('div', { class: 'bar no-print', role: 'group', 'aria-label': 'Viewpoint' },
      NB.el('button', { type: 'button', onclick: () => this.view.reset() }, 'Whole cell'),
      look('Front', () => ({ direction: [0, 1, -0.12] })), look('Side', () => ({ direction: [-1, 0, -0.12] })),
      look('From above', () => ({ direction: [0, 0.02, -1] })),
      look('Needle', () => {
        const d = this.direction(this.goal.target_m, this.goal.axis);
        return { direction: d, distance: 0.55, middle: entry() };
      }),
      NB.el('span', { class: 'soft', text: 'drag: turn \u00b7 wheel: zoom \u00b7 right button: move' }));
  }

  aim({ direction, distance, middle }) {
    const home = this.view.home;
    if (home) this.view.look(direction, distance || home.distance, middle || home.middle);
  }

  layerPanel() {
    const box = (name, text) => NB.checkbox(text, this.layers[name], (on) => { this.layers[name] = on; this.applyLayers(); });
    const present = new Set(this.page.scene.parts.map((part) => part.group));
    const parts = [['robot', 'robot'], ['tool', 'tool'], ['collision', 'collision shapes'], ['table', 'table'], ['gantry', 'gantry'], ['mount', 'mount'], ['obstacle', 'obstacles'],
      ['skin', 'skin'], ['bone', 'bones'], ['organ', 'organs'], ['vessel', 'vessels'], ['lesion', 'lesions'], ['marker', 'markers'],
      ['corridor', 'needle corridor']].filter(([name]) => present.has(name));
    const hasBudget = this.report.goals.some((goal) => goal.configurations.some((each) => each.budget));
    return NB.el('div', { class: 'panel no-print' }, NB.el('h3', { text: 'Show' }),
      NB.el('div', { role: 'group', 'aria-label': 'Parts of the picture' },
        parts.map(([name, text]) => box(name, text)),
        box('needle', 'needle line'), box('cone', 'cone for the hand'), box('people', 'people and sight'), box('space', 'free space'),
        box('witness', 'least clearance'), hasBudget ? box('ellipsoids', 'error ellipsoids') : null),
      NB.el('div', { class: 'bar' },
        NB.select('Clearance lines', [['least', 'the least'], ['all', 'of every class'], ['chosen', 'the chosen class']], this.witness,
          (value) => { this.witness = value; this.drawWitness(); }),
        hasBudget ? NB.select('Ellipsoids', [['1', 'true size'], ['5', '5 \u00d7'], ['10', '10 \u00d7'], ['20', '20 \u00d7']], '10',
          (value) => { this.magnify = Number(value); this.drawBudget(); }) : null));
  }

  replayBar() {
    this.playButton = NB.el('button', { type: 'button', onclick: () => (this.playing ? this.pause() : this.play()) }, '\u25b6 Play');
    this.slider = NB.el('input', {
      type: 'range', min: '0', max: '1', step: '0.01', value: '0', 'aria-label': 'Time of the motion',
      oninput: (event) => { this.pause(); this.seek(Number(event.target.value)); },
    });
    this.clock = NB.el('span', { class: 'clock', role: 'status', 'aria-live': 'off' });
    this.engineSelect = NB.el('select', { 'aria-label': 'Engine', onchange: () => this.showMotion() });
    this.apart = NB.el('span', { class: 'soft' });
    const speed = NB.select('Speed', [['0.1', '0.1 \u00d7'], ['0.25', '0.25 \u00d7'], ['0.5', '0.5 \u00d7'], ['1', '1 \u00d7'], ['2', '2 \u00d7'], ['4', '4 \u00d7']], '1',
      (value) => { this.speed = Number(value); });
    return NB.el('div', { class: 'replay', role: 'group', 'aria-label': 'Replay' },
      this.playButton, this.slider, this.clock, speed, this.engineSelect, this.apart);
  }

  get goal() { return this.report.goals[this.goalIndex]; }

  get extra() { return this.page.goals[this.goalIndex]; }

  get configuration() { return this.goal.configurations[this.configurationIndex]; }

  get own() { return this.extra.configurations[this.configurationIndex]; }

  setGoal(index) {
    this.goalIndex = index;
    this.goalButtons.forEach((button, at) => {
      button.setAttribute('aria-checked', at === index);
      button.tabIndex = at === index ? 0 : -1;
    });
    const view = this.view;
    const { target_m: target, axis, entry_m: entry } = this.goal;
    view.empty('needle');
    const tool = this.page.scene.needleLength;
    const [x, y, z] = this.extra.guideExit;
    const behind = [x - axis[0] * tool * 0.6, y - axis[1] * tool * 0.6, z - axis[2] * tool * 0.6];
    view.rod('needle', behind, target, 0.0012, [0, 0.45, 0.32, 1]);
    view.ball('needle', target, 0.004, [0.84, 0.37, 0, 1]);
    view.label('needle', 'target', target);
    if (entry) {
      view.ball('needle', entry, 0.0035, [0, 0.45, 0.7, 1]);
      view.label('needle', 'entry', entry);
    }
    this.drawPeople();
    this.sideTable();
    this.configurationTable();
    this.budgetTable();
    this.peopleTable();
    const around = [[-0.25, -0.25, -0.1], [0.25, 0.25, 0.3]].map((offset) => offset.map((value, k) => target[k] + value));
    view.frame(this.framed(around), this.direction(target, axis));
    const first = this.goal.recommended
      ? this.goal.configurations.findIndex((each) => each.label === this.goal.recommended.label)
      : Math.max(0, this.goal.configurations.findIndex((each) => each.joints_rad));
    this.drawGhosts();
    this.setConfiguration(first);
    this.applyLayers();
  }

  setConfiguration(index) {
    this.pause();
    this.configurationIndex = index;
    NB.mark(this.sideRows, index);
    NB.mark(this.tableRows, index);
    this.chosenClass = null;
    const { runs } = this.own;
    // Two engines at a time: all pairs of them.
    this.pairs = runs.flatMap((second, at) => runs.slice(0, at).map((first) => [first, second]));
    NB.clear(this.engineSelect, this.pairs.map(([first, second], at) => NB.el('option', { value: at ? `pair ${at}` : 'both',
      text: `${runs.length > 2 ? `${first.engine} and ${second.engine}` : 'both engines'}, second as ghost` })),
      runs.map((run, at) => NB.el('option', { value: String(at), text: `${run.engine}${run.stopped ? ' (stopped)' : ''}` })),
      runs.length ? null : NB.el('option', { value: '', text: 'no motion recorded' }));
    const apart_m = this.configuration.engine_difference?.peak_tip_m;
    this.apart.textContent = apart_m === undefined ? '' : `tips of the engines at most ${NB.length(apart_m)} apart; the ghost is seen only where they differ`;
    this.showDetails();
    this.drawRoom();
    this.drawBudget();
    this.showMotion();
    this.drawWitness();
  }

  decode(run) {
    if (!run.decoded) {
      run.decoded = {
        time: NB.array(run.time), joints: run.joints.map(NB.array), curveTime: NB.array(run.curveTime),
        curves: Object.entries(run.curves).map(([name, column]) => [name, NB.array(column).map((value) => value * 1e3)]),
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
      return found.map(([name, y]) => ({ name, x: curveTime, y, ...NB.styleOf(name), width: at ? 4 : 1.8, color: at ? `${NB.styleOf(name).color}55` : NB.styleOf(name).color }));
    });
    this.end = has ? Math.max(...this.shown.map((run) => this.decode(run).time.at(-1))) : 1;
    const tints = ['#f1f4f7', '#e6ecf2'];
    const bands = has ? this.configuration.motion.map((phase, at) => ({ from: phase.start_s, to: Math.min(phase.end_s, this.end), text: phase.phase, color: tints[at % 2] })) : [];
    this.slider.max = String(this.end);
    this.curves.set(curves, bands, [0, this.end]);
    this.seek(has ? this.end : 0);
  }

  /** Poses the arms at a time of the motion, or in the final posture where there is none. */
  seek(time) {
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
    this.view.draw();
  }

  play() {
    if (!this.shown.length) return;
    if (this.time >= this.end - 1e-3) this.seek(0);
    this.playing = true;
    this.playButton.textContent = '\u275a\u275a Pause';
    let last = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      const time = Math.min(this.time + (now - last) / 1e3 * this.speed, this.end);
      last = now;
      this.seek(time);
      if (time >= this.end) this.pause(); else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.playing = false;
    if (this.playButton) this.playButton.textContent = '\u25b6 Play';
  }

  applyLayers() {
    for (const [name, on] of Object.entries(this.layers)) {
      if (['robot', 'tool', 'collision', 'corridor'].includes(name)) {
        for (const arm of [this.arm, this.other]) arm.layer(name, on);
      } else this.view.show(name, on);
    }
    this.view.group('robot').visible = this.layers.robot;
    this.view.draw();
  }

  drawGhosts() {
    this.ghostArms.forEach((ghost, index) => {
      const joints = this.goal.configurations[index]?.joints_rad;
      const on = this.ghosts.has(index) && Boolean(joints);
      if (on && !ghost.arm) ghost.arm = this.view.arm(ghost.name, { color: [0.34, 0.71, 0.91], opacity: 0.28 });
      if (!ghost.arm) return;
      ghost.arm.show(on);
      if (on) ghost.arm.pose(this.page.scene.chain, joints);
    });
    this.view.draw();
  }

  drawWitness() {
    const view = this.view;
    view.empty('witness');
    const classes = Object.entries(this.configuration.clearance).filter(([, found]) => found && found.witness_points_m);
    const physical = classes.filter(([name]) => this.page.unwantedClasses.includes(name));
    const least = physical.reduce((best, each) => (!best || each[1].minimum_m < best[1].minimum_m ? each : best), null);
    const chosen = classes.filter(([name]) => name === this.chosenClass);
    const lines = this.witness === 'all' ? classes : this.witness === 'chosen' || chosen.length ? chosen : least ? [least] : [];
    for (const [name, found] of lines) {
      const color = new THREE.Color(NB.styleOf(name).color);
      const rgba = [color.r, color.g, color.b].map((c) => (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055)).concat(1);
      const [a, b] = found.witness_points_m;
      view.rod('witness', a, b, 0.002, rgba, true);
      for (const end of [a, b]) view.ball('witness', end, 0.005, rgba, true);
      view.label('witness', `${NB.words(name)} ${NB.mm(found.minimum_m)} mm${found.time_s === null ? '' : ` at ${found.time_s.toFixed(2)} s`}`, a.map((value, k) => (value + b[k]) / 2));
    }
    view.draw();
  }

  drawPeople() {
    const view = this.view;
    view.empty('people');
    view.empty('space');
    const { people, sector } = this.extra.room;
    for (const person of people) {
      const [x, y, z] = person.position;
      const tall = 0.82 * person.shortest;
      if (view.works) {
        const body = new THREE.Mesh(new THREE.CapsuleGeometry(0.12, tall - 0.24, 6, 20), view.material([0.35, 0.42, 0.62, 0.28]));
        body.rotation.x = Math.PI / 2;
        body.position.set(x, y, z + tall / 2);
        body.renderOrder = 12;
        view.add('people', body);
      }
      for (const [stature, eyes] of Object.entries(person.eyes)) {
        view.ball('people', eyes, 0.045, [0.35, 0.42, 0.62, 1]);
        view.label('people', `${person.name} ${stature} m`, eyes);
      }
    }
    if (sector && view.works) {
      const half = new THREE.Mesh(NB.cone(Math.PI / 2, sector.radius), view.material([0, 0.62, 0.45, 0.16]));
      half.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, -1), new THREE.Vector3(...sector.outwards));
      half.position.set(...sector.center);
      half.renderOrder = 18;
      view.add('space', half);
    }
  }

  /** What the configuration leaves: lines of sight, taken space, cone. */
  drawRoom() {
    const view = this.view;
    for (const layer of ['sight', 'taken', 'cone']) view.empty(layer);
    const { room } = this.own;
    if (room && view.works) {
      const lines = NB.array(room.sight);
      for (let k = 0; k < lines.length; k += 7) {
        const color = lines[k + 6] ? [0.84, 0.37, 0, 1] : [0, 0.45, 0.7, 1];
        view.rod('sight', lines.slice(k, k + 3), lines.slice(k + 3, k + 6), lines[k + 6] ? 0.0022 : 0.0015, color);
      }
      if (room.taken) view.add('taken', view.surface(room.taken, [0.84, 0.37, 0, 0.35]));
      const { hand_cone_half_angle_rad: angle, hand_cone_length_m: length } = this.configuration.room;
      const cone = new THREE.Mesh(NB.cone(angle, length), view.material([0, 0.45, 0.7, 0.4]));
      cone.applyMatrix4(NB.matrix(room.guideEntry));
      cone.renderOrder = 16;
      view.add('cone', cone);
    }
    // They belong to layers with other things in them.
    view.group('people').add?.(view.group('sight'));
    view.group('space').add?.(view.group('taken'));
    view.draw();
  }

  /** Ellipsoids that hold 95 % of a normal distribution: 2.7955 standard deviations. */
  drawBudget() {
    const view = this.view;
    view.empty('ellipsoids');
    const total = this.configuration.budget?.total;
    if (total && view.works) {
      const turn = new THREE.Matrix4().makeRotationFromQuaternion(new THREE.Quaternion(...this.extra.guideExit.slice(3)));
      const entry = this.goal.entry_m;
      for (const [where, at, color] of [['target', this.goal.target_m, [0.84, 0.37, 0, 0.55]], ['skin', entry, [0, 0.45, 0.7, 0.55]]]) {
        const moments = total[`at_${where}`]?.analytic;
        if (!at || !moments) continue;
        const spread = NB.cholesky(moments.covariance_m2);
        const scale = 2.7955 * this.magnify;
        const columns = [0, 1, 2].map((k) => new THREE.Vector3(spread[0][k], spread[1][k], spread[2][k]).applyMatrix4(turn).multiplyScalar(scale).toArray());
        const bias = new THREE.Vector3(...moments.bias_m).applyMatrix4(turn).multiplyScalar(this.magnify);
        const center = at.map((value, k) => value + bias.getComponent(k));
        view.ellipsoid('ellipsoids', center, columns, color);
        view.label('ellipsoids', `95 % at ${where}, \u00d7 ${this.magnify}: rms ${NB.mm(moments.rms_m, 2)} mm`, center);
      }
    }
    view.draw();
  }

  status(configuration) {
    const recommended = this.goal.recommended?.label === configuration.label;
    const words = { ok: ['good', '\u2713 ok'], failed: ['bad', '\u2717 failed'], rejected: ['off', '\u2013 rejected'] };
    const missed = this.report.criteria.some((each) => !each.pass && each.criterion !== 'expected' && each.goal === this.goal.name && each.label === configuration.label);
    const open = configuration.not_judged > 0 && !missed;
    const [style, text] = open ? ['bad', '? incomplete'] : words[configuration.status];
    return [NB.el('span', { class: style, text }), recommended ? NB.el('span', { class: 'good', text: ' \u2605', title: 'recommended' }) : ''];
  }

  sideTable() {
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      { title: 'Status', cell: (c) => this.status(c) },
      ...NB.metricColumns(this.extra.columns.side),
      { title: 'Ghost', cell: (c) => NB.el('input', {
        type: 'checkbox', 'aria-label': `ghost of ${c.label}`, checked: this.ghosts.has(this.goal.configurations.indexOf(c)), disabled: !c.joints_rad,
        onclick: (event) => event.stopPropagation(),
        onchange: (event) => {
          const at = this.goal.configurations.indexOf(c);
          if (event.target.checked) this.ghosts.add(at); else this.ghosts.delete(at);
          this.drawGhosts();
        },
      }) },
    ];
    const table = NB.table('Choose a configuration (\u2605 recommended)', columns, this.goal.configurations, { class: 'choose small full' });
    this.sideRows = [...table.querySelectorAll('tbody tr')];
    NB.rows(this.sideRows, (index) => this.setConfiguration(index));
    const all = NB.el('button', { type: 'button', class: 'no-print', onclick: () => {
      const on = this.ghosts.size === 0;
      this.ghosts = new Set(on ? this.goal.configurations.keys() : []);
      this.sideTable();
      NB.mark(this.sideRows, this.configurationIndex);
      this.drawGhosts();
    } }, this.ghosts.size ? 'No ghosts' : 'All as ghosts');
    NB.clear(this.side, table, all);
  }

  showDetails() {
    const c = this.configuration;
    const reasons = c.rejections.map((each) => NB.el('li', { text: `${NB.words(each.rule)}: ${NB.quantity(each.value, each.unit)} (limit ${NB.quantity(each.limit, each.unit)}) ${each.detail}` }));
    const failed = this.report.criteria.filter((each) => !each.pass && each.goal === this.goal.name && each.label === c.label)
      .map((each) => NB.el('li', { text: `misses ${NB.words(each.criterion)}: ${NB.quantity(each.value, each.unit)} (limit ${NB.quantity(each.limit, each.unit)}) ${each.engine || ''} ${each.detail}` }));
    const classes = Object.entries(c.clearance).filter(([, found]) => found && found.witness_points_m);
    const columns = [
      { title: 'Least clearance', cell: ([name]) => [NB.sample(NB.styleOf(name)), ` ${NB.words(name)}`] },
      { title: '', unit: 'mm', numeric: true, cell: ([, found]) => NB.mm(found.minimum_m) },
      { title: 'Between', cell: ([, found]) => `${found.pair.join(' \u2013 ')}, ${NB.words(found.phase)}${found.time_s === null ? '' : ` ${found.time_s.toFixed(2)} s`}` },
    ];
    const table = NB.table('Row: show where and when', columns, classes, { class: 'choose small full' });
    const rows = [...table.querySelectorAll('tbody tr')];
    NB.rows(rows, (index) => {
      const [name, found] = classes[index];
      this.chosenClass = name;
      NB.mark(rows, index);
      this.pause();
      if (found.time_s !== null && this.shown.length) this.seek(found.time_s);
      this.drawWitness();
    });
    NB.mark(rows, -1);
    if (rows[0]) rows[0].tabIndex = 0;
    NB.clear(this.details, NB.el('h3', { text: c.label }),
      NB.el('p', { class: 'small' }, c.joints_rad ? `joints ${c.joints_rad.map((q) => NB.deg(q)).join(', ')}\u00b0 \u00b7 roll ${NB.deg(c.roll_rad)}\u00b0` : 'no posture'),
      reasons.length || failed.length ? NB.el('ul', { class: 'plain small' }, reasons, failed) : null, table, this.marginDetails(c));
  }

  /** What the planned motion keeps of the clearance that its postures allow, and the way back. */
  marginDetails(c) {
    if (!c.margin) return null;
    const retreat = (name) => c.retreat_clearance[name]?.certified_lower_bound_m ?? null;
    const columns = [
      { title: 'Planned motion, proven', cell: ([name]) => NB.words(name) },
      { title: 'judged', unit: 'mm', numeric: true, cell: ([, each]) => NB.mm(each.limit_m) },
      { title: 'attainable', unit: 'mm', numeric: true, cell: ([, each]) => NB.mm(each.attainable_m), help: 'least of the start, the approach and its end, which every motion takes' },
      { title: 'kept', unit: 'mm', numeric: true, cell: ([, each]) => NB.mm(each.achieved_m) },
      { title: 'limited by', cell: ([, each]) => each.limited_by },
      { title: 'way back', unit: 'mm', numeric: true, cell: ([name]) => (retreat(name) === null ? '\u2013' : NB.mm(retreat(name))) },
    ];
    const ends = { bound: 'no transfer keeps more that counts', proof: 'no transfer helps: a posture that every motion takes is too near', budget: 'a better transfer may exist' };
    return NB.table(`Search ended by ${c.margin.search}: ${ends[c.margin.search]}`, columns, Object.entries(c.margin.classes), { class: 'small full' });
  }

  configurationTable() {
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      { title: 'Status', cell: (c) => this.status(c) },
      { title: 'Rank', numeric: true, cell: (c) => c.ranking ? `${c.ranking.rank}${c.pareto ? ' P' : ''}` : '\u2013', help: 'P: in the Pareto set' },
      { title: 'Score', numeric: true, cell: (c) => NB.fixed(c.ranking?.score, 3) },
      ...NB.metricColumns(this.extra.columns.table),
      { title: 'First reason against', text: true, cell: (c) => (c.rejections[0] ? `${NB.words(c.rejections[0].rule)}: ${c.rejections[0].detail}` : '') },
    ];
    const table = NB.table(`Goal ${NB.words(this.goal.name)}: clearances are minima over the motion of all engines`, columns, this.goal.configurations, { class: 'choose small' });
    this.tableRows = [...table.querySelectorAll('tbody tr')];
    NB.rows(this.tableRows, (index) => this.setConfiguration(index));
    const recommended = this.goal.recommended;
    NB.clear(this.table,
      recommended ? NB.el('p', null, NB.el('strong', { text: `Recommended: ${recommended.label}. ` }), recommended.reason) : NB.el('p', { class: 'error', text: 'No configuration works.' }),
      this.routeSentence(),
      table);
  }

  // How the planned needle keeps away from bone, vessels and organs; red where it does not.
  routeSentence() {
    const route = this.goal.needle_route;
    if (!route) return '';
    const part = `${NB.words(route.part)} (${route.tissue})`;
    const where = route.distance_m < 0 ? `${NB.mm(-route.distance_m, 1)} mm deep through ${part}` : `${NB.mm(route.distance_m, 1)} mm from ${part}`;
    return NB.el('p', { class: route.kept ? '' : 'error', text: `Needle route${route.kept ? '' : ' refused'}: ${where}, margin ${NB.mm(route.margin_m, 1)} mm.` });
  }

  budgetTable() {
    const with_ = this.goal.configurations.filter((c) => c.budget || c.budget_failure);
    const section = this.budget.parentElement;
    if (section) section.hidden = with_.length === 0;
    this.budget.hidden = with_.length === 0;
    if (!with_.length) return;
    const sources = [...new Set(with_.flatMap((c) => (c.budget?.sources || []).map((each) => each.source)))];
    const rms = (part) => NB.mm(part?.at_target.analytic.rms_m, 2);
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      { title: 'All', unit: 'mm', numeric: true, cell: (c) => rms(c.budget?.total) },
      { title: 'Within (95 %)', unit: 'mm', numeric: true, cell: (c) => NB.mm(c.budget?.total.at_target.radius_95_m, 2), help: 'distance that 95 % of the draws stay within' },
      { title: 'At skin', unit: 'mm', numeric: true, cell: (c) => NB.mm(c.budget?.total.at_skin?.analytic.rms_m, 2) },
      ...sources.map((name) => ({ title: NB.words(name), unit: 'mm', numeric: true, cell: (c) => rms(c.budget?.sources.find((each) => each.source === name)) })),
      { title: 'Largest', cell: (c) => (c.budget ? NB.words(c.budget.dominant) : c.budget_failure) },
    ];
    NB.clear(this.budget, NB.table('Root mean square distance of the tip from the target over all arms and patients, in all and by source alone', columns, with_, { class: 'small' }));
  }

  peopleTable() {
    const with_ = this.goal.configurations.filter((c) => c.room);
    const regions = [...new Set(with_.flatMap((c) => Object.keys(c.room.regions)))];
    const sight = [...new Set(with_.flatMap((c) => c.room.sight.map((each) => `${each.person} ${each.stature_m.toFixed(2)} m`)))];
    const columns = [
      { title: 'Configuration', cell: (c) => c.label },
      { title: 'Free', unit: '%', numeric: true, cell: (c) => NB.percent(c.room.free_fraction) },
      ...regions.map((name) => ({ title: `Free ${name}`, unit: '%', numeric: true, cell: (c) => NB.percent(c.room.regions[name]) })),
      ...sight.map((name) => ({ title: `Sight ${name}`, unit: '%', numeric: true, cell: (c) => NB.percent(c.room.sight.find((each) => `${each.person} ${each.stature_m.toFixed(2)} m` === name)?.fraction) })),
      { title: 'Hand cone', unit: '\u00b0', numeric: true, cell: (c) => NB.deg(c.room.hand_cone_half_angle_rad), help: 'half-angle of the largest free cone behind the guide' },
      { title: 'Blocked by', cell: (c) => c.room.hand_cone_blocker || '' },
      { title: 'Elbow', cell: (c) => `${c.room.elbow_up ? 'up' : 'down'}, ${NB.mm(c.room.elbow_over_entry_m, 0)} mm over entry` },
    ];
    NB.clear(this.people, NB.el('p', { class: 'soft', text: 'Switch on "people and sight", "free space" and "cone for the hand" to see them: blue lines of sight are free, orange ones end where they are blocked; orange cubes are taken by the arm.' }),
      NB.table('Shares of the half ball about the entry point that stay free, and of lines of sight', columns, with_, { class: 'small' }));
  }

  criteria() {
    const sorted = [...this.report.criteria].sort((a, b) => Number(a.pass) - Number(b.pass));
    const columns = [
      { title: 'Criterion', cell: (c) => NB.words(c.criterion) },
      { title: 'Goal', cell: (c) => NB.words(c.goal) },
      { title: 'Configuration', cell: (c) => c.label || '' },
      { title: 'Engine', cell: (c) => c.engine || '' },
      { title: 'Value', numeric: true, cell: (c) => NB.quantity(c.value, c.unit) },
      { title: 'Limit', numeric: true, cell: (c) => NB.quantity(c.limit, c.unit) },
      { title: 'Met', cell: (c) => NB.el('span', { class: c.pass ? 'good' : 'bad', text: c.pass ? '\u2713 met' : '\u2717 missed' }) },
      { title: '', cell: (c) => c.detail },
    ];
    const open = this.report.not_judged;
    const unjudged = [
      ...columns.slice(0, 4),
      { title: 'Why it was not judged', cell: (c) => c.reason },
    ];
    return NB.section(`Criteria (${sorted.length}${open.length ? `, ${open.length} not judged` : ''})`, open.length > 0 || sorted.some((each) => !each.pass),
      NB.table('What was checked, missed ones first', columns, sorted, { class: 'small' }),
      open.length ? NB.table('What was to be judged and was not', unjudged, open, { class: 'small' }) : null);
  }

  requirements() {
    const rows = this.report.trace || [];
    const words = { met: '\u2713 met', missed: '\u2717 missed', not_judged: 'not judged' };
    const columns = [
      { title: 'Requirement', cell: (r) => r.requirement },
      { title: 'Criterion', cell: (r) => NB.words(r.criterion) },
      { title: 'Outcome', cell: (r) => NB.el('span', { class: r.outcome === 'met' ? 'good' : 'bad', text: words[r.outcome] }) },
      { title: 'Met', numeric: true, cell: (r) => String(r.met) },
      { title: 'Missed', numeric: true, cell: (r) => String(r.missed) },
      { title: 'Not judged', numeric: true, cell: (r) => String(r.not_judged) },
    ];
    return NB.el('div', null, rows.length
      ? NB.section(`Requirements (${rows.length})`, true,
        NB.table('Requirements, the criteria that stand for them, and how often these were met', columns, rows, { class: 'small' }))
      : null);
  }

  provenance() {
    const { provenance, notes, scenario, truth } = this.report;
    return NB.el('div', null,
      notes.length ? NB.section('Notes', true, NB.el('ul', { class: 'plain' }, notes.map((note) => NB.el('li', { text: note })))) : null,
      truth ? NB.section('The arm and patient that were drawn', false, NB.tree(truth)) : null,
      NB.section('Where the numbers come from', false, NB.provenance(provenance, scenario.file)));
  }
};

/** Lower triangle of a covariance, `L L^T`; what rounding makes negative counts as zero. */
NB.cholesky = function (a) {
  const l = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
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

NB.start((page, app) => { NB.current = new NB.RunPage(page, app); });

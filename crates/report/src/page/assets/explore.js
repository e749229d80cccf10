// Exploratory postures: the arm at any joint positions and base placement, with the clearances there.
// The numbers are the program's own: its code, compiled to WebAssembly, comes with the page.
'use strict';

/** The program's clearances and configurations. Lengths in m, angles in rad unless they say otherwise. */
class Live {
  /** @param {LiveCode} code @param {ExploreData} data */
  constructor(code, data) {
    this.code = code;
    this.data = data;
  }

  /**
   * Rejects where the browser runs no WebAssembly.
   * @param {ExploreData} data
   */
  static async start(data) {
    if (typeof WebAssembly === 'undefined') throw new Error('this browser has no WebAssembly, or it is switched off');
    const { instance } = await WebAssembly.instantiate(NB.array(data.code).slice(), {});
    const live = new Live(/** @type {LiveCode} */ (instance.exports), data);
    const scene = NB.array(data.scene);
    live.bytes(live.code.input(scene.length), scene.length).set(scene);
    if (!live.code.load()) throw new Error('the scene in this page cannot be read');
    return live;
  }

  /** @param {number} at @param {number} count */
  bytes(at, count) {
    return new Uint8Array(this.code.memory.buffer, at, count);
  }

  /** @param {number[]} numbers */
  put(numbers) {
    this.bytes(this.code.input(8 * numbers.length), 8 * numbers.length).set(
      new Uint8Array(Float64Array.from(numbers).buffer),
    );
  }

  /**
   * Rows of so many numbers, of an answer with `count` numbers.
   * @param {number} count
   * @param {number} width
   */
  rows(count, width) {
    const all = new Float64Array(this.code.memory.buffer, this.code.results(), count).slice();
    return Array.from({ length: count / width }, (_, row) => all.subarray(row * width, (row + 1) * width));
  }

  /**
   * Clearance of every pair at joint positions, in the document's order.
   * @param {number[]} joints
   * @returns {LivePair[]}
   */
  pairs(joints) {
    this.put(joints);
    return this.rows(this.code.pairs(), 9).map((row, index) => {
      const [a, b, kind] = this.data.pairs[index];
      return {
        index,
        class: kind,
        bodies: [a, b],
        distance: row[0],
        points: [[...row.subarray(1, 4)], [...row.subarray(4, 7)]],
        solids: [this.solid(a, row[7]), this.solid(b, row[8])],
      };
    });
  }

  /** @param {number} body @param {number} index */
  solid(body, index) {
    return this.data.bodies[body].solids[index];
  }

  /** @param {number[]} joints */
  lowest(joints) {
    this.put(joints);
    return this.code.lowest();
  }

  /**
   * Moves the base: mm, and roll, pitch, yaw in degrees. Returns why its mount cannot carry it there, or null.
   * @param {Point} position
   * @param {number[]} rpy
   */
  placeBase(position, rpy) {
    this.put([...position, ...rpy]);
    const length = this.code.place_base();
    return length ? new TextDecoder().decode(this.bytes(this.code.message(), length)) : null;
  }

  resetBase() {
    this.code.reset_base();
  }

  /** What base and mount stand in. */
  overlaps() {
    return this.rows(this.code.overlaps(), 3).map(([body, other, depth]) => ({
      body: this.data.bodies[body].name,
      other: this.data.bodies[other].name,
      depth,
    }));
  }

  /**
   * All eight configurations at a goal, each at the best of so many rolls.
   * @param {number} goal
   * @param {number} rolls
   * @returns {LivePosture[]}
   */
  reach(goal, rolls) {
    return this.rows(this.code.reach(goal, rolls), 11).map((row, index) => ({
      label: this.data.configurations[index],
      outcome: Live.OUTCOMES[row[0]],
      roll: row[1],
      surplus: row[2],
      joints: Number.isNaN(row[3]) ? null : [...row.subarray(3, 9)],
      pair: Number.isNaN(row[9]) ? null : row[9],
      distance: row[10],
    }));
  }

  mountSurface() {
    return this.rows(this.code.mount_surface(), 9).flatMap((row) => [...row]);
  }

  static OUTCOMES = ['unreachable', 'merged', 'joint_limit', 'singular', 'too_near', 'misses', 'works'];
}

/** Distances in relation to the limit, in colours that people with any colour vision tell apart. */
NB.NEARNESS = [
  { key: 'overlap', words: 'overlapping', color: [0.835, 0.369, 0], radius: 0.004 },
  { key: 'missed', words: 'below the limit', color: [0.902, 0.624, 0], radius: 0.003 },
  { key: 'near', words: 'up to 50 mm above the limit', color: [0.337, 0.706, 0.914], radius: 0.002 },
  { key: 'far', words: 'more than 50 mm above', color: [0.46, 0.46, 0.46], radius: 0.0012 },
];
NB.nearness = (distance, limit) => {
  const asked = limit ?? 0;
  if (distance < Math.min(0, asked)) return NB.NEARNESS[0];
  if (distance < asked) return NB.NEARNESS[1];
  return NB.NEARNESS[distance < asked + 0.05 ? 2 : 3];
};

NB.JOINTS = ['Shoulder pan', 'Shoulder lift', 'Elbow', 'Wrist 1', 'Wrist 2', 'Wrist 3'];

/** The panel, and the arm that it moves. `run` is the page: its view, its arms and what they show. */
class Explore {
  // From the first posture that is tried.
  /** @type {Live} */ live;
  /** @type {ArmView} */ arm;
  /** @type {ArmView} */ from;
  /** @type {Base} */ base;
  /** @type {number[]} */ joints;
  /** @type {number[]} */ fromJoints;
  /** @type {LivePair[]} */ pairs;
  /** @type {LivePair[]} */ least;
  /** @type {LivePosture[]} */ found;
  /** @type {[layer: string, visible: boolean][]} */ were;
  /** @type {HTMLInputElement[]} */ sliders;
  /** @type {HTMLInputElement[]} */ numbers;
  /** @type {{ name: string, unit: string, get: () => number, input: HTMLInputElement }[]} */ baseFields;
  /** @type {HTMLElement} */ problems;
  /** @type {HTMLElement} */ classes;
  /** @type {HTMLElement} */ reached;
  /** @type {HTMLElement} */ text;
  /** @type {HTMLElement} */ copied;

  /** @param {RunPage} run */
  constructor(run) {
    this.run = run;
    this.data = run.page.explore;
    this.view = run.view;
    this.active = false;
    this.open = NB.el('button', { type: 'button', onclick: () => this.enter() }, 'Try a posture');
    this.status = NB.el('span', {
      class: 'soft',
      role: 'status',
      text: 'Jog the joints or move the base to see the clearances.',
    });
    this.bar = NB.el('div', { class: 'bar' }, this.open, this.status);
    this.body = NB.el('div', { hidden: true });
    this.element = NB.el(
      'section',
      { class: 'panel explore no-print', 'aria-label': 'Try a posture' },
      this.bar,
      this.body,
    );
    this.sign = NB.el('p', { class: 'tried-sign', hidden: true, text: 'Exploratory posture, not a result of the run' });
    this.view.element.append(this.sign);
    // What is printed are results.
    window.addEventListener('beforeprint', () => this.leave(), { capture: true });
    this.grabBase();
  }

  async enter() {
    if (this.active) return;
    this.run.pause();
    try {
      this.live ||= await Live.start(this.data);
    } catch (error) {
      this.open.disabled = true;
      this.status.textContent =
        `Clearances cannot be computed here: ${error.message}. Use the command line: ` +
        `${this.command(this.startJoints())}`;
      return;
    }
    if (!this.built) this.build();
    this.active = true;
    this.bar.hidden = true;
    this.body.hidden = false;
    this.were = Explore.RESULTS.map((name) => [name, this.view.group(name).visible]);
    this.from ||= this.view.arm('tried-from', { color: [0.34, 0.71, 0.91], opacity: 0.22 });
    this.arm ||= this.view.arm('tried');
    this.resetAll();
    this.sign.hidden = false;
    // It has the clearance of the run's posture.
    this.run.now.hidden = true;
    this.view.element.classList.add('trying');
    this.applyLayers();
    this.sliders[0].focus();
  }

  /** Back to what the run has shown. */
  leave() {
    if (!this.active) return;
    this.active = false;
    this.live.resetBase();
    this.base = this.homeBase();
    this.placeTied();
    this.bar.hidden = false;
    this.body.hidden = true;
    this.sign.hidden = true;
    this.run.now.hidden = false;
    this.view.element.classList.remove('trying');
    for (const name of ['tried', 'tried-from', 'tried-lines', 'tried-handle']) this.view.group(name).visible = false;
    this.view.empty('tried-lines');
    for (const [name, visible] of this.were) this.view.group(name).visible = visible;
    this.run.applyLayers();
  }

  back() {
    this.leave();
    this.open.focus();
  }

  startJoints() {
    return [...(this.run.joints || this.run.page.start)];
  }

  homeBase() {
    return { position: [...this.data.base.position], rpy: [...this.data.base.rpy] };
  }

  get baseMoved() {
    const home = this.data.base;
    return (
      this.base.position.some((value, k) => value !== home.position[k]) ||
      this.base.rpy.some((value, k) => value !== home.rpy[k])
    );
  }

  build() {
    this.built = true;
    /** @param {number} rad */
    const degrees = (rad) => (rad * 180) / Math.PI;
    /** @param {string} label @param {Attributes<'input'>} attributes @param {(value: number) => void} change */
    const field = (label, attributes, change) =>
      NB.el('input', {
        type: 'number',
        'aria-label': label,
        ...attributes,
        onchange: (event) => {
          if (Number.isFinite(event.target.valueAsNumber)) change(event.target.valueAsNumber);
          else this.write();
        },
      });
    this.sliders = [];
    this.numbers = [];
    const joints = NB.JOINTS.map((name, joint) => {
      const [low, high] = this.data.joints[joint].map(degrees);
      /** @param {number} value */
      const set = (value) => this.setJoint(joint, (Math.min(Math.max(value, low), high) * Math.PI) / 180);
      const ends = { min: low.toFixed(1), max: high.toFixed(1) };
      this.sliders[joint] = NB.el('input', {
        type: 'range',
        ...ends,
        step: '0.5',
        'aria-label': `${name}, degrees`,
        oninput: (event) => set(event.target.valueAsNumber),
      });
      this.numbers[joint] = field(`${name}, degrees, ${ends.min} to ${ends.max}`, { ...ends, step: 'any' }, set);
      return NB.el(
        'div',
        { class: 'joint' },
        NB.el('span', { text: name }),
        this.sliders[joint],
        this.numbers[joint],
        NB.el('span', { class: 'unit', text: '\u00b0' }),
      );
    });
    /** @type {[name: string, unit: string, of: keyof Base, k: number][]} */
    const places = [
      ['x', 'mm', 'position', 0],
      ['y', 'mm', 'position', 1],
      ['height', 'mm', 'position', 2],
      ['roll', '\u00b0', 'rpy', 0],
      ['pitch', '\u00b0', 'rpy', 1],
      ['yaw', '\u00b0', 'rpy', 2],
    ];
    this.baseFields = places.map(([name, unit, of, k]) => {
      const input = field(
        `Base, ${name}, ${unit === 'mm' ? 'millimetres' : 'degrees'}`,
        { step: unit === 'mm' ? '10' : '5' },
        (value) => {
          this.moveBase(() => {
            this.base[of][k] = value;
          });
        },
      );
      return { name, unit, get: () => this.base[of][k], input };
    });
    this.problems = NB.el('div', { role: 'alert' });
    this.classes = NB.el('div');
    this.reached = NB.el('div');
    this.text = NB.el('pre', { class: 'small', tabindex: '0', 'aria-label': 'Command-line equivalent' });
    this.copied = NB.el('span', { class: 'soft', role: 'status' });
    /** @param {string} text @param {() => void} click */
    const button = (text, click, extra = {}) => NB.el('button', { type: 'button', onclick: click, ...extra }, text);
    this.body.append(
      NB.el('p', {
        class: 'tried-note',
        text:
          'This posture is not a result of the run: it is not simulated, and no motion to it is planned or ' +
          'certified. The blue ghost is the posture of the run.',
      }),
      NB.el(
        'div',
        { class: 'bar' },
        button('Back to the run', () => this.back()),
        button('Reset joints', () => this.resetJoints()),
        button('Reset base', () => this.resetBase()),
      ),
      NB.el(
        'div',
        { class: 'explore-grid' },
        NB.el('fieldset', null, NB.el('legend', { text: 'Joints' }), joints),
        NB.el(
          'fieldset',
          null,
          NB.el('legend', { text: 'Base: drag its ring or enter' }),
          NB.el(
            'div',
            { class: 'base-fields' },
            this.baseFields.map(({ name, unit, input }) =>
              NB.el('label', null, NB.el('span', { text: name }), input, NB.el('span', { class: 'unit', text: unit })),
            ),
          ),
        ),
      ),
      this.problems,
      this.classes,
      NB.el(
        'p',
        { class: 'legend small' },
        'Lines and parts: ',
        NB.NEARNESS.map(({ words, color }) =>
          NB.el(
            'span',
            { class: 'nearness' },
            NB.el('span', {
              class: 'swatch',
              style: `background: rgb(${color.map((c) => Math.round(255 * c)).join(' ')})`,
            }),
            words,
          ),
        ),
      ),
      this.reached,
      NB.el('h3', { text: 'Command-line equivalent' }),
      this.text,
      NB.el(
        'div',
        { class: 'bar' },
        button('Copy joints', () => this.copy(this.jointList())),
        button('Copy command', () => this.copy(this.command(this.joints))),
        button('Copy base as TOML', () => this.copy(this.toml())),
        this.copied,
      ),
    );
  }

  resetAll() {
    this.base = this.homeBase();
    this.refused = null;
    this.startHits = null;
    this.live.resetBase();
    this.joints = this.startJoints();
    this.fromJoints = [...this.joints];
    this.placeTied();
    this.write();
    this.evaluate();
    this.lookForConfigurations();
  }

  resetJoints() {
    this.joints = this.startJoints();
    this.write();
    this.evaluate();
  }

  resetBase() {
    this.moveBase(() => {
      this.base = this.homeBase();
    });
  }

  /** @param {number} joint @param {number} value */
  setJoint(joint, value) {
    this.joints[joint] = value;
    this.write(joint);
    this.evaluate();
  }

  /**
   * Moves the base; where its mount cannot carry it, all stays and the reason is said.
   * @param {() => void} change
   */
  moveBase(change) {
    const before = { position: [...this.base.position], rpy: [...this.base.rpy] };
    change();
    let refused = null;
    if (this.baseMoved) refused = this.live.placeBase(this.base.position, this.base.rpy);
    else this.live.resetBase();
    if (refused) this.base = before;
    this.refused = refused;
    this.startHits = this.baseMoved ? this.worstHit(this.run.page.start) : null;
    this.placeTied();
    this.write();
    this.evaluate();
    this.lookForConfigurations();
  }

  /**
   * The deepest overlap at joint positions, of bodies that are not meant to touch; null for none.
   * @param {number[]} joints
   * @returns {LivePair | null}
   */
  worstHit(joints) {
    const hits = this.live.pairs(joints).filter((pair) => pair.distance < 0 && this.data.classes[pair.class].unwanted);
    return hits.reduce(
      (worst, pair) => (worst && worst.distance <= pair.distance ? worst : pair),
      /** @type {LivePair | null} */ (null),
    );
  }

  /**
   * Writes the state into the controls; a joint's own control is being moved.
   * @param {number | null} [moved]
   */
  write(moved = null) {
    this.joints.forEach((q, joint) => {
      const degrees = (q * 180) / Math.PI;
      if (joint !== moved || document.activeElement !== this.sliders[joint])
        this.sliders[joint].value = String(degrees);
      this.numbers[joint].value = degrees.toFixed(2);
    });
    for (const { get, input } of this.baseFields) input.value = String(Number(get().toFixed(3)));
  }

  get goalIndex() {
    return this.run.goalIndex;
  }

  pose() {
    const [x, y, z] = this.base.position.map((mm) => mm * 1e-3);
    const [roll, pitch, yaw] = this.base.rpy.map((deg) => (deg * Math.PI) / 180);
    const turn = new THREE.Matrix4()
      .makeRotationZ(yaw)
      .multiply(new THREE.Matrix4().makeRotationY(pitch))
      .multiply(new THREE.Matrix4().makeRotationX(roll));
    return this.baseMoved ? turn.setPosition(x, y, z) : NB.matrix(this.run.page.scene.chain.base);
  }

  chain() {
    const pose = this.pose();
    const [at, turn] = [
      new THREE.Vector3().setFromMatrixPosition(pose),
      new THREE.Quaternion().setFromRotationMatrix(pose),
    ];
    return { ...this.run.page.scene.chain, base: [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w] };
  }

  /** Base, mount and what is bolted to them go along. */
  placeTied() {
    const { view } = this;
    if (!view.works) return;
    const delta = this.pose().clone().multiply(NB.matrix(this.run.page.scene.chain.base).invert());
    const moved = this.baseMoved;
    this.arm.stand(delta);
    view.empty('tried-mount');
    for (const { mesh, group } of view.tied) {
      mesh.visible = !(moved && group === 'mount');
      mesh.matrixAutoUpdate = false;
      mesh.matrix.copy(moved ? delta : new THREE.Matrix4());
      mesh.updateMatrixWorld(true);
    }
    if (moved) {
      const corners = this.live.mountSurface();
      if (corners.length) {
        const color = view.scene.parts.find((part) => part.group === 'mount')?.color.slice(0, 3) || [0.5, 0.5, 0.5];
        // Walls and ceilings, which would hide the cell, are faint: they have the large triangles.
        /** @type {number[][]} */
        const parts = [[], []];
        for (let at = 0; at < corners.length; at += 9) {
          const [a, b, c] = [0, 3, 6].map((k) => new THREE.Vector3().fromArray(corners, at + k));
          const area = b.sub(a).cross(c.sub(a)).length() / 2;
          parts[area > 0.12 ? 1 : 0].push(...corners.slice(at, at + 9));
        }
        parts.forEach((part, isFaint) => {
          const geometry = new THREE.BufferGeometry();
          geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(part), 3));
          geometry.computeVertexNormals();
          const mesh = new THREE.Mesh(geometry, view.material([...color, isFaint ? 0.12 : 1]));
          mesh.renderOrder = isFaint ? 10 : 0;
          view.group('tried-mount').add(mesh);
        });
      }
    }
    view.group('tried-mount').visible = this.active && this.run.layers.mount;
    this.drawHandle();
  }

  /** Computes this posture and shows it. */
  evaluate() {
    const started = performance.now();
    const pairs = this.live.pairs(this.joints);
    this.computedInMs = performance.now() - started;
    this.pairs = pairs;
    /** @type {Map<number, LivePair>} */
    const least = new Map();
    for (const pair of pairs)
      if (pair.distance < (least.get(pair.class)?.distance ?? Infinity)) least.set(pair.class, pair);
    this.least = [...least.values()].sort((a, b) => a.class - b.class);
    this.showClasses();
    this.showProblems();
    this.text.textContent = [this.baseMoved ? this.toml() : null, this.command(this.joints)]
      .filter(Boolean)
      .join('\n\n');
    this.draw();
    this.evaluatedInMs = performance.now() - started;
  }

  showProblems() {
    const low = this.live.lowest(this.joints);
    const lines = [
      this.refused ? `Invalid base placement: ${this.refused}.` : null,
      ...this.live
        .overlaps()
        .map(
          ({ body, other, depth }) => `The ${NB.words(body)} overlaps the ${NB.words(other)} by ${NB.mm(depth)} mm.`,
        ),
      this.startHits
        ? 'With this base, the start posture of the scenario collides: ' +
          `${this.startHits.solids.map(NB.words).join(' and ')} overlap by ${NB.mm(-this.startHits.distance)} mm. ` +
          'Set another one under [start].'
        : null,
      low < -0.001 ? `The arm reaches ${NB.mm(-low)} mm below the floor.` : null,
    ].filter(Boolean);
    const text = lines.join(' ');
    // Said once, and not at every step of a drag.
    if (this.problems.textContent !== text)
      NB.clear(
        this.problems,
        lines.map((line) => NB.el('p', { class: 'error', text: line })),
      );
  }

  /** @param {LivePair} pair */
  limit(pair) {
    return this.data.classes[pair.class].judged;
  }

  showClasses() {
    /** @param {LivePair} pair */
    const name = (pair) => this.data.classes[pair.class].name;
    /** @type {Column<LivePair>[]} */
    const columns = [
      { title: 'Class', cell: (pair) => NB.words(name(pair)) },
      {
        title: 'Clearance',
        unit: 'mm',
        numeric: true,
        cell: (pair) => NB.mm(pair.distance),
        help: 'negative: penetration',
      },
      {
        title: 'Limit',
        unit: 'mm',
        numeric: true,
        cell: (pair) => NB.mm(this.limit(pair)),
        help: 'limit of the scenario\u2019s criterion, otherwise of its planning',
      },
      { title: 'Result', cell: (pair) => this.judgement(pair.distance, this.limit(pair)) },
      { title: 'Pair', cell: (pair) => pair.solids.map(NB.words).join(' and ') },
    ];
    NB.clear(
      this.classes,
      NB.table('Clearance of this posture by class; no motion is certified', columns, this.least, {
        class: 'small full',
      }),
    );
  }

  /** @param {number} distance @param {number | null} limit */
  judgement(distance, limit) {
    if (limit === null) return NB.el('span', { class: 'soft', text: 'no limit' });
    return distance >= limit
      ? NB.el('span', { class: 'good', text: '\u2713 satisfied' })
      : NB.el('span', { class: 'bad', text: distance < 0 ? '\u2717 collides' : '\u2717 too close' });
  }

  draw() {
    const { view } = this;
    if (!view.works) return;
    this.arm.pose(this.chain(), this.joints);
    this.from.pose(this.run.page.scene.chain, this.fromJoints);
    this.tint();
    view.empty('tried-lines');
    const labelled = new Set(this.least.map((pair) => pair.index));
    for (const pair of this.pairs) {
      const nearness = NB.nearness(pair.distance, this.limit(pair));
      const unwanted = this.data.classes[pair.class].unwanted;
      if (!labelled.has(pair.index) && (!unwanted || nearness.key === 'far')) continue;
      const [from, to] = pair.points;
      view.rod('tried-lines', from, to, nearness.radius, [...nearness.color, 1], true);
      if (nearness.key === 'far') continue;
      for (const point of pair.points)
        view.ball('tried-lines', point, 2 * nearness.radius, [...nearness.color, 1], true);
      if (!labelled.has(pair.index)) continue;
      const middle = from.map((value, k) => (value + to[k]) / 2);
      view.label('tried-lines', `${pair.solids.map(NB.words).join(' and ')}: ${NB.mm(pair.distance)} mm`, middle);
    }
    view.group('tried-lines').visible = true;
    view.draw();
  }

  /** Colours the links by their closest pair. */
  tint() {
    const worst = new Map();
    for (const pair of this.pairs) {
      if (!this.data.classes[pair.class].unwanted) continue;
      const rank = NB.NEARNESS.indexOf(NB.nearness(pair.distance, this.limit(pair)));
      for (const body of pair.bodies) {
        const { link, kind } = this.data.bodies[body];
        if (link === null) continue;
        const frame = kind === 'link' ? link : 6;
        worst.set(frame, Math.min(rank, worst.get(frame) ?? 3));
      }
    }
    this.arm.tint((frame) => {
      const rank = worst.get(frame) ?? 3;
      return rank < 2 ? NB.NEARNESS[rank].color : null;
    });
  }

  /**
   * Which configurations are feasible from here: at once with few rolls, where that is quick, and again with many
   * when all rests.
   */
  lookForConfigurations() {
    if (!((this.coarseInMs ?? 0) > Explore.COARSE_MS)) {
      this.showReach(6, false);
      this.coarseInMs = this.reachedInMs;
    } else {
      // What is shown is of another place: none of it can be used.
      this.reached.dataset.rolls = 'of another place';
      for (const button of this.reached.querySelectorAll('button')) button.disabled = true;
    }
    clearTimeout(this.later);
    this.later = setTimeout(() => {
      if (this.active) this.showReach(Explore.ROLLS, true);
    }, 200);
  }

  /** @param {number} rolls @param {boolean} isLast */
  showReach(rolls, isLast) {
    const { free, fromBase } = this.data.goals[this.goalIndex];
    const started = performance.now();
    this.found = this.live.reach(this.goalIndex, rolls);
    this.reachedInMs = performance.now() - started;
    if (!this.found.length) return;
    /** @type {{ [outcome: string]: [style: string, words: string] }} */
    const words = {
      works: ['good', '\u2713 feasible'],
      misses: ['bad', '\u2717 criterion failed'],
      too_near: ['bad', '\u2717 too close'],
      singular: ['bad', '\u2717 singular posture'],
      joint_limit: ['off', '\u2013 beyond a joint limit'],
      merged: ['off', '\u2013 coincides with another'],
      unreachable: ['off', '\u2013 out of reach'],
    };
    /** @param {LivePosture} posture */
    const between = ({ pair, distance }) => {
      if (pair === null) return '';
      const [a, b] = this.data.pairs[pair].slice(0, 2).map((body) => NB.words(this.data.bodies[body].name));
      return `${a} and ${b}, ${NB.mm(distance)} mm`;
    };
    /** @type {Column<LivePosture>[]} */
    const columns = [
      { title: 'Configuration', cell: (each) => each.label },
      {
        title: 'Final posture',
        cell: (each) => NB.el('span', { class: words[each.outcome][0], text: words[each.outcome][1] }),
      },
      { title: 'Closest to its limit', cell: between },
      { title: 'Roll', unit: '\u00b0', numeric: true, cell: (each) => (each.joints ? NB.deg(each.roll, 0) : '\u2013') },
      {
        title: 'Posture',
        cell: (each) =>
          NB.el(
            'button',
            {
              type: 'button',
              disabled: !each.joints,
              'aria-label': `Use the posture of ${each.label}`,
              onclick: () => this.take(each),
            },
            'Use',
          ),
      },
    ];
    const count = this.found.filter((each) => each.outcome === 'works').length;
    const at = free ? 'the best roll found' : 'the roll fixed by the goal';
    const table = NB.table(
      `Goal ${NB.words(this.run.goal.name)}: ${count} of ${this.found.length} postures satisfy all limits at ${at}`,
      columns,
      this.found,
      { class: 'small full' },
    );
    const note = fromBase
      ? NB.el('p', {
          class: 'small',
          text:
            'On this page the goal is fixed in the room. The scenario defines it from the robot\u2019s base ' +
            '(flange_pose), so there it moves with the base: define its target and entry in the room before you ' +
            'move the base.',
        })
      : null;
    // A button that has the focus keeps it.
    const focused = [...this.reached.querySelectorAll('button')].findIndex((each) => each.matches(':focus'));
    NB.clear(this.reached, NB.el('h3', { text: 'Configurations from this base' }), table, note);
    if (focused >= 0) this.reached.querySelectorAll('button')[focused]?.focus();
    this.reached.dataset.rolls = isLast ? 'all' : 'few';
  }

  /** @param {LivePosture} posture */
  take({ joints }) {
    if (joints) this.joints = [...joints];
    this.write();
    this.evaluate();
  }

  jointList() {
    return this.joints.map((q) => String(q)).join(',');
  }

  /** @param {number[]} joints */
  command(joints) {
    return `needlebench clearance ${this.run.report.scenario.file} --joints ${joints.join(',')}`;
  }

  toml() {
    /** @param {number[]} values */
    const list = (values) => `[${values.map((value) => Number(value.toFixed(6))).join(', ')}]`;
    return `[robot]\nbase_position_mm = ${list(this.base.position)}\nbase_rpy_deg = ${list(this.base.rpy)}`;
  }

  /** @param {string} text */
  async copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      this.copied.textContent = 'copied';
    } catch {
      // Not allowed here: the text itself, to be copied by hand.
      const range = document.createRange();
      this.text.textContent = text;
      range.selectNodeContents(this.text);
      getSelection()?.removeAllRanges();
      getSelection()?.addRange(range);
      this.copied.textContent = 'selected, copy with Ctrl+C';
    }
    clearTimeout(this.copiedUntil);
    this.copiedUntil = setTimeout(() => {
      this.copied.textContent = '';
    }, 4000);
  }

  /** The run's layers, without the results of the run. */
  applyLayers() {
    if (!this.active) return;
    const { view, run } = this;
    for (const name of Explore.RESULTS) view.group(name).visible = false;
    for (const name of ['tried', 'tried-from', 'tried-lines', 'tried-handle']) view.group(name).visible = true;
    view.group('tried-mount').visible = run.layers.mount;
    for (const name of ['robot', 'tool', 'collision', 'corridor']) this.arm.layer(name, run.layers[name]);
    view.draw();
  }

  // The ring at the base's foot.
  drawHandle() {
    const { view } = this;
    view.empty('tried-handle');
    const [x, y, z] = new THREE.Vector3().setFromMatrixPosition(this.pose()).toArray();
    const [around, inner, outer] = [64, Explore.RING - 0.02, Explore.RING];
    const positions = [];
    for (let step = 0; step < around; step++) {
      const [a, b] = [step, step + 1].map((k) => (2 * Math.PI * k) / around);
      /** @param {number} radius @param {number} angle */
      const at = (radius, angle) => [x + radius * Math.cos(angle), y + radius * Math.sin(angle), z];
      positions.push(
        ...at(inner, a),
        ...at(outer, a),
        ...at(outer, b),
        ...at(inner, a),
        ...at(outer, b),
        ...at(inner, b),
      );
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
    const material = view.marked(
      new THREE.MeshBasicMaterial({ color: 0x0072b2, opacity: 0.8, transparent: true, side: THREE.DoubleSide }),
    );
    const ring = new THREE.Mesh(geometry, material);
    ring.renderOrder = 31;
    view.add('tried-handle', ring);
    view.group('tried-handle').visible = this.active;
  }

  /**
   * Where a pointer is on the level of the base, m; null where the view is along it.
   * @param {PointerEvent} event
   */
  under(event) {
    const { view } = this;
    const box = view.renderer.domElement.getBoundingClientRect();
    const far = new THREE.Vector3(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
      0.5,
    ).unproject(view.camera);
    const eye = view.camera.position;
    const way = far.sub(eye).normalize();
    if (Math.abs(way.z) < 0.03) return null;
    const along = (this.base.position[2] * 1e-3 - eye.z) / way.z;
    return along > 0 ? [eye.x + along * way.x, eye.y + along * way.y] : null;
  }

  /** @param {PointerEvent} event */
  isOnRing(event) {
    const at = this.active ? this.under(event) : null;
    if (!at) return false;
    const [x, y] = this.base.position.map((mm) => mm * 1e-3);
    return Math.hypot(at[0] - x, at[1] - y) <= Explore.RING + 0.01;
  }

  grabBase() {
    if (!this.view.works) return;
    const canvas = this.view.renderer.domElement;
    /**
     * @param {'pointerdown' | 'pointermove' | 'pointerup' | 'pointercancel'} type
     * @param {(event: PointerEvent) => void} handle
     */
    const listen = (type, handle) => this.view.element.addEventListener(type, handle, { capture: true });
    /** @type {number[] | null} */
    let held = null;
    listen('pointerdown', (event) => {
      if (event.target !== canvas || event.button !== 0 || !this.isOnRing(event)) return;
      const at = this.under(event);
      if (!at) return;
      const [x, y] = at;
      held = [x * 1e3 - this.base.position[0], y * 1e3 - this.base.position[1]];
      canvas.setPointerCapture(event.pointerId);
      canvas.focus();
      // The view is not turned.
      event.stopImmediatePropagation();
    });
    listen('pointermove', (event) => {
      if (!this.active) return;
      canvas.style.cursor = held ? 'grabbing' : this.isOnRing(event) ? 'grab' : '';
      if (!held) return;
      event.stopImmediatePropagation();
      const at = this.under(event);
      if (!at || this.asked) return;
      // Once before the next frame, however often the pointer moves.
      this.asked = requestAnimationFrame(() => {
        this.asked = 0;
        if (this.active)
          this.moveBase(() =>
            at.forEach((value, k) => {
              this.base.position[k] = Math.round(value * 1e3 - held0[k]);
            }),
          );
      });
      const held0 = held;
    });
    for (const type of /** @type {const} */ (['pointerup', 'pointercancel'])) {
      listen(type, (event) => {
        if (!held) return;
        held = null;
        canvas.style.cursor = '';
        event.stopImmediatePropagation();
      });
    }
  }

  /** Layers that show results of the run. */
  static RESULTS = ['arm', 'other', 'witness', 'ellipsoids', 'cone', 'sight', 'taken'];
  /**
   * Rolls that are checked when all rests, time limit of a check of fewer while the base moves (ms), and radius of
   * the ring (m).
   */
  static ROLLS = 36;
  static COARSE_MS = 10;
  static RING = 0.17;
}

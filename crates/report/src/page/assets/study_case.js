// A case of a study in three dimensions: the arm, and what stands about it in that case.
'use strict';

class CaseScene {
  /** `page` is the document; its `looks` say which tool and which things each posed case has, and where. */
  constructor(page) {
    const { scene, looks } = page;
    this.page = page;
    this.looks = looks;
    const codes = (name) => NB.array(looks[name]);
    [this.arms, this.toolOf, this.thingCodes, this.places, this.bases, this.targets] = [
      'arms',
      'toolOf',
      'things',
      'places',
      'bases',
      'targets',
    ].map(codes);
    // Every tool is fixed to the flange; that of the case alone is seen.
    const tools = looks.tools.flatMap((tool, at) => tool.parts.map((part) => ({ ...part, group: `tool@${at}` })));
    this.view = new View({ ...scene, parts: [...scene.parts, ...tools] }, 'Posture of the chosen configuration');
    this.view.element.classList.add('case-view');
    this.arm = this.view.arm('arm');
    this.gantry = NB.checkbox('gantry', false, () => this.again());
    this.skin = NB.checkbox('skin', true, () => this.again());
    this.note = NB.el('p', { class: 'soft small', role: 'status' });
    this.element = NB.el(
      'div',
      { class: 'panel' },
      this.view.element,
      NB.el(
        'div',
        { class: 'legend no-print', role: 'group', 'aria-label': 'Parts of the picture' },
        this.gantry,
        this.skin,
      ),
      this.note,
    );
    this.made = new Map();
  }

  again() {
    if (this.last) this.show(...this.last);
  }

  /** `at` is the place of the case among the posed ones, none of one without postures; joints in radians. */
  show(at, joints, title, about = null) {
    this.last = [at, joints, title, about];
    const has = Boolean(joints) && joints.every((value) => !Number.isNaN(value));
    const known = at !== undefined && !Number.isNaN(this.bases[7 * at]);
    const own = known && this.arms[at] === 1;
    const tool = known ? this.toolOf[at] : 255;
    const hasTool = tool < this.looks.tools.length;
    this.note.textContent = this.words(at, title, { has, known, own, hasTool });
    if (!this.view.works) return;
    for (const each of this.looks.tools.keys()) this.arm.layer(`tool@${each}`, each === tool);
    this.arm.show(has && own);
    this.view.empty('needle');
    this.missing = 0;
    this.things(at, known);
    if (has && own) this.posture(at, joints, hasTool ? tool : null);
    if (known && !this.framed) this.frame(at);
    this.view.draw();
  }

  posture(at, joints, tool) {
    const chain = { ...this.page.scene.chain, base: Array.from(this.bases.subarray(7 * at, 7 * at + 7)) };
    this.arm.pose(chain, joints);
    if (tool === null) return;
    const flange = NB.forward(chain, joints)[6];
    const [entry, exit] = this.looks.tools[tool].guide.map((pose) =>
      new THREE.Vector3(pose[0], pose[1], pose[2]).applyMatrix4(flange).toArray(),
    );
    const target = Array.from(this.targets.subarray(3 * at, 3 * at + 3));
    // From behind the guide to the target.
    const behind = entry.map((value, k) => value + 0.6 * (value - exit[k]));
    this.view.rod('needle', behind, Number.isNaN(target[0]) ? exit : target, 0.0012, [0, 0.45, 0.32, 1], true);
    if (!Number.isNaN(target[0])) this.view.ball('needle', target, 0.004, [0.84, 0.37, 0, 1], true);
  }

  /** The things of a case, each where it stands in it. */
  things(at, known) {
    const { slots, kinds } = this.looks;
    for (const group of this.made.values()) group.visible = false;
    if (!known) return;
    for (let slot = 0; slot < slots; slot++) {
      const kind = this.thingCodes[slots * at + slot];
      if (kind === 254) continue;
      if (kind >= kinds.length) {
        this.missing++;
        continue;
      }
      const group = this.thing(slot, kind);
      group.visible = true;
      group.matrix.copy(NB.matrix(this.places.subarray(7 * (slots * at + slot), 7 * (slots * at + slot) + 7)));
      group.matrixWorldNeedsUpdate = true;
      for (const mesh of group.children) {
        const hidden = { gantry: this.gantry, skin: this.skin }[mesh.name];
        mesh.visible = !hidden || hidden.querySelector('input').checked;
      }
    }
    if (this.missing)
      this.note.textContent +=
        ` ${this.missing} of the things that stand about the arm in this case are not on the page, and are not ` +
        'drawn.';
  }

  /** The surfaces of a kind in a slot, made when they are first seen. */
  thing(slot, kind) {
    const key = `${slot}:${kind}`;
    if (!this.made.has(key)) {
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      for (const part of this.looks.kinds[kind]) {
        const mesh = this.view.surface(part.surface, part.color);
        mesh.name = part.group;
        mesh.renderOrder = part.color[3] < 1 ? (part.group === 'skin' ? 20 : 10) : 0;
        group.add(mesh);
      }
      this.view.add('things', group);
      this.made.set(key, group);
    }
    return this.made.get(key);
  }

  /** Looks at arm and target from where the robot's side is seen. */
  frame(at) {
    this.framed = true;
    const base = Array.from(this.bases.subarray(7 * at, 7 * at + 7));
    const target = Array.from(this.targets.subarray(3 * at, 3 * at + 3));
    const near = Number.isNaN(target[0]) ? [] : [target.map((v) => v - 0.25), target.map((v) => v + 0.25)];
    this.view.frame(
      [...NB.aboutBase(base, 0.5), ...near],
      near.length ? NB.direction(base, target, [0, 0, -1]) : [-0.75, 0.45, -0.55],
    );
  }

  words(at, title, { has, known, own, hasTool }) {
    if (at === undefined)
      return (
        'The posture of this case is not on the page (it holds some thousand): ' +
        'the command beside it makes it anew.'
      );
    if (!known) return 'This layout cannot exist: there is nothing to draw.';
    if (!own) return 'This case has another arm than the page holds: it is not drawn. --run makes a page of it.';
    if (!has) return `${title} has no posture. Patient and surroundings are those of this case.`;
    return (
      `${title}. Arm${hasTool ? ', tool' : ''}, patient and all that stands about them are those of this case, ` +
      `where they stand in it.${hasTool ? '' : ' Its tool is not on the page, and is not drawn.'}`
    );
  }
}

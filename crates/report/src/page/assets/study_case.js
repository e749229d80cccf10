// A case of a study in three dimensions: the arm, and its surroundings in that case.
'use strict';

class CaseScene {
  /** @type {[at: number | undefined, joints: number[] | null, title: string]} */ last;

  /**
   * `looks` say which tool and which things each posed case has, and where.
   * @param {Scene} scene
   * @param {Looks} looks
   */
  constructor(scene, looks) {
    this.scene = scene;
    this.looks = looks;
    this.arms = NB.array(looks.arms);
    this.toolOf = NB.array(looks.toolOf);
    this.thingCodes = NB.array(looks.things);
    this.places = NB.array(looks.places);
    this.bases = NB.array(looks.bases);
    this.targets = NB.array(looks.targets);
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
    /** @type {Map<string, THREE.Group>} */
    this.made = new Map();
    this.missing = 0;
  }

  again() {
    if (this.last) this.show(...this.last);
  }

  /**
   * `at` is the place of the case among the posed ones, none of one without postures; joints in radians.
   * @param {number | undefined} at
   * @param {number[] | null} joints
   * @param {string} title
   */
  show(at, joints, title) {
    this.last = [at, joints, title];
    const posed = joints?.every((value) => !Number.isNaN(value)) ? joints : null;
    const has = Boolean(posed);
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
    this.things(known ? at : undefined);
    if (posed && own) this.posture(at, posed, hasTool ? tool : null);
    if (known && !this.framed) this.frame(at);
    this.view.draw();
  }

  /** @param {number} at @param {number[]} joints @param {number | null} tool */
  posture(at, joints, tool) {
    const chain = { ...this.scene.chain, base: Array.from(this.bases.subarray(7 * at, 7 * at + 7)) };
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

  /**
   * The things of a case, each where it stands in it.
   * @param {number | undefined} at
   */
  things(at) {
    const { slots, kinds } = this.looks;
    for (const group of this.made.values()) group.visible = false;
    if (at === undefined) return;
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
        const hidden = mesh.name === 'gantry' ? this.gantry : mesh.name === 'skin' ? this.skin : null;
        mesh.visible = !hidden || hidden.control.checked;
      }
    }
    if (this.missing)
      this.note.textContent += ` ${this.missing} objects of this case are not stored on the page and not shown.`;
  }

  /**
   * The surfaces of a kind in a slot, made when they are first seen.
   * @param {number} slot
   * @param {number} kind
   */
  thing(slot, kind) {
    const key = `${slot}:${kind}`;
    let group = this.made.get(key);
    if (!group) {
      group = new THREE.Group();
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
    return group;
  }

  /**
   * Looks at arm and target from where the robot's side is seen.
   * @param {number} at
   */
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

  /**
   * @param {number | undefined} at
   * @param {string} title
   * @param {{ has: boolean, known: boolean, own: boolean, hasTool: boolean }} what
   */
  words(at, title, { has, known, own, hasTool }) {
    if (at === undefined)
      return 'This page does not store the posture of this case; recompute it with the command shown.';
    if (!known) return 'Invalid layout: nothing to show.';
    if (!own) return 'This case has another arm than this page and is not shown; --run makes a page of it.';
    if (!has) return `${title} has no posture. Patient and surroundings are placed as in this case.`;
    return (
      `${title}. Arm${hasTool ? ', tool' : ''}, patient and surroundings are placed as in this case.` +
      `${hasTool ? '' : ' Its tool is not stored on the page and not shown.'}`
    );
  }
}

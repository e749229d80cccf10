// Free space, line of sight and hand cone of the chosen configuration.
'use strict';

class People {
  /** @param {Planner} planner */
  constructor(planner) {
    this.planner = planner;
    this.latest = new Latest('people', (answer) => this.answered(answer));
    /** @type {PeopleAnswer | null} */
    this.answer = null;
    this.text = NB.el('div');
    /** @type {{ [layer: string]: boolean }} */
    this.layers = { people: false, cone: false };
    this.boxes = NB.el(
      'span',
      { class: 'layers', hidden: true },
      Object.entries({ people: 'people and line of sight', cone: 'hand cone' }).map(([layer, words]) =>
        NB.checkbox(words, false, (shown) => {
          this.layers[layer] = shown;
          this.draw();
        }),
      ),
    );
  }

  /**
   * Of a posture at the needle; none while there is no motion to it.
   * @param {number[] | null} joints
   */
  ask(joints) {
    this.forget();
    if (joints) this.latest.ask({ aim: this.planner.aim(), joints_rad: joints });
  }

  forget() {
    this.latest.forget();
    if (!this.answer) return;
    this.answer = null;
    this.show();
  }

  /** @param {Answered<PeopleAnswer>} answer */
  answered(answer) {
    if (answer.problem) {
      this.planner.complain(answer.problem);
      return;
    }
    this.answer = answer.refused ? null : answer;
    this.show();
  }

  show() {
    this.boxes.hidden = !this.answer;
    this.draw();
    if (!this.answer) {
      NB.clear(this.text);
      return;
    }
    const { room } = this.answer;
    const regions = Object.entries(room.regions).map(
      ([name, share]) => `${NB.regionWords[name] || NB.words(name)} ${NB.percent(share)}`,
    );
    const table = NB.table(
      'Line of sight to the entry and to the needle behind the guide, past arm and tool',
      [
        { title: 'Person', cell: (each) => each.person_in_words },
        { title: 'Entry', unit: '%', numeric: true, cell: (each) => NB.percent(each.entry_fraction) },
        { title: 'Needle', unit: '%', numeric: true, cell: (each) => NB.percent(each.needle_fraction) },
        {
          title: '\u00b1',
          unit: '%',
          numeric: true,
          cell: (each) => NB.fixed(100 * each.accuracy, 1),
          help: 'half-width of the 95 % CI of the mean of both',
        },
        { title: 'Blocked by', text: true, cell: (each) => (each.blocker ? NB.words(each.blocker) : '') },
      ],
      room.sight,
      { class: 'small' },
    );
    const seen = room.sight.map(
      (each) => `${each.person_in_words} ${NB.percent(each.entry_fraction)}, ${NB.percent(each.needle_fraction)}`,
    );
    NB.clear(
      this.text,
      NB.el('p', {
        text:
          `Free space: ${NB.percent(room.free_fraction)} % of the hemisphere of 0.35 m about the ` +
          `entry${regions.length ? ` (${regions.join(', ')})` : ''}. Hand cone: ` +
          `half-angle ${NB.deg(room.hand_cone_half_angle_rad)}\u00b0` +
          `${room.hand_cone_blocker ? `, limited by ${NB.words(room.hand_cone_blocker)}` : ''}. Elbow ` +
          `${room.elbow_up ? 'up' : 'down'}.`,
      }),
      NB.el('div', { class: 'no-print' }, table),
      NB.el('p', {
        class: 'print-only',
        text: `Line of sight past arm and tool, % of the entry and of the needle behind the guide: ${seen.join('; ')}.`,
      }),
    );
  }

  draw() {
    const { view } = this.planner.room;
    if (!view.works) return;
    const { view: shown, room } = this.answer || {};
    view.people(shown && this.layers.people ? shown.people : []);
    view.sight(shown && this.layers.people ? shown.sight : []);
    if (shown && room && this.layers.cone)
      view.handCone(shown.guideEntry, room.hand_cone_half_angle_rad, room.hand_cone_length_m);
    else view.empty('cone');
    view.draw();
  }
}

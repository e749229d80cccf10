// A plan that is saved, run in the background by the server, and its report.
'use strict';

/** Goals that a plan does not include. */
PLAN.withoutGoals = (leftOut) =>
  leftOut.length ? ` Not included: ${leftOut.map(NB.words).join(', ')} (no entry chosen).` : '';

class Simulation {
  // Where the position of the robot is known.
  /** @type {HTMLButtonElement} */ startButton;
  /** @type {HTMLButtonElement} */ cancelButton;
  /** @type {HTMLAnchorElement} */ reportLink;

  /** @param {Planner} planner */
  constructor(planner) {
    this.planner = planner;
    this.engine = 'both';
    this.isPlan = false;
    this.running = false;
    this.said = NB.el('p', { role: 'status', class: 'break' });
    if (planner.facts.robot_is_unknown) {
      this.element = this.panel(NB.el('p', { text: 'Not available: the position of the robot is unknown.' }));
      return;
    }
    this.startButton = NB.el(
      'button',
      { type: 'button', disabled: true, onclick: () => this.start() },
      'Save and simulate',
    );
    this.cancelButton = NB.el(
      'button',
      {
        type: 'button',
        disabled: true,
        onclick: async () => this.told(await PLAN.ask('simulation', { method: 'DELETE' })),
      },
      'Cancel',
    );
    this.reportLink = NB.el(
      'a',
      { href: '/results/report.html', target: '_blank', rel: 'noopener', hidden: true },
      'Open the report',
    );
    this.element = this.panel(
      NB.select(
        'Engines',
        [
          ['both', 'rapier and MuJoCo'],
          ['rapier', 'rapier only'],
        ],
        this.engine,
        (value) => {
          this.engine = value;
        },
      ),
      NB.el('div', { class: 'tabs' }, this.startButton, this.cancelButton),
      this.said,
      this.reportLink,
    );
    PLAN.ask('simulation').then(
      (progress) => this.told(progress, true),
      () => {},
    );
  }

  /** @param {...Child} parts */
  panel(...parts) {
    return NB.el('section', { class: 'panel no-print' }, NB.el('h2', { text: 'Simulation' }), parts);
  }

  /**
   * Whether there is a plan that can be run.
   * @param {boolean} isPlan
   */
  allow(isPlan) {
    this.isPlan = isPlan;
    if (this.startButton) this.startButton.disabled = !isPlan || this.running;
  }

  async start() {
    this.startButton.disabled = true;
    try {
      this.told(await PLAN.write('simulation', { ...this.planner.plan(), engine: this.engine }, this.said));
    } catch (error) {
      this.said.textContent = `${error.message}${error.hint ? ` (${error.hint})` : ''}`;
      this.said.className = 'bad break';
      this.startButton.disabled = false;
    }
  }

  /** @param {SimulationProgress} progress @param {boolean} [quiet] */
  told(progress, quiet = false) {
    this.running = progress.state === 'running';
    this.allow(this.isPlan);
    this.cancelButton.disabled = !this.running;
    // The cookie that opens the report is of the page that simulated.
    this.reportLink.hidden = quiet || !progress.has_report;
    if (progress.state !== 'none') {
      const words = { running: 'running', finished: 'finished', failed: 'failed', cancelled: 'cancelled' }[
        progress.state
      ];
      this.said.textContent = `${progress.plan} ${words}: ${progress.message}${PLAN.withoutGoals(progress.left_out)}`;
      this.said.className = progress.state === 'failed' ? 'bad break' : 'break';
    }
    if (this.running)
      setTimeout(async () => {
        try {
          this.told(await PLAN.ask('simulation'));
        } catch (error) {
          this.planner.complain(error);
        }
      }, 500);
  }
}

// The page's requests to its server, and how it waits for answers.
'use strict';

const PLAN = /** @type {Planning} */ ({});

/** The secret of the address, which browsers do not send. */
PLAN.token = location.hash.slice(1);

/** An error answer: what is wrong, and what to do. */
class Problem extends Error {
  /** @param {number} status @param {ProblemBody} body */
  constructor(status, body) {
    super(body.error || `the server answered with status ${status}`);
    this.status = status;
    this.hint = body.hint || '';
    this.body = body;
  }
}

PLAN.fetch = async (path, options = {}) => {
  /** @type {{ [name: string]: string }} */
  const headers = { authorization: `Bearer ${PLAN.token}` };
  if (options.body !== undefined) headers['content-type'] = 'application/json';
  let response;
  try {
    response = await fetch(`/api/${path}`, {
      method: options.method || (options.body === undefined ? 'GET' : 'POST'),
      headers,
      body: options.body === undefined ? undefined : JSON.stringify(options.body),
      cache: 'no-store',
    });
  } catch {
    throw new Problem(0, {
      error: 'the server does not answer',
      hint: 'start `needlebench view` again and open the address that it prints; the saved session is restored',
    });
  }
  if (!response.ok) {
    /** @type {ProblemBody} */
    let body = {};
    try {
      body = await response.json();
    } catch {
      /* no sentence */
    }
    throw new Problem(response.status, body);
  }
  return response;
};

PLAN.ask = async (path, options) => (await PLAN.fetch(path, options)).json();

/** Asks a question at a place of the page; which of the answers was chosen. */
PLAN.question = (at, text, answers) =>
  new Promise((resolve) => {
    at.className = 'bad';
    const buttons = answers.map((answer, index) =>
      NB.el('button', { type: 'button', onclick: () => resolve(index), text: answer }),
    );
    NB.clear(at, `${text} `, ...buttons.flatMap((button) => [button, ' ']));
    buttons.at(-1)?.focus();
  });

/** Has a plan written; asks first where that would overwrite a file or save a rejected needle path. */
PLAN.write = async (path, plan, at) => {
  // A needle that was agreed to is not asked about again.
  const needle = JSON.stringify(plan.aim);
  /** @type {{ name?: string, consent: { overwrite: boolean, refused: boolean } }} */
  const body = { ...plan, consent: { overwrite: false, refused: PLAN.agreed === needle } };
  for (;;) {
    try {
      return await PLAN.ask(path, { body });
    } catch (error) {
      const { ask, file, free } = error.body || {};
      if (!ask) throw error;
      const answers =
        ask === 'refused' ? ['Save as rejected', 'Cancel'] : [`Overwrite ${file}`, `Save as ${free}.toml`, 'Cancel'];
      const answer = await PLAN.question(at, `${error.message}: ${error.hint}.`, answers);
      if (answer === answers.length - 1) throw new Problem(0, { error: 'nothing was written' });
      if (ask === 'refused') {
        body.consent.refused = true;
        PLAN.agreed = needle;
      } else if (answer === 0) body.consent.overwrite = true;
      else body.name = free;
    }
  }
};

/**
 * Asks for the latest question alone: while one is answered, only the newest that came since waits.
 * @template {keyof Questions} Kind
 */
class Latest {
  /** @param {Kind} path @param {WhenAnswered<Kind>} answered */
  constructor(path, answered) {
    this.path = path;
    this.answered = answered;
    this.turn = 0;
    /** @type {(Questions[Kind][0] & { page: string, turn: number }) | null} */
    this.next = null;
    this.asked = 0;
    this.busy = false;
  }

  /** @param {Questions[Kind][0]} body */
  ask(body) {
    this.turn++;
    this.next = { ...body, page: PLAN.page, turn: this.turn };
    this.asked = performance.now();
    if (!this.busy) this.work();
  }

  /** What is on its way does not count any more. */
  forget() {
    this.turn++;
    this.next = null;
  }

  async work() {
    this.busy = true;
    while (this.next) {
      const body = this.next;
      const asked = this.asked;
      this.next = null;
      let answer;
      try {
        answer = await PLAN.ask(this.path, { body });
      } catch (error) {
        answer = { refused: { message: error.message, hint: error.hint }, problem: error };
      }
      // A newer question may wait: what is shown follows the drag all the same.
      if (body.turn === this.turn || this.next) this.answered(answer, body, performance.now() - asked);
    }
    this.busy = false;
  }
}
PLAN.page = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, '0')).join(
  '',
);

/** A colour of three bytes. */
PLAN.rgb = (channels) => `rgb(${channels.join()})`;

/** A patch of colour and what it means. Style attributes are not allowed here; the page's own script may set them. */
PLAN.swatch = (color, words) => {
  const patch = NB.el('i');
  patch.style.background = color;
  return NB.el('span', { class: 'entry-swatch' }, patch, words);
};

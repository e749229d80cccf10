// The page of a study, as its readers use it.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';

/** @typedef {import('playwright-core').Page} Page */
/** @typedef {import('playwright-core').Locator} Locator */
/** @typedef {(judge: Page, locator: Locator, name: string, least?: number) => Promise<void>} NotBlank */

const REDRAW_MS = 100;
/** @type {('scatter' | 'map' | 'ecdf' | 'histogram' | 'strip')[]} */
const FIGURES = ['scatter', 'map', 'ecdf', 'histogram', 'strip'];

/**
 * The answer stands first, with its figure and interval, and criteria have values, limits and requirements.
 * @param {Page} page
 */
async function answerFirst(page) {
  const found = await page.evaluate(() => {
    const answer = document.querySelector('#app .answer');
    const plots = [...document.querySelectorAll('#app .plot')];
    return {
      sentence: answer?.querySelector('.sentence')?.textContent,
      wanted: NB.current.summary.answer.sentence,
      bottom: answer?.getBoundingClientRect().bottom,
      before: plots.every((plot) => answer.compareDocumentPosition(plot) & Node.DOCUMENT_POSITION_FOLLOWING),
      criteria: NB.current.summary.criteria.length,
      cells: [...document.querySelectorAll('.criteria tbody tr')].map((row) =>
        [...row.children].map((cell) => cell.textContent),
      ),
      choices: NB.current.summary.choices ? NB.current.compared?.title : 'none',
    };
  });
  assert.ok(found.sentence?.toLowerCase().startsWith(found.wanted.toLowerCase()), 'the page has no answer');
  assert.match(found.sentence, /\d %? .*(CI|interval) .* to /, 'the answer has no figure with an interval');
  assert.ok(found.before && found.bottom < 900, 'the answer is not on the first screen');
  assert.ok(found.choices, 'choices are not drawn');
  assert.equal(found.cells.length, found.criteria);
  for (const [criterion, met, ...rest] of found.cells) {
    assert.match(met, /met|failed|not evaluated/, `${criterion} has no verdict`);
    assert.ok(
      rest.some((text) => /\d.*\(.* to .*\)/.test(text)),
      `${criterion} has no value with its interval`,
    );
    assert.ok(
      rest.some((text) => /^[\u2264\u2265] \d/.test(text)),
      `${criterion} has no limit`,
    );
  }
}

/**
 * No number with a power of ten, and no section that is named after a key.
 * @param {Page} page
 */
async function readable(page) {
  const { text, titles } = await page.evaluate(() => ({
    text: [...document.querySelectorAll('#app .panel, #app table')]
      .filter((each) => !each.closest('dl'))
      .map((each) => each.textContent)
      .join('\n'),
    titles: [...document.querySelectorAll('h2')].map((each) => each.textContent),
  }));
  assert.deepEqual(text.match(/\d(\.\d+)?e[-\u2212]\d+/g) || [], [], 'numbers that people cannot read');
  for (const name of ['study id', 'repeats', 'sampling', 'cases', 'name', 'description'])
    assert.ok(!titles.includes(name), `a section is called "${name}"`);
}

/**
 * The picture of a case has the tool of that case, and no other.
 * @param {Page} page
 */
async function ownTool(page) {
  const cases = await page.evaluate(() => {
    const { scene, posed } = NB.current;
    const first = new Map();
    for (const [index, at] of posed) if (!first.has(scene.toolOf[at])) first.set(scene.toolOf[at], index);
    return [...first].filter(([tool]) => tool < 200);
  });
  const pictures = new Set();
  for (const [tool, index] of cases) {
    await page.evaluate((each) => NB.current.choose(each), index);
    const { seen, picture } = await page.evaluate(() => {
      const { scene, view } = NB.current;
      const seen = scene.looks.tools.map((_, at) => {
        /** @type {boolean[]} */
        const before = [];
        view.world.traverse((mesh) => {
          if (mesh instanceof THREE.Mesh) before.push(mesh.visible);
        });
        scene.arm.layer(`tool@${at}`, false);
        /** @type {boolean[]} */
        const after = [];
        view.world.traverse((mesh) => {
          if (mesh instanceof THREE.Mesh) after.push(mesh.visible);
        });
        const shown = before.some((each, k) => each && !after[k]);
        let k = 0;
        view.world.traverse((mesh) => {
          if (mesh instanceof THREE.Mesh) mesh.visible = before[k++];
        });
        return shown;
      });
      view.render();
      return { seen, picture: view.renderer.domElement.toDataURL() };
    });
    assert.deepEqual(
      seen,
      seen.map((_, at) => at === tool),
      `case ${index} has another tool`,
    );
    pictures.add(picture);
  }
  assert.equal(pictures.size, cases.length, 'cases with different tools look the same');
  return cases.length;
}

/**
 * Cases of one place are one mark, which says how many work.
 * @param {Page} page
 */
async function sharesOfPlaces(page) {
  await page.evaluate(() => Reflect.set(window, 'stateBefore', { ...NB.current.state }));
  const found = await page.evaluate(() => {
    const study = NB.current;
    const levels = [...study.factors.keys()].filter((index) => study.factors[index].levels?.length > 1);
    study.state.x = levels[0];
    study.state.y = levels[1] ?? levels[0];
    study.state.filters = new Map();
    study.state.color = 'outcome';
    study.filter();
    study.scatter.render();
    const { first, counts, of, grid } = study.places();
    const axes = study.scatterAxes;
    const ratio = study.scatter.canvas.canvas.width / study.scatter.canvas.canvas.clientWidth;
    const context = study.scatter.canvas.canvas.getContext('2d');
    return first.map((_, place) => {
      let working = 0;
      study.indices.forEach((index, at) => {
        if (of[at] === place && study.outcome(index) === 'ok') working++;
      });
      const radius = study.radius(counts[place], study.places().most, study.scatter.canvas.canvas.clientWidth);
      const [x, y] = [axes.px(study.places().x[place]), axes.py(study.places().y[place])];
      const box = [x - radius, y - radius, 2 * radius, 2 * radius].map((value) => Math.round(value * ratio));
      const { data } = context.getImageData(box[0], box[1], box[2], box[3]);
      let [blue, all] = [0, 0];
      for (let k = 0; k < data.length; k += 4) {
        const [px, py] = [((k / 4) % box[2]) - box[2] / 2, Math.floor(k / 4 / box[2]) - box[3] / 2];
        if (Math.hypot(px, py) > box[2] / 2 - 2) continue;
        all++;
        if (data[k] < 60 && data[k + 2] > 140) blue++;
      }
      return { grid, share: working / counts[place], drawn: blue / all };
    });
  });
  for (const { grid, share, drawn } of found) {
    assert.ok(grid);
    assert.ok(Math.abs(share - drawn) < 0.08, `a place in which ${share} work is drawn as ${drawn}`);
  }
  await page.evaluate(() => {
    Object.assign(NB.current.state, Reflect.get(window, 'stateBefore'));
    NB.current.filter();
    NB.current.redraw();
  });
  return found.length;
}

/**
 * Every figure is saved as SVG for a column of 85 mm with letters of 8 pt, and has titles on its axes.
 * @param {Page} page
 */
async function figures(page) {
  for (const which of /** @type {const} */ ([...FIGURES, 'compared'])) {
    const found = await page.evaluate((name) => {
      const figure = NB.current[name];
      if (!figure) return null;
      const document = new DOMParser().parseFromString(figure.svg(), 'image/svg+xml');
      const texts = [...document.querySelectorAll('text')];
      return {
        fails: document.querySelector('parsererror')?.textContent,
        width: document.documentElement.getAttribute('width'),
        box: document.documentElement.getAttribute('viewBox').split(' ').map(Number),
        sizes: [...new Set(texts.map((text) => Number(text.getAttribute('font-size'))))],
        texts: texts.map((text) => text.textContent),
        shapes: document.querySelectorAll('path').length,
      };
    }, which);
    if (!found) continue;
    assert.equal(found.fails, undefined, which);
    assert.equal(found.width, '85mm', which);
    // 85 mm are 321 points of 1/96 inch, and 8 pt are 10.67 of them.
    assert.ok(Math.abs(found.box[2] - 321.26) < 0.1, `${which} is ${found.box[2]} wide`);
    for (const size of found.sizes) assert.ok(Math.abs(size - 10.667) < 0.01, `${which} has letters of ${size}`);
    assert.ok(found.texts.length > 6 && found.shapes > 8, `${which} is nearly empty`);
  }
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('.save').first().click()]);
  assert.match(download.suggestedFilename(), /\.svg$/);
  assert.ok(readFileSync(await download.path(), 'utf8').startsWith('<svg'));
}

/**
 * What is shown stands in the address, and an address shows it again.
 * @param {Page} page
 */
async function addresses(page) {
  const wanted = await page.evaluate(() => {
    const study = NB.current;
    const index = study.indices[Math.floor(study.indices.length / 2)];
    study.choose(index, 3);
    return study.caseOf(index);
  });
  await page.waitForFunction(
    (number) => new URLSearchParams(location.hash.slice(1)).get('case') === String(number),
    wanted,
  );
  const [factor, axis] = await page.evaluate(() => {
    const { factors, state } = NB.current;
    const other = factors.findIndex((each, index) => !each.levels && index !== state.x);
    return [factors.find((each) => each.levels && each.levels.length > 1), factors[other].name];
  });
  const level = factor.levels[1].label;
  const choices = { case: '7', y: axis, of: 'Left-Up-Fold', colour: 'working', [`with.${factor.name}`]: level };
  await page.evaluate(
    (hash) => {
      location.hash = hash;
    },
    `#${new URLSearchParams(choices)}`,
  );
  await page.waitForFunction(() => NB.current.caseOf(NB.current.chosen) === 7);
  const shown = await page.evaluate(() => {
    const {
      state,
      factors,
      page: { configurations },
    } = NB.current;
    return {
      y: factors[state.y].name,
      of: configurations[state.configuration],
      colour: state.color,
      filters: [...state.filters],
      selects: NB.current.kept.map(([control, value]) => control.querySelector('select').value === value()),
    };
  });
  assert.deepEqual([shown.y, shown.of, shown.colour], [axis, 'Left-Up-Fold', 'working']);
  assert.ok(
    shown.filters.some(([, at]) => at === 1),
    'a filter of the address is not kept',
  );
  assert.ok(shown.selects.every(Boolean), 'lists show something else than the plots');
}

/**
 * The tools are those of test.mjs.
 * @param {Page} page
 * @param {object} tools
 * @param {Page} tools.judge
 * @param {string} tools.name
 * @param {(line: string) => void} tools.say
 * @param {NotBlank} tools.notBlank
 * @param {(page: Page) => Promise<unknown>} tools.settle
 * @param {string} tools.out
 */
export async function testStudy(page, { judge, name, say, notBlank, settle, out }) {
  await answerFirst(page);
  await readable(page);
  for (const which of FIGURES) {
    const index = await page.evaluate(
      (each) => [...document.querySelectorAll('.plot canvas')].indexOf(NB.current[each].canvas.canvas),
      which,
    );
    const handle = page.locator('.plot canvas').nth(index);
    await handle.scrollIntoViewIfNeeded();
    await settle(page);
    await notBlank(judge, handle, which, which === 'histogram' ? 5 : 12);
  }
  const times = await page.evaluate(
    (names) =>
      names.map((which) => {
        const figure = NB.current[which];
        const runs = [];
        for (let k = 0; k < 7; k++) {
          figure.render();
          runs.push(figure.paintedInMs);
        }
        return { which, ms: Math.round(runs.sort((a, b) => a - b)[3] * 10) / 10 };
      }),
    FIGURES,
  );
  say(`  redraws, ms: ${times.map(({ which, ms }) => `${which} ${ms}`).join(', ')}`);
  for (const { which, ms } of times) assert.ok(ms < REDRAW_MS, `${which} takes ${ms} ms`);
  say(`  ${await ownTool(page)} tools drawn, ${await sharesOfPlaces(page)} places with their shares`);
  await figures(page);
  await addresses(page);
  // From a mark to its cases.
  const first = await page.evaluate(() => NB.current.chosen);
  const spot = await page.evaluate(() => {
    const study = NB.current;
    study.scatter.canvas.canvas.scrollIntoView({ block: 'center' });
    const box = study.scatter.canvas.canvas.getBoundingClientRect();
    const { x, y, first: cases } = study.places();
    const place = cases.findIndex((index) => index !== study.chosen);
    return [box.x + study.scatterAxes.px(x[place]), box.y + study.scatterAxes.py(y[place])];
  });
  await page.mouse.click(spot[0], spot[1]);
  assert.notEqual(await page.evaluate(() => NB.current.chosen), first, 'a click on a mark chooses no case');
  const number = await page.evaluate(() => NB.current.caseOf(NB.current.chosen));
  const command = await page.locator('.explore code').first().textContent();
  assert.ok(command.startsWith('needlebench study ') && command.endsWith(`--case ${number}`), command);
  assert.equal(await page.locator('.explore .choose tbody tr').count(), 8);
  // Every choice of every list draws without errors.
  for (const select of await page.locator('select').all()) {
    const values = await select
      .locator('option')
      .evaluateAll((options) => options.map((option) => /** @type {HTMLOptionElement} */ (option).value));
    for (const value of values) {
      await select.selectOption(value);
      await settle(page);
    }
    await select.selectOption(values[0]);
  }
  const map = await page.evaluate(() => {
    NB.current.map.canvas.canvas.scrollIntoView({ block: 'center' });
    const box = NB.current.map.canvas.canvas.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
  });
  await page.mouse.click(map[0], map[1]);
  const listed = page.locator('.explore .legend button.key');
  assert.ok((await listed.count()) > 0, 'a cell of the map lists no cases');
  await listed.first().focus();
  await page.keyboard.press('ArrowRight');
  assert.ok((await page.evaluate(() => NB.current.chosen)) >= 0);
  await page.screenshot({ path: `${out}/${name}-map.png` });
}

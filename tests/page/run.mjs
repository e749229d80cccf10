// What is special to the page of a run: what is nearest at a time, ghosts, addresses, charts, paper.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';

/** @typedef {import('playwright-core').Page} Page */

/** Sheets of paper that the page of any shipped scenario takes. */
export const MOST_SHEETS = 8;

/** @param {Page} page @param {string} selector */
const text = (page, selector) => page.locator(selector).first().textContent();

/**
 * The label and the sentence tell what holds at the slider's time, and the least only at its own.
 * @param {Page} page
 * @param {(page: Page) => Promise<unknown>} settle
 */
export async function testNearest(page, settle) {
  const times = await page.evaluate(() => [0, 0.31, 0.77, 1].map((share) => share * NB.current.end));
  for (const time of times) {
    await page.evaluate((seconds) => {
      NB.current.pause();
      NB.current.seek(seconds);
    }, time);
    await settle(page);
    const { shown, label, least } = await page.evaluate(() => {
      const run = NB.current;
      const { curveTime, curves } = run.decode(run.shown[0]);
      const around = curves.filter(([name]) => run.page.classesAround.includes(name));
      return {
        shown: run.now.textContent,
        least: Math.min(...around.map(([, y]) => NB.at(curveTime, y, run.time))),
        label: run.view.labels.filter((each) => each.layer === 'witness').map((each) => each.element.textContent),
      };
    });
    assert.equal(label.length, 1, 'one line shows what is nearest');
    assert.ok(label[0].endsWith(`at ${time.toFixed(2)} s`), label[0]);
    const stated = Number(/: ([\d.\u2212-]+) mm/.exec(label[0])[1].replace('\u2212', '-'));
    // A sample of 40 ms may name another pair than the curve's least between two samples.
    assert.ok(Math.abs(stated - least) < 0.6, `${label[0]}, but ${least} mm is the least`);
    assert.ok(shown.includes(`at ${time.toFixed(2)} s`), shown);
  }
  // A row of the table: the least of its class, at its time and only there.
  const row = page.locator('.panel .choose').nth(1).locator('tbody tr').first();
  await row.click();
  const pinned = await page.evaluate(
    () => NB.current.view.labels.find((each) => each.layer === 'witness').element.textContent,
  );
  assert.match(pinned, /^minimum, /);
  await page.evaluate(() => NB.current.seek(NB.current.time > 0.5 ? NB.current.time - 0.5 : NB.current.time + 0.5));
  const moved = await page.evaluate(
    () => NB.current.view.labels.find((each) => each.layer === 'witness').element.textContent,
  );
  assert.doesNotMatch(moved, /^minimum, /);
}

/**
 * What the page calls clearance is the terminal's column of that name, with self-clearance apart.
 * @param {Page} page
 */
export async function testClearance(page) {
  const differing = await page.evaluate(() => {
    const { page: document, report } = NB.current;
    return report.goals.flatMap(({ configurations }, goal) => {
      const all = document.goals[goal].columns.side;
      const column = all.find(({ keys }) => keys.includes('clearance_attained'));
      return configurations.flatMap(({ label, metrics, clearance }) => {
        const key = column?.keys.find((each) => metrics[each] !== undefined);
        const found = NB.leastAround(document, clearance)?.minimum_m;
        return found === metrics[key] ? [] : [`${label}: ${found} m is no ${key} of ${metrics[key]} m`];
      });
    });
  });
  assert.deepEqual(differing, []);
}

/**
 * Ghosts have their own colours, and the names of their configurations stand at them.
 * @param {Page} page
 * @param {(page: Page) => Promise<unknown>} settle
 */
export async function testGhosts(page, settle) {
  await page.getByRole('button', { name: 'Show all ghosts' }).click();
  await settle(page);
  const { labels, expected, colors } = await page.evaluate(() => ({
    labels: NB.current.view.labels
      .filter((each) => each.layer === 'ghost labels')
      .map((each) => each.element.textContent),
    expected: NB.current.goal.configurations.filter((each) => each.joints_rad).map((each) => each.label),
    colors: [...new Set(NB.ghostColors)].length,
  }));
  assert.deepEqual(labels, expected);
  assert.equal(colors, 8);
  await page.getByRole('button', { name: 'Hide all ghosts' }).click();
}

/**
 * What is chosen stands in the address, and the address brings it back, from disk and after a reload.
 * @param {Page} page
 * @param {(page: Page) => Promise<unknown>} settle
 */
export async function testAddress(page, settle) {
  const wanted = await page.evaluate(() => {
    const run = NB.current;
    run.setGoal(run.report.goals.length - 1);
    const index = run.goal.configurations.findLastIndex((_, at) => run.extra.configurations[at].runs.length);
    run.setConfiguration(index);
    run.seek(1);
    return { goal: run.goal.name, configuration: run.configuration.label, time: '1.00' };
  });
  /** @param {object} choices */
  const stands = (choices) =>
    JSON.stringify(Object.fromEntries([...new URLSearchParams(location.hash.slice(1))].sort())) ===
    JSON.stringify(choices);
  await page.waitForFunction(stands, Object.fromEntries(Object.entries(wanted).sort()));
  await page.reload();
  await page.waitForSelector('html[data-ready]');
  const after = await page.evaluate(() => ({
    goal: NB.current.goal.name,
    configuration: NB.current.configuration.label,
    time: NB.current.time.toFixed(2),
  }));
  assert.deepEqual(after, wanted);
  // Another address in the open page, and one that asks for what there is not.
  await page.evaluate(() => {
    location.hash = `#goal=${NB.current.report.goals[0].name}`;
  });
  await settle(page);
  assert.equal(await page.evaluate(() => NB.current.goalIndex), 0);
  await page.evaluate(() => {
    location.hash = '#goal=nowhere&configuration=None&time=abc';
  });
  await settle(page);
  assert.equal(await page.evaluate(() => NB.current.goalIndex), 0);
}

/**
 * Figures are saved as SVG for a column of 85 mm, and the view as PNG.
 * @param {Page} page
 */
export async function testSaving(page) {
  /** @param {string} name */
  const save = async (name) => {
    const [download] = await Promise.all([
      page.waitForEvent('download'),
      page.getByRole('button', { name, exact: true }).first().click(),
    ]);
    return { name: download.suggestedFilename(), bytes: await readFile(await download.path()) };
  };
  const curves = await save('Clearance over time: save as SVG');
  assert.match(curves.name, /\.svg$/);
  const svg = curves.bytes.toString();
  assert.match(svg, /^<svg [^>]*width="85mm"/);
  assert.ok(svg.includes('clearance (mm)') && svg.includes('time (s)'), 'axes without units');
  const view = await save('3D view: save as PNG');
  assert.equal(view.bytes.subarray(1, 4).toString(), 'PNG');
}

/**
 * Every chart of the program is drawn, and fits its frame.
 * @param {Page} page
 */
export async function testCharts(page) {
  await page.evaluate(() => {
    for (const each of document.querySelectorAll('details')) each.open = true;
  });
  const charts = await page.evaluate(() =>
    Promise.all(
      [...document.images]
        .filter((image) => image.closest('.chart'))
        .map(async (image) => {
          await image.decode();
          return { title: image.alt, width: image.naturalWidth };
        }),
    ),
  );
  for (const { title, width } of charts) assert.ok(title && width > 100, `${title} is not drawn`);
  return charts.map(({ title }) => title);
}

/**
 * A test by ISO 9283: each pose can be looked at, with where the arm came to rest.
 * @param {Page} page
 * @param {(page: Page) => Promise<string>} picture
 */
export async function testPoses(page, picture) {
  const pictures = new Set();
  for (const name of ['P1', 'P2', 'P3', 'P4', 'P5']) {
    await page.getByRole('button', { name, exact: true }).click();
    pictures.add(await picture(page));
    assert.ok((await text(page, '[role=status]')).includes(name));
  }
  assert.equal(pictures.size, 5, 'the arm does not go to the poses');
  const charts = await testCharts(page);
  assert.ok(charts.length >= 4, `${charts.length} charts`);
}

/**
 * Sections that a scenario with events has.
 * @param {Page} page
 */
export async function testEvents(page) {
  const asked = await page.evaluate(() => NB.current.goal.configurations.some((each) => each.events));
  if (!asked) return;
  for (const title of ['Prescribed contacts', 'Emergency stop', 'Retreat']) {
    const table = page.locator('h3', { hasText: title }).locator('xpath=following-sibling::div[1]//tbody/tr');
    assert.ok((await table.count()) > 0, `${title}: nothing`);
  }
  const charts = await testCharts(page);
  assert.ok(
    charts.some((title) => title.includes('contact 1')),
    'no chart of a contact',
  );
}

/**
 * Sheets of a PDF file.
 * @param {Buffer} pdf
 */
export const sheets = (pdf) => (pdf.toString('latin1').match(/\/Type\s*\/Page(?!s)/g) || []).length;

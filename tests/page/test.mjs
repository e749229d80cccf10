// Opens report pages in headless Chromium, as a reader would, and uses them:
//
//   npm ci && node test.mjs --out SCREENSHOTS PAGE.html...
//
// Checks that pages are whole at five widths, that nothing is blank, no error is logged, nothing is asked of the
// network, every switch and the replay work, the keyboard reaches everything, and the page still works without WebGL.
// Takes an installed Chromium (or the one that CHROMIUM names), else the one that comes with the packages, which
// CHROMIUM=packaged asks for.
import assert from 'node:assert/strict';
import { mkdirSync, readFileSync, statSync } from 'node:fs';
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch, NO_GL, SOFTWARE_GL, SOFTWARE_GL_ALONE } from './browser.mjs';
import { testLayout } from './layout.mjs';
import { testNumbers } from './numbers.mjs';
import {
  MOST_SHEETS,
  sheets,
  testAddress,
  testCharts,
  testClearance,
  testEvents,
  testGhosts,
  testNearest,
  testPoses,
  testSaving,
} from './run.mjs';
import { testStudy } from './study.mjs';

/** @typedef {import('playwright-core').Page} Page */
/** @typedef {import('playwright-core').Locator} Locator */
/** @typedef {import('playwright-core').Browser} Browser */
/** @typedef {{ judge: Page, name: string, say: (line: string) => void }} Tools */
/** @typedef {(page: Page, tools: Tools) => Promise<void>} PageTest */

// A study's hundred thousand cases take a moment to unpack.
/** @type {{ [kind: string]: number }} */
const FIRST_VIEW_MS = { run: 2000, atlas: 2000, study: 4000, search: 2000, replay: 2000 };
/** @type {{ [kind: string]: number }} */
const MOST_BYTES = { run: 3e6, atlas: 3e6, study: 10e6, search: 3e6, replay: 3e6 };
/** A browser uses hardly more than one core. */
const SIDE_BY_SIDE = 2;
const SIZE = { width: 1280, height: 900 };

const words = process.argv.slice(2);
const at = words.indexOf('--out');
const out = resolve(at >= 0 ? words.splice(at, 2)[1] : 'screenshots');
mkdirSync(out, { recursive: true });

/**
 * A page that fails on every error and every request that leaves the file.
 * @param {Browser} running
 * @param {string} file
 */
async function open(running, file) {
  const page = await running.newPage({ viewport: SIZE });
  // Pictures are drawn in software, on machines that may have other things to do.
  page.setDefaultTimeout(120_000);
  /** @type {string[]} */
  const problems = [];
  page.on('console', (message) => {
    // What the browser says of how it brings WebGL onto the page without a graphics processor.
    if (message.text().includes('GPU stall due to ReadPixels')) return;
    if (['error', 'warning'].includes(message.type())) problems.push(`${message.type()}: ${message.text()}`);
  });
  page.on('pageerror', (error) => problems.push(error.message));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) problems.push(`asked for ${request.url()}`);
  });
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector('html[data-ready]', { timeout: 60_000 });
  const timing = await page.evaluate(() => NB.timing.firstView ?? 0);
  return { page, problems, timing };
}

/**
 * Colours of a picture: how many, and the share of the most frequent one.
 * @param {Page} judge
 * @param {Buffer} png
 */
async function colors(judge, png) {
  return judge.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [image.width, image.height];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
    const counts = new Map();
    for (const pixel of pixels) counts.set(pixel, (counts.get(pixel) || 0) + 1);
    return { count: counts.size, most: Math.max(...counts.values()) / pixels.length };
  }, png.toString('base64'));
}

/** @param {Page} judge @param {Locator} locator @param {string} name @param {number} [least] */
async function notBlank(judge, locator, name, least = 12) {
  const { count, most } = await colors(judge, await locator.screenshot());
  assert.ok(count >= least && most < 0.97, `${name} is blank: ${count} colours, ${(100 * most).toFixed(1)} % of one`);
}

/** @param {Page} page */
const settle = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
/** @param {Page} page */
const picture = async (page) => {
  await settle(page);
  return page.evaluate(() => NB.current.view.renderer.domElement.toDataURL());
};

/**
 * Whether the picture becomes another one; it is drawn when there is time for it.
 * @param {Page} page
 * @param {string} before
 */
async function changes(page, before) {
  for (let look = 0; look < 50; look++) {
    if ((await picture(page)) !== before) return true;
    await page.waitForTimeout(100);
  }
  return false;
}

/**
 * Tab reaches every control, and shows where it is.
 * @param {Page} page
 */
async function walk(page) {
  await page.evaluate(() => {
    window.scrollTo(0, 0);
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
  });
  const seen = new Set();
  for (let step = 0; step < 400; step++) {
    await page.keyboard.press('Tab');
    const found = await page.evaluate(() => {
      const element = document.activeElement;
      if (!(element instanceof HTMLElement) || element === document.body) return null;
      element.dataset.walked ||= String(document.querySelectorAll('[data-walked]').length);
      const style = getComputedStyle(element);
      return {
        id: element.dataset.walked,
        tag: element.tagName,
        ring: element.matches(':focus-visible') ? style.outlineStyle !== 'none' : false,
        name: element.getAttribute('aria-label') || element.textContent || element.closest('label')?.textContent || '',
      };
    });
    if (!found) break;
    if (seen.has(found.id)) break;
    seen.add(found.id);
    assert.ok(found.ring, `${found.tag} shows no focus: ${found.name.slice(0, 40)}`);
    assert.ok(found.name.trim(), `${found.tag} has no name`);
  }
  const missed = await page.evaluate(() =>
    [
      .../** @type {NodeListOf<HTMLElement>} */ (
        document.querySelectorAll('button, select, input, summary, [tabindex="0"]')
      ),
    ]
      .filter(
        (element) =>
          element.checkVisibility({ contentVisibilityAuto: true, visibilityProperty: true }) &&
          !element.matches(':disabled') &&
          element.tabIndex >= 0 &&
          !element.dataset.walked,
      )
      .map((element) => element.outerHTML.slice(0, 100)),
  );
  assert.deepEqual(missed, [], 'the keyboard does not reach everything');
  return seen.size;
}

/**
 * Switches every checkbox under "Show" there and back: the picture has to change and to come back. The couch of a scan
 * may lie inside the table of the room: what the table hides is switched without it.
 * @param {Page} page
 */
async function toggles(page) {
  const labels = await page.evaluate(() =>
    [...document.querySelectorAll('[aria-label="Parts of the picture"] .check')].map((label) => label.textContent),
  );
  /** @param {string | null} text */
  const box = (text) =>
    page.locator('[aria-label="Parts of the picture"] .check', { hasText: new RegExp(`^${text}$`) }).locator('input');
  /** @param {string | null} text */
  const isSeen = async (text) => {
    const before = await picture(page);
    await box(text).click();
    const changed = (await picture(page)) !== before;
    await box(text).click();
    assert.ok((await picture(page)) === before, `switching "${text}" twice is not the same`);
    return changed;
  };
  for (const text of labels) {
    if (await isSeen(text)) continue;
    assert.ok(text === 'arms, couch, objects', `switching "${text}" changes nothing`);
    await box('table').click();
    assert.ok(await isSeen(text), `switching "${text}" changes nothing, without the table either`);
    await box('table').click();
  }
  return labels.length;
}

/** @type {PageTest} */
async function testRun(page, { judge, name, say }) {
  await notBlank(judge, page.locator('.view canvas'), 'the 3D view', 200);
  // Our own forward kinematics against the program's.
  const worst = await page.evaluate(() => {
    const { page: data, report } = NB.current;
    let most = 0;
    for (const [g, goal] of report.goals.entries()) {
      for (const [c, configuration] of goal.configurations.entries()) {
        const { flange } = data.goals[g].configurations[c];
        if (!flange) continue;
        const pose = NB.forward(data.scene.chain, configuration.joints_rad)[6].elements;
        for (let k = 0; k < 3; k++) most = Math.max(most, Math.abs(pose[12 + k] - flange[k]));
      }
    }
    return most;
  });
  assert.ok(worst < 1e-9, `flange off by ${worst} m`);
  const hasGoals = await page.evaluate(() => NB.current.report.goals.length > 0);
  if (!hasGoals) {
    if (await page.evaluate(() => Boolean(NB.current.report.iso9283))) await testPoses(page, picture);
    return;
  }
  await notBlank(judge, page.locator('.curves .plot canvas'), 'the clearance plot');
  await testNumbers(page);
  await testSaving(page);
  await testEvents(page);
  await testCharts(page);
  const count = await toggles(page);
  say(`  ${count} switches work`);

  // Rows: click and arrow keys.
  const rows = page.locator('.panel .choose').first().locator('tbody tr');
  await rows.nth(0).click();
  assert.equal(await page.evaluate(() => NB.current.configurationIndex), 0);
  await page.keyboard.press('ArrowDown');
  assert.equal(await page.evaluate(() => NB.current.configurationIndex), 1);
  const before = await picture(page);
  await rows.nth(3).locator('input').click();
  assert.notEqual(await picture(page), before, 'a ghost is not seen');
  await rows.nth(3).locator('input').click();

  // Replay.
  const playable = await page.evaluate(() =>
    NB.current.goal.configurations.findIndex((_, c) => NB.current.extra.configurations[c].runs.length > 0),
  );
  await page.evaluate((index) => {
    NB.current.setConfiguration(index);
    NB.current.seek(0);
  }, playable);
  const still = await picture(page);
  // At its end, from where it plays from the start again.
  const end = await page.evaluate(() => {
    NB.current.seek(NB.current.end);
    return NB.current.end;
  });
  await page.getByRole('button', { name: 'Play' }).click();
  // Paused within a frame: a click of the mouse takes several, which may be long, and the arm rests at the end.
  await page.waitForFunction(
    () => {
      if (NB.current.time < 0.5 || NB.current.time > NB.current.end - 0.1) return false;
      NB.current.playButton.click();
      return true;
    },
    null,
    { timeout: 30_000 },
  );
  await page.getByRole('button', { name: 'Play' }).waitFor();
  const paused = await page.evaluate(() => NB.current.time);
  assert.ok(paused >= 0.5 && paused < end);
  assert.ok(await changes(page, still), 'the replay moves nothing');
  await page.screenshot({ path: `${out}/${name}-replay.png` });
  await page.locator('.replay input[type=range]').focus();
  await page.keyboard.press('ArrowLeft');
  assert.ok((await page.evaluate(() => NB.current.time)) < paused, 'the arrow key does not move the time');
  const curves = page.locator('.curves .plot canvas');
  await curves.evaluate((element) => element.scrollIntoView({ block: 'center' }));
  await settle(page);
  const plot = await curves.boundingBox();
  await page.mouse.click(plot.x + plot.width / 2, plot.y + plot.height / 2);
  const sought = await page.evaluate(() => NB.current.time);
  assert.ok(Math.abs(sought / end - 0.5) < 0.1, `a click in the middle of the plot seeks ${sought} of ${end} s`);
  // The end of the recorded motion is where the report says.
  const options = await page.locator('select[aria-label="Engine"] option').count();
  assert.ok(options >= 1);

  await testNearest(page, settle);
  await testClearance(page);
  await testGhosts(page, settle);
  await testAddress(page, settle);

  // Every goal and every configuration can be shown.
  for (const goal of await page.evaluate(() => NB.current.report.goals.map((_, index) => index))) {
    await page.locator('[aria-label=Goal] button').nth(goal).click();
    for (let row = 0; row < 8; row++) await rows.nth(row).click();
  }
  await page.evaluate(() => {
    NB.current.view.look([0.4, 0.9, -0.5], 3.2);
    window.scrollTo(0, 0);
  });
  for (const text of ['people and line of sight', 'free space', 'hand cone'])
    await page.locator('.check', { hasText: text }).locator('input').click();
  await page.evaluate(() => window.scrollTo(0, 0));
  await settle(page);
  await page.screenshot({ path: `${out}/${name}-room.png` });
}

/** @type {PageTest} */
async function testAtlas(page, { judge, name }) {
  await notBlank(judge, page.locator('.view canvas'), 'the 3D view', 200);
  await notBlank(judge, page.locator('.plot canvas').nth(0), 'the strips');
  await notBlank(judge, page.locator('.plot canvas').nth(1), 'the curves');
  await testNumbers(page);
  const asked = await page.evaluate(() => ({
    goal: NB.current.page.goals[NB.current.page.goals.length - 1].name,
    configuration: NB.current.goal.branches[2].label,
    roll: '90',
  }));
  await page.evaluate((choices) => {
    location.hash = `#${new URLSearchParams(choices)}`;
  }, asked);
  await page.waitForTimeout(300);
  await page.reload();
  await page.waitForSelector('html[data-ready]');
  assert.deepEqual(
    await page.evaluate(() => ({
      goal: NB.current.goal.name,
      configuration: NB.current.branch.label,
      roll: String(NB.current.roll),
    })),
    asked,
  );
  const legend = await page.locator('.curves .legend').first().textContent();
  assert.ok(legend.indexOf('feasible') < legend.indexOf('Rejected by:'), legend);
  // At a roll that works: elsewhere there may be no posture to move.
  await page.evaluate(() => NB.current.setGoal(NB.current.goalIndex));
  const before = await picture(page);
  const roll = await page.evaluate(() => NB.current.roll);
  await page.locator('.replay input[type=range]').focus();
  await page.keyboard.press('ArrowRight');
  assert.notEqual(await page.evaluate(() => NB.current.roll), roll);
  assert.ok(await changes(page, before), 'the roll moves nothing');
  await page.locator('.choose').first().locator('tbody tr').nth(4).click();
  assert.equal(await page.evaluate(() => NB.current.branchIndex), 4);
  const strips = page.locator('.plot canvas').nth(0);
  await strips.scrollIntoViewIfNeeded();
  const box = await strips.boundingBox();
  await page.mouse.click(box.x + box.width * 0.6, box.y + 30);
  assert.equal(await page.evaluate(() => NB.current.branchIndex), 0);
  await page.screenshot({ path: `${out}/${name}-strips.png` });
}

/**
 * The answer stands first with its interval, every choice has its figure, and placements are pictures.
 * @type {PageTest}
 */
async function testSearch(page, { judge, name }) {
  const found = await page.evaluate(() => ({
    sentence: document.querySelector('#app .answer .sentence')?.textContent,
    stray: NB.byId('app').innerText.includes('null'),
    figures: [...document.querySelectorAll('#app .points h3')].map((each) => each.textContent),
    factors: NB.current.page.factors.map((each) => each.words),
    pictures: document.querySelectorAll('.placements img').length,
    wanted: NB.current.page.pictures.length,
    winner: NB.current.answer.winner,
    equals: NB.current.answer.equals,
    fresh: NB.current.answer.figures[0].cases,
  }));
  assert.match(
    found.sentence,
    /(95 % CI|confidence bound) .*on \d+ held-out layouts/,
    'the answer has no figure with an interval',
  );
  assert.ok(found.sentence.includes(`${found.fresh} held-out layouts`));
  assert.ok(!found.stray, 'something says null');
  for (const words of found.factors) assert.ok(found.figures.includes(words), `no figure of ${words}`);
  assert.ok(found.equals.includes(found.winner));
  assert.equal(found.pictures, found.wanted);
  const plots = page.locator('#app .points .plot canvas');
  for (let at = 0; at < (await plots.count()); at++) {
    await plots.nth(at).scrollIntoViewIfNeeded();
    await settle(page);
    await notBlank(judge, plots.nth(at), `figure ${at}`);
  }
  for (const heading of await page.locator('details.section > summary').all()) await heading.click();
  await page.evaluate(() => window.scrollTo(0, 0));
  await page.screenshot({ path: `${out}/${name}-all.png`, fullPage: true });
}

/** @type {{ [kind: string]: PageTest }} */
const tests = {
  run: testRun,
  search: testSearch,
  atlas: testAtlas,
  study: (page, tools) => testStudy(page, { ...tools, notBlank, settle, out }),
  replay: async () => {},
};

/**
 * @param {string} given
 * @param {(line: string) => void} say
 */
async function testPage(given, say) {
  const file = resolve(given);
  const html = readFileSync(file, 'utf8');
  const title = html.match(/<title>(run|roll map|study|search): /)?.[1] || 'replay';
  const kind = title === 'roll map' ? 'atlas' : title;
  const name = `${kind}-${words.indexOf(given)}`;
  const bytes = statSync(file).size;
  assert.ok(bytes <= MOST_BYTES[kind], `${given} has ${bytes} bytes`);
  // As a reader's browser puts pages together.
  const timed = await launch(SOFTWARE_GL);
  // The best of three: other programs run, too.
  let best = Infinity;
  for (let k = 0; k < 3 && best > FIRST_VIEW_MS[kind]; k++) {
    const opened = await open(timed, file);
    best = Math.min(best, opened.timing);
    assert.deepEqual(opened.problems, []);
    await opened.page.close();
  }
  await timed.close();
  say(`${kind} ${given}: ${(bytes / 1e6).toFixed(2)} MB, first view after ${Math.round(best)} ms`);
  assert.ok(best <= FIRST_VIEW_MS[kind], `first view after ${best} ms`);
  const running = await launch(SOFTWARE_GL_ALONE);
  const judge = await running.newPage();
  const { page, problems } = await open(running, file);
  await page.screenshot({ path: `${out}/${name}-first.png` });
  await page.screenshot({ path: `${out}/${name}-whole.png`, fullPage: true });
  assert.equal(await page.evaluate(() => Reflect.get(window, 'attacked')), undefined, 'a name became a script');
  assert.equal(await page.locator('img[src="x"]').count(), 0, 'a name became an element');
  const layout = await open(running, file);
  await testLayout(layout.page, { judge, notBlank, settle, shot: (width) => `${out}/${name}-${width}.png` });
  assert.deepEqual(layout.problems, []);
  await layout.page.close();
  say(`  the keyboard reaches ${await walk(page)} controls`);
  await tests[kind](page, { judge, name, say });
  // On paper: the picture in place of the view, no controls.
  await page.setViewportSize(SIZE);
  const count = sheets(await page.pdf({ path: `${out}/${name}.pdf`, preferCSSPageSize: true, printBackground: true }));
  say(`  ${count} sheets of paper`);
  if (kind === 'run') assert.ok(count >= 1 && count <= MOST_SHEETS, `${count} sheets of paper`);
  if (await page.locator('.view').count()) {
    await page.emulateMedia({ media: 'print' });
    assert.ok(
      await page.evaluate(() => document.querySelector('.view-image').getAttribute('src').startsWith('data:image/png')),
      'no picture for paper',
    );
    assert.equal(await page.locator('.view canvas').isVisible(), false);
    assert.equal(await page.locator('.no-print').first().isVisible(), false);
    await page.screenshot({ path: `${out}/${name}-paper.png`, fullPage: true });
  }
  assert.deepEqual(problems, []);
  await running.close();

  const plain = await launch(NO_GL);
  const without = await open(plain, file);
  if (await without.page.locator('.view').count()) {
    assert.ok(await without.page.locator('.no-webgl').isVisible(), 'nothing says that there is no WebGL');
    const rows = without.page.locator('.choose').first().locator('tbody tr');
    if (await rows.count()) await rows.nth(1).click();
  }
  if (await without.page.locator('.plot canvas').count())
    await notBlank(await plain.newPage(), without.page.locator('.plot canvas').first(), 'a plot without WebGL');
  await without.page.screenshot({ path: `${out}/${name}-no-webgl.png` });
  assert.deepEqual(without.problems, []);
  await plain.close();
}

const waiting = [...words];
/** Tests one page after the other; what one says stays together. */
async function worker() {
  for (let given = waiting.shift(); given; given = waiting.shift()) {
    /** @type {string[]} */
    const lines = [];
    try {
      await testPage(given, (line) => lines.push(line));
    } catch (error) {
      lines.push(`FAILED ${given}`);
      throw error;
    } finally {
      console.log(lines.join('\n'));
    }
  }
}
await Promise.all(Array.from({ length: SIDE_BY_SIDE }, worker));
console.log('pages: all well');

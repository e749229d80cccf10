// Tries postures in the pages of runs, and holds every distance against the program's:
//
//   npm ci && node explore.mjs --out SCREENSHOTS --program NEEDLEBENCH --postures EXAMPLE SCENARIO.toml REPORT.html ...
//
// EXAMPLE is tests/programs/cell/src/bin/postures.rs, which computes with the program's crates what `needlebench
// clearance` prints; that command is asked for some of the postures itself.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, dirname, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { deflateSync } from 'node:zlib';
import { launch, NO_GL, SOFTWARE_GL } from './browser.mjs';

/** @typedef {import('playwright-core').Page} Page */
/** @typedef {import('playwright-core').Browser} Browser */

/** Postures by scenario, and by each place of the base. */
const POSTURES = 1000;
const POSTURES_ELSEWHERE = 100;
/**
 * What was asked for: 1 um. Attained: 1e-10 m, as sines differ in the last bit and the search for a distance ends
 * elsewhere.
 */
const SAME_M = 1e-9;
/** One posture, computed and shown; the median. A frame of 60 in a second has 16. */
const COMPUTED_MS = 4;
/** Of the code and the scene in a page, compressed and written in base64. */
const MOST_BYTES = 350e3;

const words = process.argv.slice(2);
/** @param {string} name @param {string | null} [otherwise] */
const option = (name, otherwise = null) => {
  const at = words.indexOf(name);
  return at >= 0 ? resolve(words.splice(at, 2)[1]) : otherwise;
};
const out = option('--out', resolve('screenshots'));
const program = option('--program');
const example = option('--postures');
mkdirSync(out, { recursive: true });
const folder = mkdtempSync(join(tmpdir(), 'explore-'));
process.on('exit', () => rmSync(folder, { recursive: true, force: true }));

/** @param {string} binary @param {...string} rest */
const ask = (binary, ...rest) => execFileSync(binary, rest, { encoding: 'utf8', maxBuffer: 1 << 28, stdio: 'pipe' });
/** @param {string} scenario @param {number} count @returns {{ joints: number[], distances_m: number[] }[]} */
const postures = (scenario, count) =>
  ask(example, scenario, String(count))
    .trim()
    .split('\n')
    .map((line) => JSON.parse(line));
/** @param {Page} page */
const settle = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

/**
 * The scenario with its base elsewhere, as a file that finds its models.
 * @param {string} scenario
 * @param {string} toml
 * @param {string} name
 */
function elsewhere(scenario, toml, name) {
  const text = readFileSync(scenario, 'utf8').replaceAll('../models/', `${resolve(dirname(scenario), '../models')}/`);
  const lines = toml.split('\n').slice(1);
  let changed = text.replace(/^base_position_mm = .*\n(base_rpy_deg = .*\n)?/m, `${lines.join('\n')}\n`);
  if (changed === text) changed = text.replace(/^\[robot\]\n/m, `[robot]\n${lines.join('\n')}\n`);
  if (changed === text) changed = `${text}\n[robot]\n${lines.join('\n')}\n`;
  const file = join(folder, `${name}.toml`);
  writeFileSync(file, changed);
  return file;
}

/**
 * @param {Browser} running
 * @param {string} file
 * @param {{ width: number, height: number }} [size]
 * @param {() => void} [script]
 */
async function open(running, file, size = { width: 1400, height: 1000 }, script = null) {
  const page = await running.newPage({ viewport: size });
  // A picture takes long without a graphics card, and longer beside other programs.
  page.setDefaultTimeout(120_000);
  /** @type {string[]} */
  const problems = [];
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type())) problems.push(`${message.type()}: ${message.text()}`);
  });
  page.on('pageerror', (error) => problems.push(error.message));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) problems.push(`asked for ${request.url()}`);
  });
  if (script) await page.addInitScript(script);
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector('html[data-ready]', { timeout: 60_000 });
  return { page, problems };
}

/**
 * The largest difference of all pairs, m.
 * @param {Page} page
 * @param {{ joints: number[], distances_m: number[] }[]} expected
 */
async function differ(page, expected) {
  const found = await page.evaluate(
    (all) => all.map((joints) => NB.current.explore.live.pairs(joints).map((pair) => pair.distance)),
    expected.map(({ joints }) => joints),
  );
  let worst = 0;
  let count = 0;
  expected.forEach(({ distances_m: theirs }, k) => {
    assert.equal(found[k].length, theirs.length);
    theirs.forEach((distance, pair) => {
      worst = Math.max(worst, Math.abs(found[k][pair] - distance));
      count++;
    });
  });
  assert.ok(worst <= SAME_M, `distances differ by ${worst} m`);
  return { worst, count };
}

/** @param {Page} page @param {string} run @returns {Promise<any>} */
const explore = (page, run) => page.evaluate(`(() => { const explore = NB.current.explore; return ${run}; })()`);
/** @param {string} text */
const mm = (text) => Number(text.replace('\u2212', '-'));

/**
 * The table of classes against `needlebench clearance`, with the command that the page gives.
 * @param {Page} page
 * @param {string} scenario
 */
async function testCommand(page, scenario) {
  const command = await explore(page, 'explore.command(explore.joints)');
  const list = command.match(/ --joints (\S+)$/)[1];
  const { classes } = JSON.parse(ask(program, 'clearance', scenario, '--joints', list, '--json'));
  const shown = await page
    .locator('.explore table')
    .first()
    .locator('tbody tr')
    .evaluateAll((rows) => rows.map((row) => [...row.children].map((cell) => cell.textContent)));
  assert.equal(shown.length, Object.keys(classes).length);
  /** @type {{ name: string, distance: number, solids: string[] }[]} */
  const least = await explore(
    page,
    'explore.least.map((pair) => ({ name: explore.data.classes[pair.class].name, distance: pair.distance, ' +
      'solids: pair.solids }))',
  );
  least.forEach(({ name, distance, solids }, row) => {
    assert.ok(
      Math.abs(classes[name].minimum_m - distance) <= SAME_M,
      `${name}: ${distance} m, ${classes[name].minimum_m} m`,
    );
    assert.deepEqual(solids, classes[name].pair);
    assert.ok(Math.abs(mm(shown[row][1]) - distance * 1e3) <= 0.0501, `${shown[row][1]} mm is shown for ${distance} m`);
  });
}

/** @param {Page} page @param {string} scenario */
async function testJoints(page, scenario) {
  const sliders = page.locator('.explore input[type=range]');
  assert.equal(await sliders.count(), 6);
  await testCommand(page, scenario);
  // By the keyboard: half a degree.
  const before = await explore(page, 'explore.joints[2]');
  const text = await page.locator('.explore table').first().textContent();
  await sliders.nth(2).focus();
  for (let k = 0; k < 12; k++) await page.keyboard.press('ArrowRight');
  const turned = (await explore(page, 'explore.joints[2]')) - before;
  assert.ok(Math.abs((turned * 180) / Math.PI - 6) < 0.51, `twelve steps turn by ${turned} rad`);
  assert.notEqual(await page.locator('.explore table').first().textContent(), text, 'the clearances stay');
  await testCommand(page, scenario);
  // A number, and one beyond the limits.
  const number = page.locator('.explore input[type=number]').nth(4);
  await number.fill('33.25');
  await number.press('Enter');
  assert.ok(Math.abs((await explore(page, 'explore.joints[4]')) - (33.25 * Math.PI) / 180) < 1e-12);
  await number.fill('99999');
  await number.press('Enter');
  const [low, high] = await explore(page, 'explore.data.joints[4]');
  const clamped = await explore(page, 'explore.joints[4]');
  assert.ok(clamped >= low && clamped <= high, 'a joint is beyond its limit');
  await testCommand(page, scenario);
  await page.getByRole('button', { name: 'Reset joints' }).click();
  assert.equal(await explore(page, 'explore.joints[2]'), before);
}

/**
 * Drags the ring, and types; then the scenario with that base has to give the same.
 * @param {Page} page
 * @param {string} scenario
 * @param {string} name
 */
async function testBase(page, scenario, name) {
  await page.evaluate(() => {
    window.scrollTo(0, 0);
    NB.current.view.look([0.3, 0.5, -0.9], 3.5, NB.current.explore.pose().elements.slice(12, 15));
  });
  await settle(page);
  await page.locator('.view canvas').scrollIntoViewIfNeeded();
  const ring = await page.evaluate(() => {
    const { explore, view } = NB.current;
    const [x, y, z] = explore.pose().elements.slice(12, 15);
    const place = new THREE.Vector3(x + Explore.RING - 0.01, y, z).project(view.camera);
    const box = view.renderer.domElement.getBoundingClientRect();
    return [box.left + ((place.x + 1) / 2) * box.width, box.top + ((1 - place.y) / 2) * box.height];
  });
  const camera = () => page.evaluate(() => NB.current.view.camera.position.toArray());
  const [home, eye] = [await explore(page, 'explore.base.position'), await camera()];
  await page.mouse.move(ring[0], ring[1]);
  await page.mouse.down();
  for (let step = 1; step <= 6; step++) {
    await page.mouse.move(ring[0] + 6 * step, ring[1] - 4 * step);
    await settle(page);
  }
  await page.mouse.up();
  const there = await explore(page, 'explore.base.position');
  const moved = Math.hypot(there[0] - home[0], there[1] - home[1]);
  assert.ok(moved > 20 && moved < 600, `the drag moves the base by ${moved} mm`);
  assert.equal(there[2], home[2], 'the drag changes the height');
  assert.deepEqual(await camera(), eye, 'the drag turns the view');
  await page.screenshot({ path: `${out}/${name}-dragged.png` });
  let worst = 0;
  // A goal that is given from the base goes along with it in the scenario, and may miss the patient there.
  const goesAlong = await explore(page, 'explore.data.goals.some((goal) => goal.fromBase)');
  if (goesAlong)
    assert.ok(
      (await page.locator('.explore').textContent()).includes('flange_pose'),
      'nothing says that the goal goes along',
    );
  for (const [x, y, height, yaw] of [
    [null, null, null, null],
    [home[0] - 60, home[1] + 30, home[2] + 40, 20],
    [home[0] + 25, home[1] - 15, home[2] - 20, -15],
  ]) {
    if (x !== null) {
      const fields = page.locator('.base-fields input');
      const turn = await explore(page, 'explore.data.base.rpy[2]');
      for (const [k, value] of [
        [0, x],
        [1, y],
        [2, height],
        [5, turn + yaw],
      ]) {
        await fields.nth(k).fill(String(value));
        await fields.nth(k).press('Enter');
      }
    }
    if (goesAlong) continue;
    const toml = await explore(page, 'explore.toml()');
    const file = elsewhere(scenario, toml, name);
    let expected;
    // A place that the program refuses has nothing to be held against, and the page has to say why.
    try {
      expected = postures(file, POSTURES_ELSEWHERE);
    } catch (error) {
      assert.ok(
        (await page.locator('.explore [role=alert]').textContent()).includes(' overlaps the '),
        `${toml}: ${error.message}`,
      );
      continue;
    }
    worst = Math.max(worst, (await differ(page, expected)).worst);
    // The command wants a start that collides with nothing; the page has to say so, too.
    const hits = await explore(page, 'explore.startHits');
    if (hits)
      assert.throws(() => ask(program, 'clearance', file, '--joints', '0,0,0,0,0,0'), /the start posture collides/);
    else await testCommand(page, file);
  }
  await page.getByRole('button', { name: 'Reset base' }).click();
  assert.deepEqual(await explore(page, 'explore.base.position'), home);
  return worst;
}

/**
 * The eight configurations, and the one that is taken.
 * @param {Page} page
 */
async function testConfigurations(page) {
  await page.waitForFunction(() => document.querySelector('[data-rolls=all]'), null, { timeout: 30_000 });
  /** @type {LivePosture[]} */
  const found = await explore(page, 'explore.found');
  assert.equal(found.length, 8);
  // At the run's own base, what the run has found to work keeps its limits at some roll, too.
  const ok = await page.evaluate(() =>
    NB.current.goal.configurations.filter((each) => each.status === 'ok').map((each) => each.label),
  );
  for (const label of ok) assert.equal(found.find((each) => each.label === label).outcome, 'works', label);
  const reached = found.findIndex((each) => each.joints);
  await page
    .getByRole('button', { name: /^Use the posture/ })
    .nth(reached)
    .click();
  const at = await page.evaluate((index) => {
    const { explore } = NB.current;
    const { guide } = NB.current.page.scene;
    const flange = NB.forward(explore.chain(), explore.joints)[6];
    const exit = flange.multiply(NB.matrix(guide[1])).elements;
    return {
      exit: [12, 13, 14].map((k) => exit[k]),
      wanted: NB.current.extra.guideExit.slice(0, 3),
      joints: explore.found[index].joints,
      taken: explore.joints,
    };
  }, reached);
  assert.deepEqual(at.taken, at.joints);
  for (const [k, value] of at.exit.entries())
    assert.ok(Math.abs(value - at.wanted[k]) < 1e-6, `the guide is at ${at.exit}, not ${at.wanted}`);
}

/**
 * Nothing of the run is shown meanwhile, and all of it afterwards.
 * @param {Page} page
 */
async function testLeaving(page) {
  assert.ok(await page.locator('.tried-sign').isVisible());
  const shown = () =>
    page.evaluate(() => ['arm', 'witness', 'ellipsoids', 'cone'].filter((name) => NB.current.view.group(name).visible));
  assert.deepEqual(await shown(), []);
  const layer = page.locator('[aria-label="Parts of the picture"] input').first();
  await layer.click();
  assert.deepEqual(await shown(), [], 'a switch brings results into a tried posture');
  await layer.click();
  await page.getByRole('button', { name: 'Back to the run' }).click();
  assert.equal(await page.locator('.tried-sign').isVisible(), false);
  assert.ok((await shown()).includes('arm'));
  // Its replay ends it, too.
  await page.getByRole('button', { name: 'Try a posture' }).click();
  await page.waitForSelector('.view.trying');
  await page.locator('.replay input[type=range]').focus();
  await page.keyboard.press('ArrowLeft');
  assert.equal(await page.locator('.view.trying').count(), 0, 'the replay moves an arm that is not the run\u2019s');
}

for (let k = 0; k < words.length; k += 2) {
  const [scenario, file] = words.slice(k, k + 2).map((word) => resolve(word));
  const name = `explore-${basename(scenario, '.toml')}`;
  const running = await launch(SOFTWARE_GL);
  const { page, problems } = await open(running, file);
  const brought = await page.evaluate(() =>
    [NB.current.page.explore.code, NB.current.page.explore.scene].map((part) => [...NB.array(part)]),
  );
  const [code, scene] = brought.map((bytes) => Math.ceil((deflateSync(Uint8Array.from(bytes)).length * 4) / 3));
  assert.ok(code + scene <= MOST_BYTES, `code and scene add ${code + scene} bytes to the page`);
  const picture = () =>
    page.evaluate(() => {
      NB.current.view.render();
      return NB.current.view.renderer.domElement.toDataURL();
    });
  await page.evaluate(() => NB.current.seek(NB.current.end / 2));
  const before = await picture();
  await page.getByRole('button', { name: 'Try a posture' }).click();
  await page.waitForSelector('.view.trying');
  const { worst, count } = await differ(page, postures(scenario, POSTURES));
  console.log(
    `${name}: ${count} distances of ${POSTURES} postures, largest difference ${worst.toExponential(1)} m; in the ` +
      `page, code takes ${(code / 1e3).toFixed(0)} kB and the scene ${(scene / 1e3).toFixed(0)} kB`,
  );
  await testJoints(page, scenario);
  await page.screenshot({ path: `${out}/${name}.png` });
  await page.locator('.explore').screenshot({ path: `${out}/${name}-panel.png` });
  const moved = await testBase(page, scenario, name);
  console.log(`  with the base elsewhere ${moved.toExponential(1)} m`);
  await testConfigurations(page);
  const times = await page.evaluate(() => {
    const { explore } = NB.current;
    const [computed, whole, reached] = Array.from({ length: 3 }, () => /** @type {number[]} */ ([]));
    const start = [...explore.joints];
    for (let k = 0; k < 60; k++) {
      explore.joints = start.map((q, joint) => q + 0.01 * k * (joint % 2 ? 1 : -1));
      explore.evaluate();
      computed.push(explore.computedInMs);
      whole.push(explore.evaluatedInMs);
    }
    for (let k = 0; k < 5; k++) {
      explore.showReach(Explore.ROLLS, true);
      reached.push(explore.reachedInMs);
    }
    /** @param {number[]} list */
    const median = (list) => Math.round(100 * list.sort((a, b) => a - b)[list.length >> 1]) / 100;
    return { computed: median(computed), whole: median(whole), reached: median(reached) };
  });
  console.log(
    `  ms: all pairs ${times.computed}, with table and picture ${times.whole}, eight configurations at ` +
      `${await page.evaluate(() => Explore.ROLLS)} rolls ${times.reached}`,
  );
  assert.ok(times.computed <= COMPUTED_MS, `one posture takes ${times.computed} ms`);
  await testLeaving(page);
  await page.evaluate(() => {
    NB.current.seek(NB.current.end / 2);
    NB.current.view.reset();
  });
  await settle(page);
  assert.ok((await picture()) === before, 'the run looks otherwise after trying a posture');
  await page.setViewportSize({ width: 390, height: 844 });
  await page.getByRole('button', { name: 'Try a posture' }).click();
  await page.waitForSelector('.view.trying');
  await settle(page);
  await page.locator('.explore').screenshot({ path: `${out}/${name}-390.png` });
  assert.deepEqual(problems, []);
  await running.close();

  const without = await launch(NO_GL);
  const flat = await open(without, file);
  await flat.page.getByRole('button', { name: 'Try a posture' }).click();
  await flat.page.waitForSelector('.explore table');
  await testCommand(flat.page, scenario);
  assert.deepEqual(flat.problems, []);
  const old = await open(without, file, undefined, () => {
    Reflect.deleteProperty(window, 'WebAssembly');
  });
  await old.page.getByRole('button', { name: 'Try a posture' }).click();
  const said = await old.page.locator('.explore [role=status]').first().textContent();
  assert.ok(said.includes('no WebAssembly') && said.includes('needlebench clearance'), said);
  assert.deepEqual(old.problems, []);
  await without.close();
}
console.log('tried postures: all well');

import { readFileSync, existsSync } from 'node:fs';
import { SOFTWARE_GL, launch } from './browser.mjs';
const [,, url, out, w = '1600', h = '1000', ...todo] = process.argv;
const A = '/work/helpers/view/crates/viewer/src/assets/';
const browser = await launch(SOFTWARE_GL);
const page = await browser.newPage({ viewport: { width: +w, height: +h } });
page.on('console', (m) => console.log(m.type(), m.text()));
page.on('pageerror', (e) => console.log('PAGEERROR', e.stack));
await page.route('**/assets/view.js', (r) => r.fulfill({ contentType: 'text/javascript', body: ['api', 'volume', 'slices', 'room', 'planner'].map((n) => readFileSync(`${A}${n}.js`, 'utf8')).join('\n') }));
await page.route('**/assets/view.css', (r) => r.fulfill({ contentType: 'text/css', body: readFileSync('/work/helpers/view/crates/report/src/page/assets/page.css', 'utf8') + readFileSync(`${A}view.css`, 'utf8') }));
await page.goto(url);
await page.waitForSelector('html[data-ready]', { timeout: 60000 }).catch(async (e) => console.log('not ready', await page.innerText('body')));
for (const script of todo) { console.log(JSON.stringify(await page.evaluate(script))); await page.waitForTimeout(4000); }
await page.waitForTimeout(1500);
await page.screenshot({ path: out, fullPage: true });
console.log('first view', await page.evaluate(() => NB.timing.firstView));
await browser.close();

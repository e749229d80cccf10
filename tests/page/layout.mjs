// How a page looks at the widths of a telephone, a tablet, laptops and a large screen: by rectangles and pixels.
import assert from 'node:assert/strict';

/** @typedef {import('playwright-core').Page} Page */
/** @typedef {import('playwright-core').Locator} Locator */
/** @typedef {(judge: Page, locator: Locator, name: string, least?: number) => Promise<void>} NotBlank */
/**
 * @typedef {object} LayoutTools
 * @property {Page} judge
 * @property {NotBlank} notBlank
 * @property {(page: Page) => Promise<unknown>} settle
 * @property {(width: number) => string} shot file of a screenshot
 */

export const WIDTHS = [390, 768, 1024, 1400, 1920];
/** Least height of what a finger touches on narrow screens, px. */
const TAPPABLE = 32;
const NARROW = 1024;

/**
 * Runs in the page: everything that is cut, covered or too small, in words.
 * @param {{ tappable: number, narrow: number }} limits
 */
function problemsOfLayout({ tappable, narrow }) {
  const width = document.documentElement.clientWidth;
  /** @type {string[]} */
  const found = [];
  /** @param {Element} element */
  const name = (element) => {
    const text = (element.getAttribute('aria-label') || element.textContent || '').trim().slice(0, 40);
    // Of SVG it is no text.
    const classes = typeof element.className === 'string' ? element.className : '';
    return `${element.tagName.toLowerCase()}${classes ? `.${classes.replaceAll(' ', '.')}` : ''} "${text}"`;
  };
  /** @param {Element} element */
  const seen = (element) =>
    element.checkVisibility({ contentVisibilityAuto: true, visibilityProperty: true }) &&
    !element.closest('.visually-hidden');
  /** @param {Element} element */
  const box = (element) => element.getBoundingClientRect();
  /** @param {DOMRect} rect */
  const size = (rect) => rect.width > 0.5 && rect.height > 0.5;
  if (document.documentElement.scrollWidth > width)
    found.push(`the page is ${document.documentElement.scrollWidth} px wide`);

  // Nothing leaves the screen but what scrolls in a box of its own, which says so.
  for (const element of document.body.querySelectorAll('*')) {
    if (!seen(element) || element.closest('svg') || element.closest('.labels')) continue;
    const rect = box(element);
    if (!size(rect)) continue;
    const scroller = element.parentElement.closest('.scroll');
    if (!scroller && (rect.left < -0.5 || rect.right > width + 0.5))
      found.push(`${name(element)} reaches from ${Math.round(rect.left)} to ${Math.round(rect.right)}`);
    const style = getComputedStyle(element);
    if (element.matches('.scroll')) {
      const hides = element.scrollWidth > element.clientWidth + 1;
      const hint = element.parentElement.querySelector(':scope > .hint');
      if (hides && !(hint && seen(hint) && size(box(hint)) && hint.textContent.trim()))
        found.push(`${name(element)} scrolls without saying so`);
    } else if (
      style.overflowX !== 'visible' &&
      style.display !== 'inline' &&
      element.scrollWidth > element.clientWidth + 1 &&
      !element.matches('.view, .labels, canvas')
    ) {
      found.push(`${name(element)} cuts its contents: ${element.scrollWidth} px in ${element.clientWidth}`);
    }
  }

  // Texts stay within the boxes that they stand in.
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const node = texts.currentNode;
    const parent = node.parentElement;
    if (!node.textContent.trim() || !seen(parent) || parent.closest('script, style, option, svg, .labels, caption'))
      continue;
    const block = parent.closest(
      'td, th, li, p, button, label, h1, h2, h3, dd, dt, .panel, .chip, section, main, header, div',
    );
    const range = document.createRange();
    range.selectNodeContents(node);
    const outer = box(block);
    for (const rect of range.getClientRects()) {
      if (size(rect) && (rect.right > outer.right + 2 || rect.left < outer.left - 2)) {
        found.push(`"${node.textContent.trim().slice(0, 30)}" leaves its ${block.tagName.toLowerCase()}`);
        break;
      }
    }
  }

  // No two that stand side by side cover each other.
  for (const parent of document.body.querySelectorAll('main, section, div, details, header, fieldset')) {
    if (!seen(parent) || parent.closest('.labels, svg') || parent.matches('.plot, .view')) continue;
    const children = [...parent.children].filter((child) => {
      const style = getComputedStyle(child);
      return (
        (seen(child) && style.position === 'static' && !style.display.startsWith('inline') && size(box(child))) ||
        (seen(child) && child.matches('.panel, .view, .plot'))
      );
    });
    for (let a = 0; a < children.length; a++) {
      for (let b = 0; b < a; b++) {
        const [p, q] = [box(children[a]), box(children[b])];
        const across = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const down = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (across > 1 && down > 1) found.push(`${name(children[a])} covers ${name(children[b])}`);
      }
    }
  }

  // What is to be touched is large enough, and nothing lies over it.
  for (const control of document.body.querySelectorAll(
    'button, select, summary, input[type=checkbox], input[type=range]',
  )) {
    if (!seen(control) || control.matches(':disabled')) continue;
    const target = control.closest('label') || control;
    if (control.closest('.scroll')) continue;
    target.scrollIntoView({ block: 'center' });
    const rect = box(target);
    if (width <= narrow && rect.height < tappable) found.push(`${name(target)} is ${Math.round(rect.height)} px high`);
    const hit = document.elementFromPoint(
      Math.min(rect.left + Math.min(rect.width, 200) / 2, width - 1),
      rect.top + rect.height / 2,
    );
    if (!hit || !(target.contains(hit) || hit.contains(target)))
      found.push(`${name(target)} lies under ${hit ? name(hit) : 'nothing'}`);
  }
  window.scrollTo(0, 0);
  return [...new Set(found)];
}

/**
 * Colours in the last columns of pixels of a picture: a page that is cut has more than its background there.
 * @param {Page} judge
 * @param {Buffer} png
 */
const edgeColors = (judge, png) =>
  judge.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [image.width, image.height];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    return [0, image.width - 3].map(
      (x) => new Set(new Uint32Array(context.getImageData(x, 0, 3, image.height).data.buffer)).size,
    );
  }, png.toString('base64'));

/** Widths at which columns come and go, and some between. */
const STILL_AT = [390, 400, 470, 600, 610, 700, 860, 1000];

/**
 * Heights of the page over a dozen frames, after it had time to settle.
 * @param {Page} page
 */
async function heights(page) {
  await page.waitForTimeout(250);
  return page.evaluate(async () => {
    /** @type {number[]} */
    const seen = [];
    for (let frame = 0; frame < 12; frame++) {
      await new Promise((next) => {
        requestAnimationFrame(next);
      });
      seen.push(document.documentElement.scrollHeight);
    }
    return [...new Set(seen)];
  });
}

/**
 * Asserts that a page is whole at every width, folded and unfolded; `look(width)` is called at each.
 * @param {Page} page
 * @param {LayoutTools} tools
 */
export async function testLayout(page, { judge, notBlank, settle, shot }) {
  const before = page.viewportSize();
  const open = await page.evaluate(() => [...document.querySelectorAll('details')].map((each) => each.open));
  /** @type {string[]} */
  const wrong = [];
  for (const width of WIDTHS) {
    await page.setViewportSize({ width, height: 900 });
    for (const unfolded of [false, true]) {
      if (unfolded)
        await page.evaluate(() => {
          for (const each of document.querySelectorAll('details')) each.open = true;
        });
      await settle(page);
      await settle(page);
      const found = await page.evaluate(problemsOfLayout, { tappable: TAPPABLE, narrow: NARROW });
      wrong.push(...found.map((each) => `${width} px${unfolded ? ', unfolded' : ''}: ${each}`));
    }
    await page.evaluate((states) => {
      document.querySelectorAll('details').forEach((each, at) => {
        each.open = states[at];
      });
      window.scrollTo(0, 0);
    }, open);
    await settle(page);
    const whole = await page.screenshot({ path: shot(width), fullPage: true });
    for (const [side, count] of Object.entries(await edgeColors(judge, whole))) {
      if (count > 1)
        wrong.push(`${width} px: something reaches the ${side === '0' ? 'left' : 'right'} edge (${count} colours)`);
    }
    const view = page.locator('.view:visible').first();
    if (await view.count()) {
      const rect = await view.boundingBox();
      if (rect.width < Math.min(0.85 * width, 480) || rect.height < 280)
        wrong.push(`${width} px: the 3D view is ${Math.round(rect.width)} x ${Math.round(rect.height)}`);
      else {
        await view.scrollIntoViewIfNeeded();
        await settle(page);
        await notBlank(judge, view, `the 3D view at ${width} px`, 200);
      }
    }
  }
  for (const width of STILL_AT) {
    await page.setViewportSize({ width, height: 900 });
    await settle(page);
    const found = await heights(page);
    if (found.length > 1)
      wrong.push(`${width} px: the page does not come to rest, its height is ${found.join(', ')} px`);
  }
  await page.setViewportSize(before);
  await settle(page);
  assert.deepEqual(wrong, [], 'the page is cut, covered, too small or restless');
}

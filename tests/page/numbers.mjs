// Pages write numbers as the program's tables do.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';

/** @typedef {import('playwright-core').Page} Page */

const cases = JSON.parse(readFileSync(new URL('numbers.json', import.meta.url), 'utf8'));

/**
 * Holds the page's texts against those that crates/report/src/number.rs wrote into numbers.json.
 * @param {Page} page
 */
export async function testNumbers(page) {
  const wrong = await page.evaluate(
    ({ small_length: lengths, percent, shown, value_and_limit: limits, three_digits: numbers, measured }) => {
      /** @type {string[]} */
      const wrong = [];
      /** @param {string} what @param {string} text @param {string} expected */
      const check = (what, text, expected) => {
        if (text !== expected) wrong.push(`${what}: ${text} instead of ${expected}`);
      };
      for (const [value, text] of lengths) check(`length ${value}`, NB.plain.smallLength(value), text);
      for (const [value, text] of numbers) check(`number ${value}`, NB.plain.threeDigits(value), text);
      for (const [value, unit, text] of measured) check(`${value} ${unit}`, NB.plain.measured(value, unit), text);
      for (const [value, text] of percent) check(`share ${value}`, NB.plain.percent(value), text);
      for (const [name, value, text] of shown)
        check(`${name} ${value}`, NB.plain.shown[/** @type {Formats} */ (name)](value), text);
      for (const [value, limit, unit, text, bound] of limits) {
        const [own, ownBound] = NB.plain.valueAndLimit(value, limit, unit);
        check(`${value} ${unit} of ${limit}`, own, text);
        check(`limit ${limit} ${unit} of ${value}`, ownBound, bound);
      }
      return wrong;
    },
    cases,
  );
  assert.deepEqual(wrong.slice(0, 20), []);
}

// Numbers as people read them: the same texts as crates/report/src/number.rs gives, which tests/page/numbers.json
// and the tests of both sides hold against each other. `NB.typeset` is all that a page adds.
'use strict';

{
  /**
   * Pages have signs that terminals may lack: minus, micro, degree; and no minus before zero.
   * @param {string} text
   */
  const typeset = (text) =>
    text
      .replace(/^-(?=0(\.0+)?( |$))/, '')
      .replace(/^-/, '\u2212')
      .replace(/ um$/, ' \u00b5m')
      .replace(/ deg$/, '\u00b0')
      .replace(/e-/, 'e\u2212');
  /** @param {number | null | undefined} value @returns {value is null | undefined} */
  const absent = (value) => value === null || value === undefined || Number.isNaN(value);
  const NONE = '\u2013';

  /**
   * So many decimals; halves go to the even digit, as in Rust.
   * @param {number} value
   * @param {number} digits
   */
  const fixed = (value, digits) => {
    const text = Object.is(value, -0) ? `-${(0).toFixed(digits)}` : value.toFixed(digits);
    const exact = Math.abs(value) < 1e15 ? value.toFixed(Math.min(100, digits + 60)) : '';
    const point = exact.indexOf('.');
    const rest = point < 0 ? '' : exact.slice(point + 1 + digits);
    if (!/^50*$/.test(rest)) return text;
    const cut = exact.slice(0, digits ? point + 1 + digits : point);
    return Number(cut.at(-1)) % 2 === 0 ? cut : text;
  };

  /** @type {[name: string, length: number, perMetre: number][]} */
  const LENGTHS = [
    ['pm', 1e-12, 1e12],
    ['nm', 1e-9, 1e9],
    ['um', 1e-6, 1e6],
    ['mm', 1e-3, 1e3],
  ];
  /** @param {number} metres */
  const unitOfLength = (metres) => LENGTHS.findLast(([, length]) => Math.abs(metres) >= length) || LENGTHS[0];

  /** @param {number} metres */
  const smallLength = (metres) => {
    const [name, length, perMetre] = unitOfLength(metres);
    return Math.abs(metres) < length ? `< 1 ${name}` : `${fixed(metres * perMetre, 2)} ${name}`;
  };

  /**
   * Digits that show on which side of a limit a value is, at least three.
   * @param {number} value
   * @param {number} limit
   */
  const digitsApart = (value, limit) => {
    /** @param {number} number @param {number} digits */
    const rounded = (number, digits) => Number(number.toExponential(digits - 1));
    const side = Math.sign(value - limit);
    let digits = 3;
    while (digits < 17 && Math.sign(rounded(value, digits) - limit) !== side) digits++;
    const size = Math.abs(value);
    return value === 0 || (size >= 1e-3 && size < 1e7)
      ? String(rounded(value, digits))
      : value.toExponential(digits - 1).replace('e+', 'e');
  };

  /** @param {number} radians */
  const degrees = (radians) => (radians * 180) / Math.PI;
  /** @param {number} value @param {number} limit @param {string} unit */
  const valueAndLimit = (value, limit, unit) => {
    /** @param {number} each */
    const text = (each) => {
      if (unit === 'm') return limit !== 0 && Math.abs(limit) < 1e-3 ? smallLength(each) : `${fixed(each * 1e3, 2)} mm`;
      if (unit === 'rad') return `${fixed(degrees(each), 4)} deg`;
      if (unit === '1') return Number.isInteger(each) && Number.isInteger(limit) ? fixed(each, 0) : fixed(each, 4);
      return `${fixed(each, 3)} ${unit}`;
    };
    const texts = [text(value), text(limit)];
    if (texts[0] !== texts[1] || value === limit) return texts;
    const [factor, name] =
      unit === 'm' ? [1e3, ' mm'] : unit === 'rad' ? [degrees(1), ' deg'] : [1, unit === '1' ? '' : ` ${unit}`];
    return [
      `${digitsApart(value * factor, limit * factor)}${name}`,
      `${digitsApart(limit * factor, value * factor)}${name}`,
    ];
  };

  /** @param {number} share */
  const percent = (share) => {
    if (share === 0 || share === 1) return `${fixed(share * 100, 0)} %`;
    if (share > 0.9995) return '> 99.9 %';
    if (share < 0.0005) return '< 0.1 %';
    return `${fixed(share * 100, 1)} %`;
  };

  /** @param {number} value */
  const threeDigits = (value) => {
    const size = Math.abs(value);
    if (size === 0) return '0';
    if (size < 1e-4) return '< 0.0001';
    return fixed(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 0.1 ? 2 : size >= 0.01 ? 3 : 4);
  };
  /** @param {number} value @param {string} unit */
  const measured = (value, unit) => {
    if (unit === 'mm' && value !== 0 && Math.abs(value) < 0.01) return smallLength(value * 1e-3);
    return unit === '' || unit === '1' ? threeDigits(value) : `${threeDigits(value)} ${unit}`;
  };

  /** @type {Record<Formats, (value: number) => string>} */
  const shown = {
    millimetres: (value) => fixed(value * 1e3, 1),
    length: smallLength,
    number: (value) => fixed(value, 2),
    percent: (value) => fixed(100 * value, 0),
    degrees: (value) => fixed(degrees(value), 1),
  };

  /** Texts as number.rs writes them; for the test. */
  NB.plain = { smallLength, valueAndLimit, percent, shown, threeDigits, measured };

  NB.minus = (text) => text.replace('-', '\u2212');
  NB.fixed = (value, digits) => (absent(value) ? NONE : typeset(fixed(Number(fixed(value, digits)) || 0, digits)));
  NB.mm = (metres, digits = 1) => NB.fixed(absent(metres) ? NaN : metres * 1e3, digits);
  NB.deg = (radians, digits = 1) => NB.fixed(absent(radians) ? NaN : degrees(radians), digits);
  NB.percent = (share) => NB.fixed(absent(share) ? NaN : share * 100, 0);
  /** A share that is nearly none or nearly all and reads so. */
  NB.share = (share) => (absent(share) ? NONE : percent(share));
  /** A number of any size with two or three digits and no power of ten. */
  NB.threeDigits = (value) => (absent(value) ? NONE : typeset(threeDigits(value)));
  /** A value of a study with its unit, which may be mm. */
  NB.measured = (value, unit) => (absent(value) ? NONE : typeset(measured(value, unit)));
  /** A length in the unit that suits it. */
  NB.length = (metres) => (absent(metres) ? NONE : metres === 0 ? '0' : typeset(smallLength(metres)));
  /** @param {(value: number) => string} text @returns {(value: number | null | undefined) => string} */
  const orDash = (text) => (value) => (absent(value) ? NONE : typeset(text(value)));
  NB.formats = {
    millimetres: orDash(shown.millimetres),
    length: orDash(shown.length),
    number: orDash(shown.number),
    percent: orDash(shown.percent),
    degrees: orDash(shown.degrees),
  };
  /** A value and its limit, or two dashes. */
  NB.valueAndLimit = (value, limit, unit) => {
    if (absent(value) || absent(limit)) return [NB.quantity(value, unit), NB.quantity(limit, unit)];
    return valueAndLimit(value, limit, unit || '1').map(typeset);
  };
  /** A value with its SI unit as people read it. */
  NB.quantity = (value, unit) => {
    if (absent(value)) return NONE;
    if (unit === 'm') return NB.length(value);
    if (unit === 'rad') return `${NB.deg(value, 2)}\u00b0`;
    if (unit === '1' || unit === '') return NB.significant(value);
    if (unit === 'm/rad') return `${NB.fixed(value, 2)} mm/mrad`;
    return `${NB.significant(value)} ${unit}`;
  };
  NB.significant = (value) => {
    if (absent(value)) return NONE;
    if (Number.isInteger(value) && Math.abs(value) < 1e7) return NB.minus(String(value));
    return typeset(String(Number(value.toPrecision(4))));
  };
}

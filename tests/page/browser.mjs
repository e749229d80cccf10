// The Chromium that pages are opened in.
import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';

export const SOFTWARE_GL = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
/** SwiftShader draws the WebGL alone: to put pages together it takes up to eight times as long as the processor. */
export const SOFTWARE_GL_ALONE = [...SOFTWARE_GL, '--disable-gpu-compositing'];
export const NO_GL = ['--disable-gpu', '--disable-software-rasterizer', '--disable-3d-apis'];

async function executable() {
  const installed = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
  const found = process.env.CHROMIUM === 'packaged' ? null : installed.find((path) => path && existsSync(path));
  if (found) return { path: found, args: [] };
  // Makes the package unpack the libraries that a bare machine lacks, too (NSS, expat).
  process.env.AWS_LAMBDA_JS_RUNTIME ??= 'nodejs22.x';
  const { default: packaged } = await import('@sparticuz/chromium');
  return { path: await packaged.executablePath(), args: ['--no-zygote'] };
}

const browser = await executable();

/**
 * A running Chromium with further arguments.
 * @param {string[]} args
 */
export const launch = (args) =>
  chromium.launch({ executablePath: browser.path, args: ['--no-sandbox', ...browser.args, ...args] });

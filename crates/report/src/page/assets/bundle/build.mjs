// Bundles three.js for the report page: `npm ci && npm run build`. The output is committed, so that
// building needlebench needs no Node.

import { copyFile, readFile } from 'node:fs/promises';
import { build } from 'esbuild';

const { version } = JSON.parse(await readFile('node_modules/three/package.json', 'utf8'));
await build({
  entryPoints: ['entry.js'],
  outfile: '../three.bundle.js',
  bundle: true,
  minify: true,
  format: 'iife',
  globalName: 'THREE',
  target: 'es2020',
  charset: 'ascii',
  legalComments: 'none',
  banner: { js: `/* three.js ${version}, MIT licence: see three.LICENSE */` },
});
await copyFile('node_modules/three/LICENSE', '../three.LICENSE');

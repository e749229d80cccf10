// Compiles this crate to the WebAssembly that pages bring along.
//
//   node crates/live/build.mjs           makes crates/report/src/page/assets/live.wasm anew
//   node crates/live/build.mjs --check   fails where it is not what the sources give
//
// Beside it stands what it was made of: a hash of the sources and the compiler. While the hash is the same
// there is nothing to check. Where it is not, the check compiles, and the bytes have to be the same, or the asset
// is to be made anew. Another compiler gives other bytes: then only tests/page/explore.mjs, which holds the
// page's numbers against the program's, says whether they are right.
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, readdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { homedir } from 'node:os';
import { dirname, join, relative, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const TARGET = 'wasm32-unknown-unknown';
const root = resolve(dirname(fileURLToPath(import.meta.url)), '../..');
const asset = join(root, 'crates/report/src/page/assets/live.wasm');
const record = `${asset}.json`;
/** @param {string} program @param {string[]} words @param {object} [options] */
const run = (program, words, options = {}) =>
  String(execFileSync(program, words, { cwd: root, encoding: 'utf8', ...options }));

/** @param {string} folder @returns {string[]} */
function files(folder) {
  return readdirSync(folder)
    .sort()
    .flatMap((name) => {
      const path = join(folder, name);
      return statSync(path).isDirectory() ? files(path) : [path];
    });
}

/** Of all that decides about the bytes but the compiler. */
function sources() {
  const hash = createHash('sha256');
  // Versions of what is from elsewhere; paths of what is not are those of this checkout.
  const tree = run('cargo', [
    'tree',
    '--locked',
    '--package',
    'needlebench-live',
    '--target',
    TARGET,
    '--edges',
    'normal',
    '--prefix',
    'none',
    '--no-dedupe',
  ])
    .split('\n')
    .map((line) => line.replace(/ \(.*/, ''));
  const crates = [...new Set(tree)].sort();
  hash.update(crates.join('\n'));
  const workspace = readFileSync(join(root, 'Cargo.toml'), 'utf8');
  // What pages' code is compiled by; the profile of tests has no part in it.
  const profiles = workspace.match(/^\[profile\.(release|page)\b[^[]*/gm) ?? [];
  hash.update(profiles.join(''));
  for (const name of crates.filter((each) => each.startsWith('needlebench-'))) {
    const folder = join(root, 'crates', name.split(' ')[0].replace('needlebench-', ''));
    for (const path of [join(folder, 'Cargo.toml'), ...files(join(folder, 'src'))]) {
      hash.update(`\n${relative(root, path)}\n`);
      hash.update(readFileSync(path));
    }
  }
  return hash.digest('hex');
}

function compile() {
  const targets = run('rustc', ['--print', 'target-libdir', '--target', TARGET]).trim();
  // A toolchain without the target's own libraries.
  if (!existsSync(targets)) run('rustup', ['target', 'add', TARGET], { stdio: 'inherit' });
  const cargo = process.env.CARGO_HOME || join(homedir(), '.cargo');
  const remap = [
    [root, '.'],
    [cargo, 'cargo'],
  ].map(([from, to]) => `--remap-path-prefix=${from}=${to}`);
  const folder = process.env.CARGO_TARGET_DIR ? join(process.env.CARGO_TARGET_DIR, 'page') : join(root, 'target/page');
  run(
    'cargo',
    [
      'rustc',
      '--locked',
      '--package',
      'needlebench-live',
      '--lib',
      '--crate-type',
      'cdylib',
      '--profile',
      'page',
      '--target',
      TARGET,
      '--target-dir',
      folder,
    ],
    { stdio: 'inherit', env: { ...process.env, CARGO_ENCODED_RUSTFLAGS: remap.join('\x1f') } },
  );
  return readFileSync(join(folder, TARGET, 'page/needlebench_live.wasm'));
}

const now = { rustc: run('rustc', ['--version']).trim(), sources_sha256: sources() };
if (process.argv.includes('--check')) {
  const then = JSON.parse(readFileSync(record, 'utf8'));
  if (then.sources_sha256 === now.sources_sha256) console.log('live.wasm: the sources are those that it was made of');
  else if (then.rustc !== now.rustc)
    console.log(
      `live.wasm: was made by ${then.rustc} of other sources; this is ${now.rustc}, whose bytes cannot be compared`,
    );
  else if (compile().equals(readFileSync(asset)))
    console.log('live.wasm: the sources have changed, the bytes have not');
  else {
    console.error('live.wasm is not what the sources give: run `node crates/live/build.mjs` and commit it');
    process.exit(1);
  }
} else {
  const bytes = compile();
  writeFileSync(asset, bytes);
  writeFileSync(record, `${JSON.stringify(now, null, 2)}\n`);
  console.log(`live.wasm: ${(bytes.length / 1e3).toFixed(0)} kB`);
}

// Prints what Khronos's validator says of glTF files, as JSON by file: `node validate_gltf.mjs FILE...`
import { readFile } from 'node:fs/promises';

import validator from 'gltf-validator';

/** @type {{ [file: string]: object }} */
const answers = {};
for (const file of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)), { maxIssues: 100 });
  answers[file] = { ...report.issues, info: report.info };
}
console.log(JSON.stringify(answers));

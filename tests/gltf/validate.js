// node validate.js file.glb: prints what Khronos' validator finds; exit code 1 for errors or
// warnings.
const fs = require('fs');
const validator = require('gltf-validator');

validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2]))).then((report) => {
  const {numErrors, numWarnings, messages} = report.issues;
  for (const m of messages) console.log(`${m.code} ${m.pointer || ''}: ${m.message}`);
  console.log(`${numErrors} errors, ${numWarnings} warnings`);
  process.exit(numErrors + numWarnings > 0 ? 1 : 0);
}, (error) => {
  console.error(String(error));
  process.exit(1);
});

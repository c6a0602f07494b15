// Reads binary glTF files, named as arguments, and prints the validator's reports as one JSON list.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

const reports = process.argv.slice(2).map((path) => validator.validateBytes(new Uint8Array(readFileSync(path)), { maxIssues: 100 }));
console.log(JSON.stringify(await Promise.all(reports)));

// Checks GLB files with the glTF validator of Khronos: `node scripts/validate_glb.mjs FOLDER FILE...`. The validator is a package of npm, fetched into
// FOLDER when it is not there; `--fetch` instead of files does no more than that. Exit codes: 0 no error and no warning; 1 some, which are printed;
// 3 the validator cannot be had here.

import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const PACKAGE = "gltf-validator@2.0.0-dev.3.10";

const [folder, ...files] = process.argv.slice(2);
if (!folder || files.length === 0) {
    console.error("usage: node validate_glb.mjs FOLDER FILE...|--fetch");
    process.exit(2);
}
if (!existsSync(join(folder, "node_modules", "gltf-validator"))) {
    mkdirSync(folder, { recursive: true });
    try {
        const args = ["install", "--prefix", folder, "--no-audit", "--no-fund", "--no-save", PACKAGE];
        execFileSync("npm", args, { stdio: ["ignore", "ignore", "inherit"], shell: process.platform === "win32" });
    } catch (error) {
        console.error(`npm could not fetch ${PACKAGE}: ${error.message}`);
        process.exit(3);
    }
}

if (files[0] === "--fetch") {
    process.exit(0);
}
const validator = createRequire(join(resolve(folder), "here.js"))("gltf-validator");
let clean = true;
for (const file of files) {
    const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 20 });
    const { numErrors, numWarnings, numInfos, numHints } = issues;
    console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} notes, ${numHints} hints`);
    for (const { code, message, pointer, severity } of issues.messages) {
        console.log(`  ${["error", "warning", "note", "hint"][severity]} ${code} at ${pointer}: ${message}`);
    }
    clean &&= numErrors === 0 && numWarnings === 0;
}
process.exit(clean ? 0 : 1);

// Bundles the scripts and styles of the pages. `build.py` calls this.
import { copyFile, mkdir } from "node:fs/promises";
import { build } from "esbuild";

const REPLAY = "../src/evenhand/restaurant/replay/static";
const STUDY = "../src/evenhand/study/server/static";

const common = {
  bundle: true,
  minify: true,
  target: ["es2022"],
  charset: "ascii",
  legalComments: "eof", // three.js and jsPsych are MIT: their notices stay with them
  logLevel: "warning",
};

await mkdir(STUDY, { recursive: true });
await Promise.all([
  build({ ...common, format: "iife", entryPoints: ["src/main.ts"], outfile: `${REPLAY}/replay.js` }),
  build({ ...common, format: "iife", entryPoints: ["src/study/main.ts"], outfile: `${STUDY}/study.js` }),
  build({ ...common, entryPoints: ["src/study/study.css"], outfile: `${STUDY}/study.css` }),
  copyFile("src/study/index.html", `${STUDY}/index.html`),
]);

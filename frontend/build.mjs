// Bundles src/ and three.js into the one script of the page. `build.py` calls this.
import { build } from "esbuild";

await build({
  entryPoints: ["src/main.ts"],
  outfile: "../src/evenhand/replay/static/replay.js",
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2022"],
  charset: "ascii",
  legalComments: "eof", // three.js is MIT: its notice stays with it
  logLevel: "warning",
});

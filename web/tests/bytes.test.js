// The page draws what the program draws: each download is compared with the file that the page's own command line
// makes, byte for byte, by WebGPU and by the CPU in WebAssembly.

import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { ROOT, download, drop, go, launch, open, ready, run, serve } from "./support.js";

/** Recipes as links have them; `file` is dropped first, and its settings are chosen in the page. */
const RECIPES = {
  "surfaces": "",
  "daylights": "model=granada&seed=18446744073709551615",
  "one LRV, bounded before scaling": "lrv=0.4&seed=3",
  "one LRV, bounded after scaling": "lrv=0.6&bounds=scaled",
  "LRVs of a range, bounded both times": "lrv=0.2..0.6&bounds=both&count=5001",
  "a cover": "lrv=0.97&bounds=scaled&proposal=cover&count=3000",
  "a fixed intensity": "model=granada&intensity=2.5",
  "intensities of a range": "model=granada&intensity=0.15..150",
  "intensities of the data": "model=granada&intensity=data",
  "16 bits": "dtype=f16&count=4001",
  "64 bits": "dtype=f64&count=1000",
  "5 nm": "wavelengths=400:5:700",
  "12 components": "components=12",
  "a wider spread": "cov-scale=4",
  "XYZ under incandescent light": "quantity=xyz&illuminant=a&count=777",
  "lamps in more than a window": "model=houser&count=70000",
  "a dropped CSV": { file: "mine.csv", kind: "reflectance" },
  "a dropped .mat": { file: "sur_vrhel.mat" },
};

let server, browser, folder;
const files = new Map();

before(async () => {
  server = await serve();
  browser = await launch();
  folder = mkdtempSync(join(tmpdir(), "spectroll-page-"));
  run("spectroll sample munsell-vrhel -n 1000 --seed 9 -o mine.csv", folder);
  files.set("mine.csv", readFileSync(join(folder, "mine.csv")));
  files.set("sur_vrhel.mat", readFileSync(join(ROOT, "data/sur_vrhel.mat")));
  files.forEach((bytes, name) => writeFileSync(join(folder, name), bytes));
});

after(async () => {
  await browser?.close();
  server?.close();
  rmSync(folder, { recursive: true, force: true });
});

for (const engine of ["webgpu", "cpu"]) {
  test(`downloads are the program's by ${engine}`, async (t) => {
    const page = await open(browser, server.address);
    for (const [name, recipe] of Object.entries(RECIPES)) {
      await t.test(name, async () => {
        if (typeof recipe === "string") {
          await go(page, `#${recipe}&engine=${engine}`);
        } else {
          await go(page, `#engine=${engine}`);
          await drop(page, recipe.file, files.get(recipe.file));
          if (recipe.kind) {
            await page.selectOption("#kind", recipe.kind);
            await ready(page);
          }
        }
        assert.equal(await page.isVisible("#draw-refusal"), false, await page.textContent("#draw-refusal"));
        const { bytes } = await download(page, "#get-npy");
        const by = engine === "webgpu" ? "by WebGPU" : "by the CPU";
        assert.match(await page.textContent("#taken"), new RegExp(by));
        const lines = await page.textContent("#command");
        run(lines, folder);
        const theirs = readFileSync(join(folder, "draws.npy"));
        assert.ok(bytes.equals(theirs), `${lines}\n${bytes.length} and ${theirs.length} bytes`);
        assert.equal(await page.textContent("#sum"), createHash("sha256").update(theirs).digest("hex"));
      });
    }
    assert.deepEqual(page.problems, []);
    await page.context().close();
  });
}

/** Whether two values of a model are the same but for rounding. */
function alike(ours, theirs, name) {
  if (Array.isArray(ours)) ours.forEach((value, i) => alike(value, theirs[i], `${name}[${i}]`));
  else if (typeof ours === "number") assert.ok(Math.abs(ours - theirs) <= 1e-12, `${name}: ${ours} and ${theirs}`);
  else assert.equal(ours, theirs, name);
}

test("text, models and shaders are the program's too", async () => {
  const page = await open(browser, server.address, { hash: "#components=7&lrv=0.3&count=500" });
  const text = await download(page, "#get-csv");
  run(await page.textContent("#command"), folder);
  assert.ok(text.bytes.equals(readFileSync(join(folder, "draws.csv"))));
  const model = await download(page, "#get-model");
  assert.equal(model.name, "munsell-vrhel-7.json");
  // Matrix products round once where the processor can, and twice in WebAssembly: a fit may differ in its last digits.
  const theirs = JSON.parse(readFileSync(join(folder, model.name)));
  for (const [name, value] of Object.entries(JSON.parse(model.bytes))) alike(value, theirs[name], name);
  writeFileSync(join(folder, model.name), model.bytes);
  const shader = await download(page, "#get-wgsl");
  run("spectroll shader munsell-vrhel-7.json --lrv 0.3 -o mine.wgsl", folder);
  // The program names the model in a line before the text.
  const written = readFileSync(join(folder, "mine.wgsl"), "utf8");
  assert.equal(shader.bytes.toString(), written.slice(written.indexOf("\n") + 1));
  await page.context().close();
});

test("a difference of one seed is noticed", async () => {
  const page = await open(browser, server.address, { hash: "#count=100" });
  const { bytes } = await download(page, "#get-npy");
  run("spectroll sample munsell-vrhel -n 100 --seed 1 -o draws.npy", folder);
  assert.ok(!bytes.equals(readFileSync(join(folder, "draws.npy"))));
  await page.context().close();
});

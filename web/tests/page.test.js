// The page as people use it: every control, what is refused, devices that are missing or lost, small screens, the
// keyboard, an accessibility check, and the time and the size that it takes.

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { brotliCompressSync } from "node:zlib";
import { BUILT, ROOT, SHOTS, drop, go, launch, open, ready, run, serve } from "./support.js";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const TAGS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];

let server, browser, csv;

before(async () => {
  server = await serve();
  browser = await launch();
  const folder = mkdtempSync(join(tmpdir(), "spectroll-page-"));
  run("spectroll sample munsell-vrhel -n 1000 --seed 9 -o mine.csv", folder);
  csv = readFileSync(join(folder, "mine.csv"));
  rmSync(folder, { recursive: true });
  mkdirSync(SHOTS, { recursive: true });
});

after(async () => {
  await browser?.close();
  server?.close();
});

const command = (page) => page.textContent("#command");

/** Changes a control as a person would, and waits. */
async function set(page, id, value) {
  await page.evaluate(() => (document.body.dataset.state = "asked"));
  const tag = await page.$eval(`#${id}`, (e) => (e.tagName === "SELECT" ? "select" : e.type));
  if (tag === "select") await page.selectOption(`#${id}`, value);
  else if (tag === "checkbox") await page.setChecked(`#${id}`, value);
  else {
    await page.fill(`#${id}`, value);
    if (tag !== "range") await page.press(`#${id}`, "Tab");
    else await page.dispatchEvent(`#${id}`, "change");
  }
  // Some change nothing but the command.
  await page.evaluate(() => new Promise((done) => setTimeout(done, 30)));
  await page.evaluate(() => {
    if (document.body.dataset.state === "asked") document.body.dataset.state = "ready";
  });
  await ready(page);
  await page.waitForTimeout(30);
}

/** Controls in the order in which they are tried, each with what the command line then says. */
const SURFACES = [
  ["seed", "7", /--seed 7 /],
  ["count", "5000", /-n 5000 /],
  ["lrv-mode", "fixed", /--lrv 0\.4 /],
  ["lrv", "0.55", /--lrv 0\.55 /],
  ["bounds", "both", /--bounds both/],
  ["lrv-mode", "range", /--lrv 0\.2\.\.0\.6 /],
  ["lrv-low", "0.3", /--lrv 0\.3\.\.0\.6 /],
  ["lrv-high", "0.5", /--lrv 0\.3\.\.0\.5 /],
  ["lrv-mode", "none", /^(?!.*--lrv)/],
  ["cov-scale", "0.3", /--cov-scale 2 /],
  ["proposal", "plain", /--proposal plain/],
  ["quantity", "xyz", /--quantities xyz/],
  ["illuminant", "a", /--illuminant a/],
  ["dtype", "f64", /--dtype f64/],
  ["engine", "cpu", /--dtype f64/],
  ["colour", "#8899aa", /--dtype f64/],
  ["components", "4", /fit munsell vrhel -k 4 /],
  ["wavelengths", "420:20:680", /--wavelengths 420:20:680/],
];
const LIGHTS = [
  ["intensity-mode", "fixed", /--intensity 2 /],
  ["intensity", "3.5", /--intensity 3\.5 /],
  ["intensity-mode", "range", /--intensity 0\.15\.\.150 /],
  ["intensity-low", "1", /--intensity 1\.\.150 /],
  ["intensity-high", "9", /--intensity 1\.\.9 /],
  ["intensity-mode", "data", /--intensity data /],
];
const FILES = [
  ["kind", "reflectance", /--kind reflectance/],
  ["layout", "rows", /--layout rows/],
  ["missing", "drop", /--missing drop/],
  ["missing-value", "-999", /--missing-value=-999/],
  ["unit", "nm", /--unit nm/],
];

test("every control says what it does in the command line", async () => {
  const page = await open(browser, server.address);
  const tried = new Set();
  const attempt = async (list) => {
    for (const [id, value, expected] of list) {
      await set(page, id, value);
      tried.add(id);
      assert.match(await command(page), expected, `${id} = ${value}`);
    }
  };
  await attempt(SURFACES);
  assert.match(await page.textContent("#engine-state"), /Drawn by the CPU in WebAssembly/);
  await page.click("#new-seed");
  await ready(page);
  assert.doesNotMatch(await command(page), /--seed 7 /);
  // The address of all that shows the same in another tab.
  const hash = await page.evaluate(() => location.hash);
  const other = await open(browser, server.address, { hash });
  assert.equal(await command(other), await command(page));
  assert.equal(await other.textContent("#accepted"), await page.textContent("#accepted"));
  await other.context().close();
  for (const name of ["macbeth", "koivisto", "krinov", "houser", "granada"]) {
    await page.check(`input[name="model"][value="${name}"]`);
    await ready(page);
    assert.match(await command(page), new RegExp(`sample ${name} `), name);
    assert.equal(await page.isVisible("#refusal"), false, await page.textContent("#refusal"));
  }
  await set(page, "quantity", "spectra");
  await attempt(LIGHTS);
  await drop(page, "mine.csv", csv);
  await attempt(FILES);
  await set(page, "layout", "");
  await set(page, "percent", true);
  tried.add("percent");
  assert.match(await command(page), /--scale 0\.01/);
  await set(page, "percent", false);
  await set(page, "measured-at", "400:10:700");
  tried.add("measured-at");
  assert.match(await command(page), /mine\.csv@400:10:700/);
  await set(page, "array", "spectra");
  tried.add("array");
  assert.match((await command(page)) + (await page.textContent("#refusal")), /spectra/);
  const all = await page.$$eval("main input[id], main select[id]", (list) => list.map(({ id }) => id));
  const untried = all.filter((id) => !tried.has(id) && id !== "file");
  assert.deepEqual(untried, []);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("a slider redraws while it moves", async () => {
  const page = await open(browser, server.address, { hash: "#lrv=0.4&engine=cpu" });
  const milliseconds = await page.evaluate(async () => {
    const slider = document.getElementById("lrv");
    const times = [];
    for (let i = 0; i < 20; i++) {
      slider.value = String(0.3 + i / 100);
      const start = performance.now();
      document.body.dataset.state = "asked";
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      while (document.body.dataset.state !== "ready") await new Promise((done) => setTimeout(done, 1));
      times.push(performance.now() - start);
    }
    return times.sort((a, b) => a - b)[10];
  });
  console.log(`# a slider redraws in ${milliseconds.toFixed(1)} ms (median of 20)`);
  await page.context().close();
});

test("a file is read on this machine", async () => {
  const page = await open(browser, server.address);
  const requests = [];
  page.on("request", (request) => requests.push(request.url()));
  await drop(page, "mine.csv", csv);
  assert.equal(await page.isVisible("#refusal"), false, await page.textContent("#refusal"));
  const times = await page.evaluate(() => {
    const at = (name) => performance.getEntriesByName(name).at(-1).startTime;
    return { model: at("model") - at("drop"), draws: at("draws") - at("drop") };
  });
  console.log(`# 1,000 spectra: model after ${times.model.toFixed(0)} ms, draws after ${times.draws.toFixed(0)} ms`);
  assert.match(await page.textContent("#account"), /comma/);
  assert.match(await page.textContent("#account"), /taken for reflectances/);
  assert.match(await page.textContent("#explained"), /1,000 reflectances/);
  assert.deepEqual(requests.filter((url) => !url.startsWith("blob:")), [], "nothing is sent while a file is read");
  await page.context().close();
});

test("files that are refused say why, and the page goes on", async () => {
  const page = await open(browser, server.address);
  for (const [name, bytes, expected] of [
    ["photo.png", Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), /is a picture, which is not read/],
    ["empty.csv", Buffer.alloc(0), /is empty/],
    ["notes.txt", Buffer.from("dear diary\nnothing today\n"), /notes\.txt/],
    ["model.json", Buffer.from('{"weight_covariance": 1}'), /is a model, fitted already/],
    ["cut.mat", readFileSync(join(ROOT, "data/sur_vrhel.mat")).subarray(0, 5000), /cut\.mat/],
    ["cut.h5", Buffer.from("\x89HDF\r\n\x1a\n" + "x".repeat(300), "latin1"), /cut\.h5|library failed/],
    ["cut.parquet", Buffer.from("PAR1" + "x".repeat(300) + "PAR1", "latin1"), /cut\.parquet|library failed/],
    ["percent.csv", Buffer.from("nm,sur_a,sur_b,sur_c\n400,10,20,30\n550,20,30,35\n700,30,20,10\n"), /percent|divide/],
  ]) {
    await drop(page, name, bytes);
    if (name === "percent.csv") {
      await page.selectOption("#kind", "reflectance");
      await ready(page);
    }
    assert.match(await page.textContent("#refusal"), expected, name);
    assert.match(await command(page), /^#/, name);
  }
  await page.check('input[name="model"][value="granada"]');
  await ready(page);
  assert.equal(await page.isVisible("#refusal"), false);
  assert.match(await command(page), /sample granada/);
  await page.context().close();
});

test("settings that cannot be drawn say why", async () => {
  const page = await open(browser, server.address);
  for (const [hash, expected] of [
    ["#lrv=0.99999&bounds=scaled", /the largest is 0\.9959/],
    ["#seed=x", /the seed is "x"/i],
    ["#count=0", /the number of draws is "0"/i],
    ["#count=2000000", /this page makes 1 to 1,000,000/],
    ["#model=granada&intensity=5..2", /intensit/i],
  ]) {
    await go(page, hash);
    assert.match(await page.textContent("#draw-refusal"), expected, hash);
  }
  await go(page, "#wavelengths=foo");
  assert.match(await page.textContent("#refusal"), /no wavelengths/);
  await go(page, "#");
  assert.equal(await page.isVisible("#refusal"), false);
  assert.equal(await page.isVisible("#draw-refusal"), false);
  await page.context().close();
});

test("metamers are drawn of a colour, and the nearest is offered of one that no surface has", async () => {
  const page = await open(browser, server.address);
  assert.match(await page.textContent("#metamers-remark"), /candidates of this colour/);
  await set(page, "colour", "#00ff00");
  assert.match(await page.textContent("#colour-refusal"), /No surface of this model has this colour/);
  await page.click("#nearest");
  await page.waitForFunction(() => document.getElementById("colour-refusal").hidden);
  assert.match(await page.textContent("#metamers-remark"), /candidates of this colour/);
  assert.notEqual(await page.inputValue("#colour"), "#00ff00");
  assert.match(await page.evaluate(() => location.hash), /colour=/);
  await page.check('input[name="model"][value="granada"]');
  await ready(page);
  assert.equal(await page.isVisible("#metamers"), false);
  await page.context().close();
});

test("WebGPU draws where it is there", async () => {
  const page = await open(browser, server.address);
  assert.match(await page.textContent("#engine-state"), /Drawn by WebGPU \(.*\), plain arithmetic, the CPU’s bytes/);
  await page.context().close();
});

test("without WebGPU the CPU draws, and says so", async () => {
  const plain = await launch({ webgpu: false });
  const page = await open(plain, server.address);
  assert.match(await page.textContent("#engine-state"), /Drawn by the CPU in WebAssembly: /);
  assert.match(await page.textContent("#accepted"), /^75\./);
  await set(page, "engine", "webgpu");
  assert.match(await page.textContent("#draw-refusal"), /WebGPU cannot draw this/);
  await plain.close();
});

test("a lost device is replaced by the CPU, with the same draws", async () => {
  const page = await open(browser, server.address, { hash: "#count=5000&seed=5" });
  assert.match(await page.textContent("#engine-state"), /WebGPU/);
  const before = await page.textContent("#accepted");
  await page.evaluate(async () => {
    await window.spectroll.library.call("lose");
    await window.spectroll.update();
  });
  await ready(page);
  assert.match(await page.textContent("#engine-state"), /Drawn by the CPU in WebAssembly: the WebGPU device was lost/);
  assert.equal(await page.textContent("#accepted"), before);
  await page.context().close();
});

test("the keyboard reaches every control", async () => {
  const page = await open(browser, server.address);
  const reached = new Set();
  for (let i = 0; i < 60; i++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => document.activeElement.id || document.activeElement.name || document.activeElement.className));
  }
  for (const id of ["skip", "model", "file", "seed", "new-seed", "count", "lrv-mode", "cov-scale", "engine", "components", "wavelengths", "quantity", "get-npy", "copy-link", "command", "copy-command"]) {
    assert.ok(reached.has(id) || (id === "command" && reached.has("command")), `${id} of ${[...reached]}`);
  }
  await page.focus("#components");
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => document.getElementById("command").textContent.includes("-k 7"));
  await page.context().close();
});

for (const [name, options] of Object.entries({
  "light": { colorScheme: "light" },
  "dark": { colorScheme: "dark" },
  "phone": { colorScheme: "light", viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 },
  "phone-dark": { colorScheme: "dark", viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 },
})) {
  test(`${name}: no violation of accessibility, nothing wider than the screen`, async () => {
    const page = await open(browser, server.address, options);
    const check = async (state) => {
      const width = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
      assert.ok(width[0] <= width[1], `${state}: ${width}`);
      await page.evaluate(AXE);
      const { violations } = await page.evaluate((tags) => window.axe.run(document, { runOnly: tags }), TAGS);
      const said = violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join("\n  ")}`);
      assert.deepEqual(said, [], state);
    };
    await check("surfaces");
    await page.screenshot({ path: join(SHOTS, `${name}.png`), fullPage: true });
    await go(page, "#model=granada&intensity=0.15..150");
    await check("lights");
    await page.screenshot({ path: join(SHOTS, `${name}-daylights.png`), fullPage: true });
    await go(page, "#lrv=0.2..0.6");
    await drop(page, "mine.csv", csv);
    await check("a file");
    await page.screenshot({ path: join(SHOTS, `${name}-file.png`), fullPage: true });
    await drop(page, "lights.csv", Buffer.from("nm,a,b\n400,10,20\n550,20,30\n700,30,20\n"));
    await check("a file that does not say its kind");
    await page.context().close();
  });
}

test("all that is shipped weighs less than 1.5 MB", async () => {
  const page = await open(browser, server.address);
  const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0].startTime);
  const files = readdirSync(BUILT, { recursive: true }).map((name) => join(BUILT, name)).filter((path) => statSync(path).isFile());
  const bytes = files.reduce((sum, path) => sum + brotliCompressSync(readFileSync(path)).length, 0);
  console.log(`# first paint after ${paint.toFixed(0)} ms; ${files.length} files, ${bytes} bytes by Brotli`);
  assert.ok(bytes < 1_500_000, `${bytes} bytes`);
  await page.context().close();
});

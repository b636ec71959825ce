// What the tests share: a server of the built page, a browser, and the program that makes the same bytes.

import { execFileSync, spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const ROOT = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
export const BUILT = join(ROOT, "target/page");
export const SHOTS = join(ROOT, "target/page-pictures");
export const PROGRAM = process.env.SPECTROLL ?? join(ROOT, "target/release/spectroll");
const BROWSER = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);

/** A software adapter, so that WebGPU is there on every machine. */
const WEBGPU = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"];

/** Serves the page; returns its address and what ends it. */
export async function serve() {
  const server = spawn("python3", [join(ROOT, "web/serve.py"), BUILT], { stdio: ["ignore", "pipe", "inherit"] });
  const lines = createInterface({ input: server.stdout });
  const address = await new Promise((resolve, reject) => {
    lines.once("line", resolve);
    server.once("exit", () => reject(new Error("the server ended: is the page built (make web)?")));
  });
  return { address, close: () => server.kill() };
}

export function launch({ webgpu = true, args = [] } = {}) {
  const off = ["--disable-features=WebGPU", "--disable-gpu"];
  return chromium.launch({ executablePath: BROWSER, args: ["--no-sandbox", ...(webgpu ? WEBGPU : off), ...args] });
}

/** Opens the page in a state, and waits until it has drawn. Whatever the page says on the console is an error. */
export async function open(browser, address, { hash = "", ...options } = {}) {
  const context = await browser.newContext({ viewport: { width: 1360, height: 1000 }, acceptDownloads: true, ...options });
  const page = await context.newPage();
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") page.problems.push(message.text());
  });
  await page.goto(address + hash);
  await ready(page);
  return page;
}

/** Waits until the page has done what it was asked for. */
export async function ready(page) {
  await page.waitForFunction(() => document.body.dataset.state === "ready", null, { timeout: 120000 });
}

/** Goes to a state of the page, as a link would. */
export async function go(page, hash) {
  await page.evaluate((hash) => {
    document.body.dataset.state = "asked";
    history.replaceState(null, "", hash);
    window.dispatchEvent(new HashChangeEvent("hashchange"));
  }, hash);
  await ready(page);
}

/** Drops a file on the page, as from a file manager. */
export async function drop(page, name, bytes) {
  const transfer = await page.evaluateHandle(
    ({ name, base64 }) => {
      const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
      const transfer = new DataTransfer();
      transfer.items.add(new File([bytes], name));
      return transfer;
    },
    { name, base64: bytes.toString("base64") },
  );
  await page.evaluate(() => (document.body.dataset.state = "asked"));
  await page.dispatchEvent("body", "dragover", { dataTransfer: transfer });
  await page.dispatchEvent("body", "drop", { dataTransfer: transfer });
  await ready(page);
}

/** Clicks a button that downloads, and returns the file's name and bytes. */
export async function download(page, button) {
  const [file] = await Promise.all([page.waitForEvent("download", { timeout: 120000 }), page.click(button)]);
  const chunks = [];
  for await (const chunk of await file.createReadStream()) chunks.push(chunk);
  await page.waitForFunction(() => !document.getElementById("taken").textContent.startsWith("Writing"));
  return { name: file.suggestedFilename(), bytes: Buffer.concat(chunks) };
}

/** Runs the command lines of the page in a folder, as a shell would. */
export function run(lines, folder) {
  const script = `set -e\nspectroll() { '${PROGRAM}' "$@" --force; }\n${lines}`;
  execFileSync("bash", ["-c", script], { cwd: folder, stdio: ["ignore", "pipe", "pipe"] });
}

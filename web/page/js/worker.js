// The library and the engines, off the page's own thread.

import init, { Data, Metamers, builtins, encodeColours, locus } from "../library/spectroll.js";
import { Gpu } from "./gpu.js";

/** Draws whose curves and colours are shown. */
const SHOWN = 200;
/** Draws whose chromaticities are shown. */
const DOTS = 2000;
/** Measured spectra whose curves are shown. */
const CURVES = 200;
/** Draws that are made at a time. */
const WINDOW = 65536;
/** Draws of a preview, while a slider moves. */
const PREVIEW = 2000;

let data = null;
let fitted = null;
let kind = null;
/** Recipes that were made, by their settings: building one takes a pilot run. */
const drawings = new Map();
const MOST_DRAWINGS = 12;

let gpu = null;
let gpuReason = "this browser has no WebGPU";

const ready = (async () => {
  await init();
  await openGpu();
})();

async function openGpu() {
  try {
    gpu = await Gpu.open();
    gpu.onLost = (reason) => {
      gpu = null;
      gpuReason = `the WebGPU device was lost (${reason})`;
    };
  } catch (error) {
    gpu = null;
    gpuReason = error.message;
  }
}

function forget() {
  drawings.forEach(({ drawing }) => drawing.free());
  drawings.clear();
  gpu?.forget();
}

/** The recipe of some settings, built once. */
function drawingOf(recipe, quantities) {
  const key = JSON.stringify([recipe, quantities]);
  let found = drawings.get(key);
  if (!found) {
    found = { key, drawing: fitted.recipe(JSON.stringify(recipe), quantities) };
    drawings.set(key, found);
    if (drawings.size > MOST_DRAWINGS) {
      const [oldest, { drawing }] = drawings.entries().next().value;
      drawings.delete(oldest);
      gpu?.drop(oldest);
      drawing.free();
    }
  }
  return found;
}

/** Makes draws in windows, with WebGPU where asked and possible, and says by what. */
async function* windows({ key, drawing }, names, { seed, count, engine }) {
  const first = Math.min(count, WINDOW);
  let pipeline = null;
  let by = { engine: "cpu", reason: engine === "cpu" ? "" : gpuReason };
  if (engine !== "cpu" && gpu) {
    try {
      pipeline = await gpu.pipeline(key, drawing);
      by = pipeline.isExact
        ? { engine: "webgpu", arithmetic: pipeline.arithmetic, adapter: gpu.name }
        : { engine: "cpu", reason: `${gpu.name} does not round as the CPU does, in either form of arithmetic` };
      if (!pipeline.isExact) pipeline = null;
    } catch (error) {
      if (gpu) by.reason = `${gpu.name}: ${error.message}`;
      else by.reason = gpuReason;
    }
  }
  if (engine === "webgpu" && !pipeline) throw { message: `WebGPU cannot draw this: ${by.reason}`, control: "engine" };
  // A shader waits for its compilation and its trial once, which say nothing of the rate.
  const began = performance.now();
  for (let start = 0; start < count; start += first) {
    const size = Math.min(first, count - start);
    let arrays = null;
    if (pipeline) {
      try {
        arrays = await gpu.draw(pipeline, drawing, { seed, first: start, count: size });
      } catch (error) {
        // A device may be lost at any time: the CPU goes on from the same draw, with the same bytes.
        await new Promise((resolve) => setTimeout(resolve));
        by = { engine: "cpu", reason: gpu ? error.message : gpuReason };
        pipeline = null;
        if (engine === "webgpu") throw { message: by.reason, control: "engine" };
      }
    }
    if (!arrays) {
      const drawn = drawing.draw(seed, BigInt(start), size);
      arrays = Object.fromEntries(names.map((name) => [name, name === "attempts" ? drawn.words(name) : drawn.values(name)]));
      arrays.counts = drawn.counts();
      drawn.free();
    }
    yield { arrays, by, began };
  }
}

function namesOf(drawing) {
  return drawing.formats().split(",").map((format) => format.split(" ")[0]);
}

const calls = {
  async start() {
    return { builtins: JSON.parse(builtins()), locus: locus(), gpu: gpu?.name ?? null, reason: gpuReason };
  },

  /** Opens a built-in model's data, or a file; `kind` is that which the page has chosen. */
  async open({ builtin, file, bytes, reading, chosen }) {
    const opened = builtin ? Data.builtin(builtin) : Data.read(file, new Uint8Array(bytes), JSON.stringify(reading));
    data?.free();
    data = opened;
    const facts = JSON.parse(data.facts());
    const tables = facts.tables.map((table, index) => ({
      ...table,
      wavelengths: data.wavelengths(index),
      values: data.curves(index, CURVES),
      colours: data.colours(index, CURVES, chosen ?? ""),
    }));
    return { ...facts, tables };
  },

  async fit({ settings }) {
    const made = data.fit(JSON.stringify(settings));
    forget();
    fitted?.free();
    fitted = made;
    const facts = JSON.parse(fitted.facts());
    kind = facts.kind;
    return { ...facts, chromaticities: fitted.chromaticities(), file: fitted.fileName() };
  },

  /** Draws what the page shows. While a slider moves, few draws are made, by the CPU, whose first are the same. */
  async draw({ recipe, seed, count, engine, isPreview }) {
    const started = performance.now();
    const found = drawingOf(recipe, "");
    const { drawing } = found;
    const names = namesOf(drawing);
    const built = performance.now();
    const shown = {};
    const counts = [0, 0, 0];
    let by = null;
    let begun = built;
    const asked = isPreview ? { seed, count: Math.min(count, PREVIEW), engine: "cpu" } : { seed, count, engine };
    for await (const { arrays, by: drawer, began } of windows(found, names, asked)) {
      if (!by) {
        for (const name of names) {
          const width = arrays[name].length / arrays.attempts.length;
          shown[name] = arrays[name].slice(0, width * (name === "chromaticity" ? DOTS : SHOWN));
        }
      }
      by = drawer;
      begun = began;
      arrays.counts.forEach((n, i) => (counts[i] += n));
    }
    const milliseconds = performance.now() - begun;
    const isLight = kind === "illuminant";
    return {
      spectra: shown.spectra,
      chromaticity: shown.chromaticity ?? new Float32Array(),
      lrv: shown.lrv ?? new Float32Array(),
      colours: shown.linear_srgb ? encodeColours(shown.linear_srgb, isLight) : new Uint8Array(),
      counts,
      acceptance: drawing.acceptance(),
      boxes: drawing.boxes(),
      by,
      milliseconds,
      preparation: built - started,
      isPreview: Boolean(isPreview),
    };
  },

  /** Spectra of a colour, and their colours under some lights. */
  async metamers({ colour, seed, count }) {
    const rgb = Uint8Array.from(colour.match(/../g), (two) => parseInt(two, 16));
    const drawn = fitted.metamers(rgb, seed, count);
    const lights = Metamers.lights().split(",").map((name, i) => ({ name, colours: drawn.colours(i) }));
    const result = { spectra: drawn.spectra(), lights, counts: drawn.counts() };
    drawn.free();
    return result;
  },

  /** The bytes of a file of draws, and their sum. */
  async download({ recipe, quantity, dtype, seed, count, engine, format }) {
    const found = drawingOf(recipe, quantity);
    const { drawing } = found;
    const file = drawing.export(format, quantity, dtype, seed, count);
    const parts = [];
    let by = null;
    for await (const { arrays, by: drawer } of windows(found, namesOf(drawing), { seed, count, engine })) {
      by = drawer;
      const column = arrays[quantity];
      parts.push(file.write(new Uint8Array(column.buffer, column.byteOffset, column.byteLength)));
    }
    parts.push(file.finish());
    const bytes = new Uint8Array(await new Blob(parts).arrayBuffer());
    return { bytes, sha256: await sum(bytes), by };
  },

  async command({ recipe, file, dtype, count, seed }) {
    return fitted.command(JSON.stringify(recipe), file, dtype, count, seed);
  },

  async model() {
    const bytes = new TextEncoder().encode(fitted.json());
    return { bytes, sha256: await sum(bytes) };
  },

  async wgsl({ recipe }) {
    const bytes = new TextEncoder().encode(drawingOf(recipe, recipe.quantities.join(",")).drawing.wgsl());
    return { bytes, sha256: await sum(bytes) };
  },

  /** Loses the device, as a driver's reset would: for those who try what the page then does. */
  async lose() {
    await gpu?.lose();
    return gpuReason;
  },
};

async function sum(bytes) {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A refusal of the library, which is JSON, or any other error. */
function refusalOf(error) {
  if (typeof error === "string") return JSON.parse(error);
  return { message: error.message ?? String(error), control: error.control };
}

// One call at a time, in order: a fit that is under way is what the next draws are of.
let queue = ready;
self.onmessage = ({ data: { id, name, request } }) => {
  queue = queue.then(async () => {
    try {
      self.postMessage({ id, result: await calls[name](request) });
    } catch (error) {
      // What ends the module itself, as no message of the library does, ends the worker.
      const isFatal = error instanceof WebAssembly.RuntimeError || error instanceof RangeError;
      const refusal = isFatal ? { message: `the library failed (${error.message}); it was started again` } : refusalOf(error);
      self.postMessage({ id, error: refusal, isFatal });
    }
  });
};

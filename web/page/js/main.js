// The page: what is chosen is read, fitted and drawn, in that order, and as much of that again as a change asks for.

import { arrange, element, keepApart, listBuiltins, listFile, refuse, show, take } from "./controls.js";
import { Latest, Library } from "./library.js";
import { surface as clear } from "./plot.js";
import {
  basisPanel, chipsPanel, chromaticityPanel, curvesPanel, dataPanel, left, leftPanel, meanPanel,
  metamerChipsPanel, metamerCurvesPanel,
} from "./panels.js";
import { DEFAULTS, FILE, drawsOf, fromAddress, recipeOf, toAddress } from "./state.js";
import { Take } from "./take.js";

/** Steps of an update: each begins with all that come after it. */
const [DRAW, FIT, OPEN] = [1, 2, 3];

const state = fromAddress(location.hash);
/** What is shown: the data, the model and its draws. */
const view = { data: null, model: null, draws: null, metamers: null, locus: [] };
/** The file that was dropped. */
let dropped = null;
let builtins = [];

const library = new Library();
const taking = new Take(library, () => ({ state, model: view.model }));

// ---- updates

let wanted = 0;
const updates = new Latest(async ({ isPreview }, isStale) => {
  const step = view.model ? wanted : OPEN;
  wanted = 0;
  setBusy(true);
  try {
    if (step >= OPEN) await open();
    if (step >= FIT) await fit();
    if (!isStale() || isPreview) await draw(isPreview);
    if (!isPreview) {
      await taking.refresh();
      if (!isStale()) await drawMetamers();
    }
  } catch (error) {
    fail(error);
  }
  if (!isStale()) setBusy(false);
});

function update(step, isPreview = false) {
  wanted = Math.max(wanted, step);
  setBusy(true);
  arrange(state, view.model?.kind ?? view.data?.kind, view.model?.has_powers);
  if (!isPreview) keepAddress();
  return updates.ask({ isPreview });
}

function setBusy(isBusy) {
  document.body.dataset.state = isBusy ? "busy" : "ready";
}

function keepAddress() {
  if (state.model !== FILE) history.replaceState(null, "", toAddress(state));
}

const reading = () => ({
  array: element("array").value,
  measured_at: element("measured-at").value,
  layout: element("layout").value,
  unit: element("unit").value,
  missing_value: element("missing-value").value.trim() === "" ? null : Number(element("missing-value").value),
  percent: element("percent").checked,
});

async function open() {
  const isFile = state.model === FILE;
  const source = isFile ? { file: dropped.name, bytes: dropped.bytes, reading: reading() } : { builtin: state.model };
  const chosen = isFile ? element("kind").value : "";
  try {
    view.data = await library.call("open", { ...source, chosen });
  } catch (error) {
    throw { ...error, isOfData: true };
  }
  if (isFile) {
    account(view.data);
    const most = Math.min(view.data.spectra - 1, view.data.tables[0].bands);
    if (Number(state.components) > most) state.components = String(Math.max(1, most));
    element("components").value = state.components;
    keepNote();
  }
  element("reading").hidden = !isFile;
  element("reading").open ||= isFile && view.data.is_guess;
}

async function fit() {
  const isFile = state.model === FILE;
  const settings = {
    components: Number(state.components),
    kind: (isFile && element("kind").value) || null,
    wavelengths: state.wavelengths,
    missing: isFile ? element("missing").value : "error",
  };
  try {
    view.model = await library.call("fit", { settings });
  } catch (error) {
    throw { ...error, isOfData: true };
  }
  view.data.kind = view.model.kind;
  refuse("refusal", null);
  const slider = element("components");
  slider.max = String(Math.max(view.model.all_explained.length, view.model.basis.length));
  slider.value = state.components;
  arrange(state, view.model.kind, view.model.has_powers);
  performance.mark("model");
  document.body.classList.remove("stale");
  paintModel();
}

async function draw(isPreview) {
  const { kind } = view.model;
  const request = { recipe: recipeOf(state, kind, ["linear_srgb"]), ...drawsOf(state), engine: state.engine, isPreview };
  view.draws = await library.call("draw", request);
  refuse("draw-refusal", null);
  performance.mark("draws");
  paintDraws();
}

/** Number of metamers. */
const METAMERS = 60;

async function drawMetamers() {
  if (view.model.kind !== "reflectance") return;
  try {
    view.metamers = await library.call("metamers", { colour: state.colour, seed: drawsOf(state).seed, count: METAMERS });
    refuse("colour-refusal", null);
    paintMetamers();
  } catch (error) {
    view.metamers = null;
    refuseColour(error);
  }
}

/** Says why there are no metamers of a colour, and offers the nearest of which there are. */
function refuseColour(error) {
  const { nearest } = error;
  refuse("colour-refusal", nearest ? { message: "No surface of this model has this colour." } : error);
  clear(element("metamer-curves"));
  clear(element("metamer-chips"));
  element("metamers-remark").textContent = "";
  if (!nearest) return;
  const button = Object.assign(document.createElement("button"), { type: "button", id: "nearest", textContent: `Take the nearest, ${nearest}` });
  button.onclick = () => {
    element("colour").value = nearest;
    element("colour").focus();
    changed(element("colour"), false);
  };
  element("colour-refusal").append(button);
}

function fail(error) {
  if (error.isOfData) {
    // What is shown is of other data, and fades.
    view.model = null;
    refuse("refusal", error);
    document.body.classList.add("stale");
    element("reading").hidden = state.model !== FILE;
  } else {
    refuse("draw-refusal", error);
  }
  taking.refresh();
}

// ---- what is shown

const percent = (share) => `${(100 * share).toFixed(share > 0.9999 || share < 0.01 ? 3 : 2)} %`;

function paintModel() {
  const { data, model } = view;
  const isLight = model.kind === "illuminant";
  const what = isLight ? "lights" : "reflectances";
  const rest = left(model.explained).at(-1);
  const k = model.basis.length;
  const of = `${model.spectra.toLocaleString("en")} ${what} at ${model.grid} nm`;
  element("explained").textContent = `${k} ${k === 1 ? "component explains" : "components explain"} ${(100 - rest).toFixed(rest < 0.01 ? 4 : 2)} % of ${of}.`;
  const many = data.spectra > 200 ? `some of ${data.spectra.toLocaleString("en")}` : `all ${data.spectra}`;
  element("data-caption").textContent = `As measured, ${many}`;
  const shares = model.explained.slice(0, 3).map((share) => `${(100 * share).toFixed(1)} %`);
  element("basis-caption").textContent = `Basis: ${shares.join(", ")}${k > 3 ? " …" : ""}`;
  element("left-caption").textContent = `Variance left unexplained: ${rest < 0.001 ? rest.toExponential(1) : rest.toFixed(3)} %`;
  element("model-notes").replaceChildren(
    ...[...model.notes, ...model.unusual].map((note) => Object.assign(document.createElement("li"), { textContent: note })),
  );
  dataPanel(element("data"), data);
  meanPanel(element("mean"), model);
  basisPanel(element("basis"), model);
  leftPanel(element("left"), model);
}

function paintDraws() {
  const { draws, model } = view;
  const bands = model.wavelengths.length;
  const shown = draws.spectra.length / bands;
  element("curves-caption").textContent = `The first ${shown} draws, each in its colour`;
  element("chips-caption").textContent =
    model.kind === "illuminant" ? `Colours of the same ${shown}, as bright as can be` : `The same ${shown} under ${SEEN[state.illuminant]}`;
  curvesPanel(element("curves"), view);
  chipsPanel(element("chips"), view);
  chromaticityPanel(element("chromaticity"), view);
  const [made, attempts, above] = draws.counts;
  element("accepted").textContent = percent(made / attempts);
  if (draws.isPreview) return;
  element("drawn").textContent = made.toLocaleString("en");
  element("time").textContent = draws.milliseconds < 10 ? `${draws.milliseconds.toFixed(1)} ms` : `${Math.round(draws.milliseconds).toLocaleString("en")} ms`;
  const rate = made / draws.milliseconds / 1000;
  element("rate").textContent = made < 1000 ? "–" : `${rate.toFixed(rate < 10 ? 2 : 1)} million/s`;
  const remarks = [];
  if (above > 0) {
    remarks.push(`${percent(above / made)} of the draws are above 1 somewhere after scaling: keep them below with “after scaling” or “before and after”.`);
  }
  if (draws.boxes > 0) remarks.push(`Candidates come from a cover of ${draws.boxes.toLocaleString("en")} boxes, since next to none of the Gaussian’s would do.`);
  element("remark").textContent = remarks.join(" ");
  const { engine, arithmetic, adapter, reason } = draws.by;
  element("engine-state").textContent =
    engine === "webgpu"
      ? `Drawn by WebGPU (${adapter}), ${arithmetic} arithmetic, the CPU’s bytes`
      : `Drawn by the CPU in WebAssembly${reason ? `: ${reason}` : ""}`;
}

function paintMetamers() {
  metamerCurvesPanel(element("metamer-curves"), view);
  metamerChipsPanel(element("metamer-chips"), view);
  const [made, attempts] = view.metamers.counts;
  element("metamers-remark").textContent = `${percent(made / attempts)} of the candidates of this colour are surfaces: between 0 and 1 everywhere.`;
}

const SEEN = {
  d65: "daylight D65",
  d50: "daylight D50",
  a: "incandescent light A",
  f2: "fluorescent light F2",
  f11: "fluorescent light F11",
  e: "equal-energy light E",
};

function account({ name, reading: read, spectra, missing, kind, is_guess }) {
  element("reading-name").textContent = name;
  const facts = {
    format: [read.format, read.dialect].filter(Boolean).join(", "),
    layout: read.layout,
    wavelengths: read.wavelengths,
    spectra: `${spectra.toLocaleString("en")}${missing ? `, with ${missing.toLocaleString("en")} missing values` : ""}`,
    kind: is_guess && kind && !element("kind").value ? "taken for reflectances, since every value is between 0 and 1: choose lights if they are" : "",
    notes: read.notes.join("; "),
    "also there": read.others.join(", "),
  };
  element("account").replaceChildren(
    ...Object.entries(facts)
      .filter(([, text]) => text)
      .map(([term, text]) => {
        const row = document.createElement("div");
        row.append(
          Object.assign(document.createElement("dt"), { textContent: term }),
          Object.assign(document.createElement("dd"), { textContent: text }),
        );
        return row;
      }),
  );
}

/** A file is in no address: a link to its settings would be one to something else. */
function keepNote() {
  history.replaceState(null, "", "#");
}

function repaint() {
  if (!view.model) return;
  paintModel();
  if (view.draws) paintDraws();
  if (view.metamers && view.model.kind === "reflectance") paintMetamers();
}

// ---- what is typed, moved and dropped

const STEPS = { components: FIT, wavelengths: FIT, missing: FIT };
const READING = ["kind", "percent", "layout", "missing", "missing-value", "unit", "measured-at", "array"];

function listen() {
  for (const control of document.querySelectorAll("main input, main select")) {
    if (control.id === "file") continue;
    const isSlider = ["range", "color"].includes(control.type);
    if (isSlider) control.addEventListener("input", () => changed(control, true));
    control.addEventListener("change", () => changed(control, false));
  }
  element("builtins").addEventListener("change", ({ target }) => {
    take(state);
    // What one set of spectra was drawn with may be nothing for another.
    state.wavelengths = "";
    if (target.value !== FILE) state.components = DEFAULTS.components;
    show(state);
    update(OPEN);
  });
  element("recipe").addEventListener("submit", (event) => event.preventDefault());
  element("new-seed").onclick = () => {
    element("seed").value = String(crypto.getRandomValues(new Uint32Array(1))[0]);
    take(state);
    update(DRAW);
  };
  window.addEventListener("hashchange", () => {
    Object.assign(state, fromAddress(location.hash));
    show(state);
    update(OPEN);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  let width = window.innerWidth;
  new ResizeObserver(() => {
    if (window.innerWidth !== width) repaint();
    width = window.innerWidth;
  }).observe(document.body);
  listenForFiles();
}

function changed(control, isPreview) {
  if (control.name === "model") return;
  if (control.id.startsWith("lrv-")) keepApart(control);
  take(state);
  if (["quantity", "dtype"].includes(control.id)) {
    keepAddress();
    taking.refresh();
    return;
  }
  if (control.id === "colour") {
    keepAddress();
    recolour.ask();
    return;
  }
  const step = READING.includes(control.id) && control.id !== "missing" ? OPEN : (STEPS[control.id] ?? DRAW);
  update(step, isPreview);
}

const recolour = new Latest(async () => {
  setBusy(true);
  if (view.model) await drawMetamers();
  setBusy(false);
});

function listenForFiles() {
  const veil = element("drop-veil");
  element("file").addEventListener("change", ({ target }) => {
    if (target.files.length > 0) receive(target.files[0]);
    target.value = "";
  });
  const isFile = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  window.addEventListener("dragover", (event) => {
    if (!isFile(event)) return;
    event.preventDefault();
    veil.hidden = false;
  });
  window.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) veil.hidden = true;
  });
  window.addEventListener("drop", (event) => {
    veil.hidden = true;
    if (!isFile(event)) return;
    event.preventDefault();
    receive(event.dataTransfer.files[0]);
  });
}

async function receive(file) {
  performance.clearMarks();
  performance.mark("drop");
  dropped = { name: file.name, bytes: await file.arrayBuffer() };
  for (const id of READING) {
    const control = element(id);
    if (control.type === "checkbox") control.checked = false;
    else if (control.tagName === "SELECT") control.selectedIndex = 0;
    else control.value = "";
  }
  listFile(file.name);
  state.model = FILE;
  state.wavelengths = "";
  show(state);
  update(OPEN);
}

// ---- the beginning

async function begin() {
  setBusy(true);
  try {
    const started = await library.call("start");
    ({ builtins } = started);
    view.locus = started.locus;
  } catch (error) {
    refuse("refusal", error);
    return;
  }
  listBuiltins(builtins);
  if (!builtins.some(({ name }) => name === state.model)) state.model = DEFAULTS.model;
  show(state);
  listen();
  library.onRestart = (error) => {
    refuse("refusal", error);
    if (state.model === FILE) {
      state.model = DEFAULTS.model;
      show(state);
    }
    library.call("start").then(() => update(OPEN));
  };
  await update(OPEN);
}

// For those who try the page: the device can be lost on purpose.
window.spectroll = { library, state, update: () => update(DRAW) };
begin();

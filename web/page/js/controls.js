// Controls of the page and the state that they show.

import { FILE } from "./state.js";

export const element = (id) => document.getElementById(id);

/** Controls whose value is that of the state of the same name. */
const PLAIN = ["components", "wavelengths", "seed", "count", "bounds", "proposal", "illuminant", "engine", "quantity", "dtype"];

/** Three significant digits, as few as it takes. */
const short = (value) => String(Number(value.toPrecision(3)));

/** Shows a state in the controls. */
export function show(state) {
  for (const name of PLAIN) element(name).value = state[name];
  element("colour").value = `#${state.colour}`;
  for (const radio of document.querySelectorAll('input[name="model"]')) radio.checked = radio.value === state.model;
  const lrv = state.lrv === "" ? [] : state.lrv.split("..");
  element("lrv-mode").value = ["none", "fixed", "range"][lrv.length] ?? "none";
  if (lrv.length === 1) element("lrv").value = lrv[0];
  if (lrv.length === 2) [element("lrv-low").value, element("lrv-high").value] = lrv;
  element("cov-scale").value = String(Math.log10(Number(state["cov-scale"]) || 1));
  const { intensity } = state;
  const factors = intensity === "" || intensity === "data" ? [] : intensity.split("..");
  element("intensity-mode").value = intensity === "data" ? "data" : ["none", "fixed", "range"][factors.length];
  if (factors.length === 1) element("intensity").value = factors[0];
  if (factors.length === 2) [element("intensity-low").value, element("intensity-high").value] = factors;
}

/** Takes what the controls say into a state. */
export function take(state) {
  for (const name of PLAIN) state[name] = element(name).value.trim();
  state.colour = element("colour").value.slice(1);
  const chosen = document.querySelector('input[name="model"]:checked');
  if (chosen) state.model = chosen.value;
  const [low, high] = [element("lrv-low").value, element("lrv-high").value];
  state.lrv = { none: "", fixed: element("lrv").value, range: `${low}..${high}` }[element("lrv-mode").value];
  const exponent = Number(element("cov-scale").value);
  // A factor that an address has between two places of the slider stays as long as nobody moves that.
  if (Math.abs(Math.log10(Number(state["cov-scale"])) - exponent) > 0.026) state["cov-scale"] = short(10 ** exponent);
  const factors = [element("intensity-low").value.trim(), element("intensity-high").value.trim()];
  state.intensity = { none: "", fixed: element("intensity").value.trim(), range: factors.join(".."), data: "data" }[
    element("intensity-mode").value
  ];
}

/** Keeps the ends of a range apart, whichever was moved. */
export function keepApart(moved) {
  const [low, high] = [element("lrv-low"), element("lrv-high")];
  if (Number(low.value) < Number(high.value)) return;
  if (moved === low) high.value = String(Number(low.value) + 0.01);
  else low.value = String(Number(high.value) - 0.01);
}

/** Shows the numbers beside sliders, and the controls that change something for this kind of spectra. */
export function arrange(state, kind, hasPowers) {
  const isLight = kind === "illuminant";
  const [lrv, intensity] = [element("lrv-mode").value, element("intensity-mode").value];
  const visible = {
    ".surfaces": !isLight,
    ".lights": isLight,
    ".lrv-fixed": !isLight && lrv === "fixed",
    ".lrv-range": !isLight && lrv === "range",
    ".lrv-any": !isLight && lrv !== "none",
    ".intensity-fixed": isLight && intensity === "fixed",
    ".intensity-range": isLight && intensity === "range",
  };
  for (const [selector, isVisible] of Object.entries(visible)) {
    document.querySelectorAll(selector).forEach((field) => (field.hidden = !isVisible));
  }
  element("intensity-mode").querySelector('[value="data"]').disabled = !hasPowers;
  element("quantity").querySelector('[value="lrv"]').disabled = isLight;
  for (const id of ["lrv", "lrv-low", "lrv-high"]) say(id, Number(element(id).value).toFixed(2));
  say("cov-scale", state["cov-scale"]);
  say("components", element("components").value);
}

function say(id, text) {
  document.querySelector(`output[for="${id}"]`).textContent = text;
  element(id).setAttribute("aria-valuetext", text);
}

/** Radio buttons of the built-in models. */
export function listBuiltins(builtins) {
  for (const { name, kind, spectra } of builtins) {
    addPill(name, NAMES[name] ?? name, `${spectra.toLocaleString("en")} ${kind === "illuminant" ? "lights" : "reflectances"}`);
  }
}

const NAMES = {
  "munsell-vrhel": "Munsell papers and surfaces",
  granada: "Granada daylights",
  macbeth: "ColorChecker",
  koivisto: "Leaves and flowers",
  krinov: "Landscapes",
  houser: "Lamps",
};

function addPill(value, name, remark) {
  const label = document.createElement("label");
  const radio = Object.assign(document.createElement("input"), { type: "radio", name: "model", value });
  const title = Object.assign(document.createElement("span"), { textContent: name });
  const small = Object.assign(document.createElement("small"), { textContent: remark });
  label.append(radio, title, small);
  element("builtins").append(label);
  return label;
}

/** The radio button of a file that was dropped, with its name. */
export function listFile(name) {
  document.querySelector(`input[name="model"][value="${FILE}"]`)?.closest("label").remove();
  addPill(FILE, name, "your file, on this machine");
}

/** Shows a refusal, and the control that mends what it says; hides it where there is none. */
export function refuse(id, refusal) {
  const place = element(id);
  document.querySelectorAll("[aria-invalid]").forEach((field) => {
    if (field.dataset.refusal === id) field.removeAttribute("aria-invalid");
  });
  place.hidden = !refusal;
  place.textContent = refusal ? capital(refusal.message) : "";
  const control = refusal?.control && element(refusal.control);
  if (!control) return;
  control.setAttribute("aria-invalid", "true");
  control.dataset.refusal = id;
  control.closest("details")?.setAttribute("open", "");
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: "Go to the setting" });
  button.onclick = () => control.focus();
  place.append(button);
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

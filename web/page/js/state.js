// The state of the page, which is its address: a link shows the same draws. Names are those of the program's options.

export const DEFAULTS = Object.freeze({
  model: "munsell-vrhel",
  components: "6",
  wavelengths: "",
  seed: "0",
  count: "10000",
  lrv: "",
  bounds: "base",
  "cov-scale": "1",
  intensity: "",
  proposal: "auto",
  illuminant: "d65",
  engine: "auto",
  colour: "7f9a55",
  quantity: "spectra",
  dtype: "f32",
});

/** The model of a file that was dropped here: it is in no address. */
export const FILE = "file";

/** The state that an address holds, and defaults for what it does not. */
export function fromAddress(hash) {
  const asked = new URLSearchParams(hash.replace(/^#/, ""));
  const state = { ...DEFAULTS };
  for (const name of Object.keys(DEFAULTS)) {
    if (asked.has(name)) state[name] = asked.get(name);
  }
  return state;
}

/** The address of a state: what differs from the defaults. */
export function toAddress(state) {
  const address = new URLSearchParams();
  for (const [name, value] of Object.entries(DEFAULTS)) {
    if (state[name] !== value) address.set(name, state[name]);
  }
  return "#" + address.toString();
}

/** Whether a text is a whole number from low to high. */
export function wholeNumber(text, low, high) {
  if (!/^[0-9]+$/.test(text.trim())) return null;
  const number = BigInt(text.trim());
  return number >= BigInt(low) && number <= BigInt(high) ? number : null;
}

function number(text, name) {
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value)) {
    throw { message: `${name} is ${JSON.stringify(text)}: it must be a number`, control: name };
  }
  return value;
}

/** "0.4" as a number, "0.2..0.6" as a pair, "" as null. */
function range(text, name) {
  if (text === "") return null;
  const ends = text.split("..");
  return ends.length === 2 ? ends.map((end) => number(end, name)) : number(text, name);
}

/** The settings of a recipe, as the library reads them and as data sets record them. */
export function recipeOf(state, kind, quantities = ["spectra"]) {
  const isLight = kind === "illuminant";
  const lrv = isLight ? null : range(state.lrv, "lrv");
  let intensity = null;
  if (isLight && state.intensity === "data") intensity = "data";
  else if (isLight && state.intensity !== "") {
    const value = range(state.intensity, "intensity");
    intensity = Array.isArray(value) ? { loguniform: value } : { fixed: value };
  }
  // Where nothing is seen the light changes nothing, and the library refuses settings that change nothing.
  const isSeen = lrv !== null || quantities.some((name) => ["xyz", "linear_srgb", "chromaticity", "lrv"].includes(name));
  return {
    lrv: Array.isArray(lrv) ? { uniform: lrv } : lrv,
    bounds: lrv === null ? "base" : state.bounds,
    cov_scale: number(state["cov-scale"], "cov-scale"),
    intensity,
    quantities,
    illuminant: isLight || !isSeen ? "d65" : state.illuminant,
    xyz_scale: "absolute",
    proposal: state.proposal,
    max_attempts: 65000,
  };
}

/** The seed and the number of draws. */
export function drawsOf(state) {
  const seed = wholeNumber(state.seed, 0, 18446744073709551615n);
  if (seed === null) {
    throw { message: `the seed is ${JSON.stringify(state.seed)}: it is a whole number from 0 to 2^64 - 1`, control: "seed" };
  }
  const count = wholeNumber(state.count, 1, MOST_DRAWS);
  if (count === null) {
    const message = `the number of draws is ${JSON.stringify(state.count)}: this page makes 1 to ${MOST_DRAWS.toLocaleString("en")}, the program any number`;
    throw { message, control: "count" };
  }
  return { seed, count: Number(count) };
}

/** The most draws that the page makes: a million of 31 bands are 124 MB. */
export const MOST_DRAWS = 1000000;

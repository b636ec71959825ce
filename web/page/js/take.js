// What is taken away: files, their sums, and the command lines that make the same bytes.

import { element } from "./controls.js";
import { drawsOf, recipeOf } from "./state.js";

/** Name of the file of draws, in both formats. */
const NAME = { npy: "draws.npy", csv: "draws.csv" };

export class Take {
  #library;
  #view;
  #format = "npy";
  /** Settings whose sum is shown. */
  #summed = "";

  /** `view` returns the state, and the model that is shown or null. */
  constructor(library, view) {
    this.#library = library;
    this.#view = view;
    for (const format of Object.keys(NAME)) element(`get-${format}`).onclick = () => this.#draws(format);
    element("get-model").onclick = () => this.#text("model", (model) => model.file || `${this.#view().state.model}.json`);
    element("get-wgsl").onclick = () => this.#text("wgsl", () => "spectroll.wgsl");
    element("copy-link").onclick = () => this.#copy(location.href, "The link");
    element("copy-command").onclick = () => this.#copy(element("command").textContent, "The command");
  }

  #request(format) {
    const { state, model } = this.#view();
    if (!model) throw { message: "there is no model to draw from" };
    const { quantity, dtype, engine } = state;
    return { recipe: recipeOf(state, model.kind, [quantity]), ...drawsOf(state), quantity, dtype, engine, format };
  }

  /** Shows the command line of the next download. */
  async refresh() {
    let text = "";
    try {
      const request = this.#request(this.#format);
      text = await this.#library.call("command", { ...request, file: NAME[this.#format] });
      if (this.#summed !== this.#key(request)) this.#show("of the next download", "–");
    } catch (error) {
      text = `# ${error.message}`;
    }
    element("command").textContent = text;
  }

  #key({ engine, ...request }) {
    return JSON.stringify(request, (_, value) => (typeof value === "bigint" ? String(value) : value)) + element("command").textContent;
  }

  #show(sum, file) {
    element("sum").textContent = sum;
    element("sum-file").textContent = file;
  }

  async #draws(format) {
    this.#format = format;
    await this.#taking(async () => {
      const request = this.#request(format);
      await this.refresh();
      const { bytes, sha256, by } = await this.#library.call("download", request);
      this.#summed = this.#key(request);
      this.#show(sha256, `${NAME[format]}, ${size(bytes.length)}`);
      save(bytes, NAME[format]);
      return `${NAME[format]} is yours: ${request.count.toLocaleString("en")} draws by ${by.engine === "webgpu" ? "WebGPU" : "the CPU"}.`;
    });
  }

  async #text(call, nameOf) {
    await this.#taking(async () => {
      const { state, model } = this.#view();
      if (!model) throw { message: "there is no model to take" };
      const name = nameOf(model);
      const { bytes, sha256 } = await this.#library.call(call, { recipe: recipeOf(state, model.kind, [state.quantity]) });
      this.#summed = "";
      this.#show(sha256, `${name}, ${size(bytes.length)}`);
      save(bytes, name);
      return `${name} is yours.`;
    });
  }

  async #taking(work) {
    const place = element("taken");
    place.textContent = "Writing the file";
    try {
      place.textContent = await work();
    } catch (error) {
      place.textContent = `Not written: ${error.message}`;
    }
  }

  async #copy(text, what) {
    try {
      await navigator.clipboard.writeText(text);
      element("taken").textContent = `${what} is copied.`;
    } catch {
      element("taken").textContent = `${what} could not be copied: this browser does not allow it.`;
    }
  }
}

function size(bytes) {
  if (bytes < 1000) return `${bytes} bytes`;
  return bytes < 1e6 ? `${(bytes / 1000).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function save(bytes, name) {
  const address = URL.createObjectURL(new Blob([bytes], { type: "application/octet-stream" }));
  Object.assign(document.createElement("a"), { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

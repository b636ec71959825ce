// Draws on WebGPU, with the compute shader that the library writes. Every shader is tried before it draws: it makes some
// draws that the CPU makes as well, and every byte counts. The plain form of arithmetic is tried first, then the exact
// one, which no compiler can fuse or rearrange.

/** The most draws of a trial, and the most products that the CPU forms in one. */
const TRIAL = 8192;
const TRIAL_PRODUCTS = 2 ** 24;
/** Products of a candidate, about: bands times components. */
const PRODUCTS = 200;
/** The most dispatches for one range. */
const MOST_DISPATCHES = 1024;

export class Gpu {
  #device;
  #pipelines = new Map();
  #isLost = false;
  /** Called where the device is lost, with the reason. */
  onLost = () => {};

  static async open() {
    if (!navigator.gpu) throw new Error("this browser has no WebGPU");
    const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
    if (!adapter) throw new Error("WebGPU found no adapter");
    const wanted = ["maxStorageBuffersPerShaderStage", "maxStorageBufferBindingSize", "maxBufferSize"];
    const requiredLimits = Object.fromEntries(wanted.map((name) => [name, adapter.limits[name]]));
    const device = await adapter.requestDevice({ label: "spectroll", requiredLimits });
    const { vendor, architecture, description } = adapter.info ?? {};
    const name = description || [vendor, architecture].filter(Boolean).join(" ") || "a GPU";
    return new Gpu(device, name);
  }

  constructor(device, name) {
    this.#device = device;
    this.name = name;
    device.lost.then(({ reason, message }) => {
      this.#isLost = true;
      this.onLost(message || reason);
    });
  }

  /** Loses the device. */
  async lose() {
    this.#device.destroy();
    await this.#device.lost;
    await Promise.resolve();
  }

  /** Forgets the pipeline of a recipe, or all. */
  drop(key) {
    const pipeline = this.#pipelines.get(key);
    this.#pipelines.delete(key);
    pipeline?.then(release, () => {});
  }

  forget() {
    [...this.#pipelines.keys()].forEach((key) => this.drop(key));
  }

  /** The pipeline of a recipe, compiled and tried once. */
  pipeline(key, drawing) {
    let found = this.#pipelines.get(key);
    if (!found) {
      found = this.#prepare(drawing);
      this.#pipelines.set(key, found);
      found.catch(() => this.#pipelines.delete(key));
    }
    return found;
  }

  async #prepare(drawing) {
    const count = Math.max(64, Math.min(TRIAL, Math.floor((TRIAL_PRODUCTS * drawing.acceptance()) / PRODUCTS)));
    const reference = drawing.trial(count);
    const names = drawing.formats().split(",").map((format) => format.split(" ")[0]);
    let pipeline = null;
    for (const arithmetic of ["plain", "exact"]) {
      pipeline = await this.#compile(drawing.kernel(arithmetic), arithmetic);
      const words = await this.#run(pipeline, count, (room) => pipeline.kernel.trialParameters(count, room));
      pipeline.isExact = names.every((name) => isSame(words[name], reference.words(name)));
      if (pipeline.isExact) break;
      if (arithmetic === "plain") release(pipeline);
    }
    reference.free();
    return pipeline;
  }

  async #compile(kernel, arithmetic) {
    const device = this.#device;
    if (kernel.dispatches() > MOST_DISPATCHES) throw new Error("its draws may take more candidates than one submission tries");
    const bindings = JSON.parse(kernel.bindings());
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ label: "spectroll", code: kernel.text() });
    const type = { parameters: "uniform", tables: "read-only-storage", proposal: "read-only-storage", progress: "storage", output: "storage" };
    const layout = device.createBindGroupLayout({
      entries: bindings.map(({ binding, role }) => ({ binding, visibility: GPUShaderStage.COMPUTE, buffer: { type: type[role] } })),
    });
    let compute;
    try {
      compute = await device.createComputePipelineAsync({
        label: "spectroll",
        layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
        compute: { module, entryPoint: "main" },
      });
    } finally {
      const error = await device.popErrorScope();
      if (error) throw new Error(error.message);
    }
    const fixed = new Map();
    for (const { binding, role } of bindings) {
      const bytes = kernel.contents(binding);
      if (bytes.length === 0 || !["tables", "proposal"].includes(role)) continue;
      const buffer = device.createBuffer({ size: bytes.length, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_DST });
      device.queue.writeBuffer(buffer, 0, bytes);
      fixed.set(binding, buffer);
    }
    return { kernel, arithmetic, bindings, layout, compute, fixed, room: 0, buffers: new Map(), staging: new Map(), isExact: false };
  }

  /** Buffers with room for some draws, kept as long as they are large enough. */
  #makeRoom(pipeline, count) {
    if (pipeline.room >= count) return;
    releaseBuffers(pipeline);
    const { kernel } = pipeline;
    for (const { binding, role, quantity } of pipeline.bindings) {
      if (pipeline.fixed.has(binding)) continue;
      const size = kernel.bytes(binding, count);
      const isUniform = role === "parameters";
      const usage = isUniform ? GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST : GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST;
      pipeline.buffers.set(binding, this.#device.createBuffer({ label: quantity ?? role, size, usage }));
      if (role === "output") {
        pipeline.staging.set(binding, this.#device.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST }));
      }
    }
    pipeline.room = count;
    pipeline.group = this.#device.createBindGroup({
      layout: pipeline.layout,
      entries: pipeline.bindings.map(({ binding }) => ({ binding, resource: { buffer: pipeline.fixed.get(binding) ?? pipeline.buffers.get(binding) } })),
    });
  }

  /** Runs a range of draws, and reads back the words of each quantity. */
  async #run(pipeline, count, parameters) {
    if (this.#isLost) throw new Error("the device was lost");
    const { kernel, bindings } = pipeline;
    const device = this.#device;
    this.#makeRoom(pipeline, count);
    device.pushErrorScope("out-of-memory");
    device.pushErrorScope("validation");
    const encoder = device.createCommandEncoder();
    for (const { binding, role } of bindings) {
      if (role === "parameters") device.queue.writeBuffer(pipeline.buffers.get(binding), 0, parameters(pipeline.room));
      if (role === "progress") encoder.clearBuffer(pipeline.buffers.get(binding));
    }
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline.compute);
    pass.setBindGroup(0, pipeline.group);
    for (let i = 0; i < kernel.dispatches(); i++) pass.dispatchWorkgroups(kernel.workgroups(count));
    pass.end();
    const outputs = bindings.filter(({ role }) => role === "output");
    const sizes = outputs.map(({ binding }) => kernel.bytes(binding, count));
    outputs.forEach(({ binding }, i) => encoder.copyBufferToBuffer(pipeline.buffers.get(binding), 0, pipeline.staging.get(binding), 0, sizes[i]));
    device.queue.submit([encoder.finish()]);
    const errors = await Promise.all([device.popErrorScope(), device.popErrorScope()]);
    const error = errors.find(Boolean);
    if (error) throw new Error(error.message);
    await Promise.all(outputs.map(({ binding }, i) => pipeline.staging.get(binding).mapAsync(GPUMapMode.READ, 0, sizes[i])));
    const words = {};
    outputs.forEach(({ binding, quantity }, i) => {
      const buffer = pipeline.staging.get(binding);
      words[quantity] = new Uint32Array(buffer.getMappedRange(0, sizes[i]).slice(0));
      buffer.unmap();
    });
    return words;
  }

  /** Makes draws: the values of each quantity, and counts over the statuses. */
  async draw(pipeline, drawing, { seed, first, count }) {
    const words = await this.#run(pipeline, count, (room) => pipeline.kernel.parameters(seed, BigInt(first), count, room));
    const widths = Object.fromEntries(drawing.formats().split(",").map((format) => format.split(" ")));
    const arrays = {};
    for (const [name, all] of Object.entries(words)) {
      const own = all.subarray(0, count * Number(widths[name]));
      arrays[name] = name === "attempts" ? own : new Float32Array(own.buffer, own.byteOffset, own.length);
    }
    arrays.counts = drawing.counts(arrays.attempts, BigInt(first));
    return arrays;
  }
}

function isSame(ours, theirs) {
  if (!ours || ours.length < theirs.length) return false;
  for (let i = 0; i < theirs.length; i++) if (ours[i] !== theirs[i]) return false;
  return true;
}

function releaseBuffers(pipeline) {
  for (const buffer of [...pipeline.buffers.values(), ...pipeline.staging.values()]) buffer.destroy();
  pipeline.buffers.clear();
  pipeline.staging.clear();
  pipeline.room = 0;
}

function release(pipeline) {
  releaseBuffers(pipeline);
  pipeline.fixed.forEach((buffer) => buffer.destroy());
  pipeline.kernel.free();
}

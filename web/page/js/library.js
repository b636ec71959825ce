// The library, which lives in a worker so that the page never waits: calls are messages, results are promises.

export class Library {
  #worker;
  #waiting = new Map();
  #next = 0;
  /** Called where the worker was lost, and begun anew. */
  onRestart = () => {};

  constructor() {
    this.#start();
  }

  #start() {
    this.#worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
    this.#worker.onmessage = ({ data: { id, result, error, isFatal } }) => {
      const waiting = this.#waiting.get(id);
      this.#waiting.delete(id);
      if (error) waiting?.reject(error);
      else waiting?.resolve(result);
      if (isFatal) this.#restart(error);
    };
    this.#worker.onerror = (event) => this.#restart({ message: event.message || "the library cannot be loaded" });
  }

  #restart(error) {
    this.#worker.terminate();
    const waiting = [...this.#waiting.values()];
    this.#waiting.clear();
    waiting.forEach(({ reject }) => reject(error));
    if (this.#next > 0) {
      this.#start();
      this.onRestart(error);
    }
  }

  call(name, request = {}, transfer = []) {
    const id = ++this.#next;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, name, request }, transfer);
    });
  }
}

/**
 * Calls of one kind, of which the newest alone matters: while one is under way only the last that was asked for waits.
 */
export class Latest {
  #run;
  #isRunning = false;
  #next = null;

  constructor(run) {
    this.#run = run;
  }

  async ask(request) {
    this.#next = { request };
    if (this.#isRunning) return;
    this.#isRunning = true;
    while (this.#next) {
      const { request } = this.#next;
      this.#next = null;
      await this.#run(request, () => this.#next !== null);
    }
    this.#isRunning = false;
  }
}

"use strict";
// Runs the simulation and exchanges messages with the page, in a worker, or in the page if the browser cannot start a worker.
// `post` sends a message. `slice` is the longest computing time (ms) between two messages.
//
// In:  { kind: "load", wasm, scene, rom, names }, { kind: "run", id, values: { NAME: VALUE } }
// Out: { kind: "loaded", count }, { kind: "rows", id, first, width, rows }, { kind: "done", id, seconds, warnings },
//      { kind: "failed", id, text }. A row contains the time (s) and the outputs `names` (SI units).
function createEngine(post, slice) {
  let wasm = null, timer = 0;

  const text = () => new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, wasm.tiprub_text(), wasm.tiprub_text_length()));
  function writeInput(content) {
    const bytes = typeof content === "string" ? new TextEncoder().encode(content) : content;
    const address = wasm.tiprub_input(bytes.length);
    new Uint8Array(wasm.memory.buffer, address, bytes.length).set(bytes);
  }
  function check(status) { if (status) throw new Error(text()); }
  // After a trap, the text of the module is the message of the panic.
  function fail(id, error) {
    clearTimeout(timer);
    const trapped = wasm && error instanceof WebAssembly.RuntimeError;
    post({ kind: "failed", id, text: trapped ? `the simulation stopped: ${text() || error.message}` : error.message });
  }

  async function load(message) {
    const { instance } = await WebAssembly.instantiate(message.wasm, {});
    wasm = instance.exports;
    wasm.tiprub_start();
    for (const file of [message.scene, message.rom, message.names.join("\n")]) { writeInput(file); wasm.tiprub_add_file(); }
    check(wasm.tiprub_create());
    post({ kind: "loaded", count: wasm.tiprub_step_count() });
  }

  function run({ id, values }) {
    clearTimeout(timer);
    check(wasm.tiprub_reset());
    for (const [name, value] of Object.entries(values)) { writeInput(name); check(wasm.tiprub_set(value)); }
    check(wasm.tiprub_initialise());
    wasm.tiprub_warnings();
    const width = wasm.tiprub_row_length(), count = wasm.tiprub_step_count();
    let warnings = text(), reached = -1, seconds = 0;
    const advance = () => {
      const start = performance.now(), first = reached + 1, rows = [];
      do {
        if (reached >= 0) check(wasm.tiprub_step());
        rows.push(Float64Array.from(new Float64Array(wasm.memory.buffer, wasm.tiprub_row(), width)));
        reached++;
      } while (reached < count && performance.now() - start < slice);
      seconds += (performance.now() - start) / 1000;
      const all = new Float64Array(width * rows.length);
      rows.forEach((row, index) => all.set(row, width * index));
      post({ kind: "rows", id, first, width, rows: all });
      if (reached < count) { next(); return; }
      wasm.tiprub_warnings();
      warnings = [warnings, text()].filter(lines => lines).join("\n");
      post({ kind: "done", id, seconds, warnings });
    };
    const next = () => { timer = setTimeout(() => { try { advance(); } catch (error) { fail(id, error); } }, 0); };
    next();
  }

  return async message => {
    try {
      if (message.kind === "stop") clearTimeout(timer);
      else if (message.kind === "load") await load(message);
      else run(message);
    } catch (error) { fail(message.id, error); }
  };
}

"use strict";
(() => {
const find = name => document.querySelector(name);
const NOMINAL = 356; // clearance in the scene (µm)
const TOLERANCE = 1e-2 * 3.56e-4; // error of the adaptive steps in closed contact (m)
const ROUNDING = 1e-12; // rounding of a clearance (m)
const BLADES = 36, TURN = 2 * Math.PI;
const STEPS_PER_MS = 100; // communication steps of the scene
// Outputs that the page reads, in the order of a row after the time.
const NAMES = ["clearance_minimum", "normal_impulse", "torque", "friction_loss", "kinetic_energy", "strain_energy", "rotor_angle"];
const [TIME, CLEARANCE, IMPULSE, TORQUE, HEAT, KINETIC, STRAIN, ANGLE, GAPS] = [...NAMES.keys(), NAMES.length, NAMES.length + 1];
const FORCES = GAPS + BLADES, WIDTH = FORCES + BLADES;
const blades = Array.from({ length: BLADES }, (_, index) => index);
for (const name of ["sector_clearance_minimum", "sector_normal_force"]) NAMES.push(...blades.map(index => `${name}[${index + 1}]`));

const sliders = ["speed", "friction", "clearance"].map(name => find(`input[name=${name}]`));
const clock = find("input[name=time]"), play = find(".play"), note = find(".note"), progress = find("progress");
const state = { files: null, engine: null, stop: null, inWorker: false, id: 0, count: 0, rows: [], before: [], at: 0, playing: false, done: false, numbers: null };

// ---- Data of the page

async function unpack(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// ---- Runs

/** Starts the simulation in a worker or in this page, and loads a scene. */
function start(scene, useWorker) {
  state.stop?.();
  note.hidden = true;
  Object.assign(state, { count: 0, loading: true });
  document.body.dataset.busy = "true";
  const { wasm, rom } = state.files;
  const loading = { kind: "load", wasm, rom, scene: scene ?? state.files.scene, names: NAMES };
  if (useWorker) {
    try {
      const source = document.getElementById("engine").textContent + "\nconst engine = createEngine(message => postMessage(message), 30);\nonmessage = event => engine(event.data);";
      const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
      const worker = new Worker(url);
      let answered = false;
      worker.onmessage = event => { answered = true; receive(event.data); };
      worker.onerror = event => { event.preventDefault(); if (answered) failed(event.message); else start(scene, false); };
      state.stop = () => worker.terminate();
      state.engine = message => worker.postMessage(message);
      state.inWorker = true;
      state.engine(loading);
      return;
    } catch { /* The browser cannot start a worker. */ }
  }
  let alive = true;
  const engine = createEngine(message => { if (alive) receive(message); }, 10);
  state.stop = () => { alive = false; engine({ kind: "stop" }); };
  state.engine = engine;
  state.inWorker = false;
  engine(loading);
}

function values() {
  const [speed, friction, clearance] = sliders.map(slider => Number(slider.value));
  return { speed, friction_coefficient: friction, gap_offset: Number(`${clearance - NOMINAL}e-6`) };
}

/** Runs the scene with the values of the sliders. */
function run() {
  if (!state.files) return;
  const settings = values();
  if (state.done) state.before = state.rows;
  Object.assign(state, { id: state.id + 1, rows: [], done: false, numbers: null });
  const options = Object.entries(settings).map(([name, value]) => `--set ${name}=${value}`);
  find(".command").textContent = ["tiprub run builtin:rotor37", ...options].join(" \\\n  ");
  note.hidden = true;
  find(".warnings").hidden = true;
  document.body.dataset.busy = "true";
  clearNumbers();
  if (state.count) state.engine({ kind: "run", id: state.id, values: settings });
  else if (!state.loading) start(null, true);
}

function receive(message) {
  if (message.kind === "failed" && (message.id === undefined || message.id === state.id)) { failed(message.text); return; }
  if (message.kind === "loaded") {
    state.loading = false;
    state.count = message.count;
    clock.max = String(message.count);
    run();
    return;
  }
  if (message.id !== state.id) return;
  if (message.kind === "rows") {
    for (let row = 0; row < message.rows.length; row += message.width) state.rows.push(message.rows.subarray(row, row + message.width));
    progress.value = state.rows.length / (state.count + 1);
    find(".status").textContent = `computing: ${Math.floor(100 * progress.value)} %`;
  } else if (message.kind === "done") {
    state.done = true;
    state.numbers = numbers(state.rows);
    showNumbers();
    find(".status").textContent = `computed ${state.count} communication steps in ${message.seconds.toFixed(2)} s`;
    const lines = message.warnings.split("\n").filter(line => line);
    find(".warnings").hidden = lines.length === 0;
    find(".warnings ul").replaceChildren(...lines.map(line => Object.assign(document.createElement("li"), { textContent: line })));
    document.body.dataset.busy = "false";
  }
  dirty();
}

function failed(text) {
  Object.assign(state, { done: false, loading: false });
  find(".again").hidden = !state.files;
  note.hidden = false;
  find(".note span").textContent = text;
  find(".status").textContent = "stopped";
  document.body.dataset.busy = "false";
}

// ---- Results

/** Force (N) of a row: the impulse of its communication step divided by the length of the step. */
function force(rows, index) { return index ? rows[index][IMPULSE] / (rows[index][TIME] - rows[index - 1][TIME]) : 0; }

/** The five numbers that `tiprub run` prints, computed in the same order of operations. */
function numbers(rows) {
  let largest = 0, torque = 0, clearance = Infinity, touches = false;
  rows.forEach((row, index) => {
    largest = Math.max(largest, force(rows, index));
    clearance = Math.min(clearance, row[CLEARANCE]);
    touches ||= row[IMPULSE] !== 0;
    if (index) torque += (row[TIME] - rows[index - 1][TIME]) * row[TORQUE];
  });
  const last = rows[rows.length - 1], third = Math.floor(rows.length / 3);
  const largestEnergy = part => part.reduce((largest, row) => Math.max(largest, row[KINETIC] + row[STRAIN]), 0);
  const [middle, end] = [largestEnergy(rows.slice(third, 2 * third)), largestEnergy(rows.slice(2 * third))];
  return {
    force: largest,
    heat: last[HEAT],
    torque: torque / (last[TIME] - rows[0][TIME]),
    clearance: Math.abs(clearance) < (touches ? TOLERANCE : ROUNDING) ? 0 : clearance,
    growth: middle > 0 ? end / middle : null,
  };
}

function digits(value) {
  if (value === null) return "–";
  const size = Math.abs(value), places = size >= 100 || size === 0 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  return (Number(value.toFixed(places)) || 0).toLocaleString("en", { minimumFractionDigits: places, maximumFractionDigits: places }).replace("-", "−");
}

/** Removes the numbers of the previous run. */
function clearNumbers() {
  document.querySelectorAll(".numbers [data-name]").forEach(number => { number.textContent = "–"; });
}

function showNumbers() {
  const { force, heat, torque, clearance, growth } = state.numbers;
  const shown = {
    force: [force / 1000, " kN"], heat: [heat, " J"], torque: [torque, " N m"], clearance: [clearance * 1e6, " µm"], growth: [growth, ""],
  };
  for (const [name, [value, unit]] of Object.entries(shown)) find(`.numbers [data-name=${name}]`).textContent = (name === "growth" && value !== null ? "×" : "") + digits(value) + unit;
}

// ---- Drawing

let colors = {}, layersOutdated = true, layersDrawn = 0, indexDrawn = -1, lastFrame = 0;
const dirty = () => { layersOutdated = true; };

function readColors() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "soft", "line", "accent", "card", "steel", "wall", "cool", "hot"]) colors[name] = style.getPropertyValue(`--${name}`).trim();
  dirty();
}

/** Fits a canvas to its box; returns the drawing context in CSS pixels. */
function context(canvas) {
  const ratio = devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return pen;
}

function mix(fraction) { return `color-mix(in srgb, ${colors.hot} ${Math.round(100 * fraction)}%, ${colors.steel})`; }

/** Draws the rotor in the frame of the casing. Clearances are exaggerated; the casing is drawn as a circle. */
function drawRotor(row, index) {
  const canvas = find(".rotor"), pen = context(canvas), size = Math.min(canvas.clientWidth, canvas.clientHeight);
  const [x, y] = [canvas.clientWidth / 2, canvas.clientHeight / 2];
  const wall = 0.455 * size, hub = 0.25 * size, scale = 0.13 * size / (NOMINAL * 1e-6);
  const place = (radius, angle) => [x + radius * Math.cos(angle), y - radius * Math.sin(angle)];
  const tip = gap => wall - Math.min(Math.max(gap, 0) * scale, wall - hub - 4);
  // Smallest clearance so far at each angle.
  const bins = 180, smallest = new Array(bins).fill(Infinity);
  for (let i = 0; i <= index; i++) for (const blade of blades) {
    const turn = state.rows[i][ANGLE] / TURN + blade / BLADES, bin = Math.floor((turn - Math.floor(turn)) * bins) % bins;
    smallest[bin] = Math.min(smallest[bin], state.rows[i][GAPS + blade]);
  }
  pen.fillStyle = colors.wall;
  pen.beginPath(); pen.arc(x, y, wall + 0.03 * size, 0, TURN); pen.arc(x, y, wall, 0, TURN, true); pen.fill();
  pen.fillStyle = colors.cool;
  pen.globalAlpha = 0.18;
  pen.beginPath();
  pen.arc(x, y, wall, 0, TURN);
  smallest.forEach((gap, bin) => pen[bin ? "lineTo" : "moveTo"](...place(Number.isFinite(gap) ? tip(gap) : wall, (bin + 0.5) / bins * TURN)));
  pen.closePath();
  pen.fill("evenodd");
  pen.globalAlpha = 1;
  pen.fillStyle = colors.steel;
  pen.beginPath(); pen.arc(x, y, hub, 0, TURN); pen.fill();
  pen.fillStyle = colors.card;
  pen.beginPath(); pen.arc(x, y, 0.87 * hub, 0, TURN); pen.fill();
  const strongest = Math.max(1, ...blades.map(blade => row[FORCES + blade]));
  for (const blade of blades) {
    const angle = row[ANGLE] + blade / BLADES * TURN, radius = tip(row[GAPS + blade]), load = row[FORCES + blade];
    const heat = load > 0 ? 0.45 + 0.55 * load / strongest : 0;
    pen.fillStyle = heat ? mix(heat) : colors.steel;
    pen.beginPath();
    pen.moveTo(...place(hub - 2, angle - 0.028)); pen.lineTo(...place(radius, angle - 0.03));
    pen.lineTo(...place(radius, angle + 0.03)); pen.lineTo(...place(hub - 2, angle + 0.028));
    pen.fill();
    if (heat) {
      pen.strokeStyle = colors.hot;
      pen.lineWidth = 0.012 * size * (1 + heat);
      pen.lineCap = "round";
      pen.beginPath(); pen.arc(x, y, wall + 0.004 * size, -angle - 0.05, -angle + 0.05); pen.stroke();
    }
    if (blade === 0) { pen.fillStyle = colors.accent; pen.beginPath(); pen.arc(...place(0.93 * hub, angle), 0.012 * size, 0, TURN); pen.fill(); }
  }
}

/** Plots over time. Each plot is cached in a layer until the data change. */
const plots = [
  { canvas: find(".clearances"), unit: 1e-6, all: row => row.subarray(GAPS, FORCES), value: (rows, i) => rows[i][CLEARANCE], color: "accent", smallestLimit: 100 },
  { canvas: find(".forces"), unit: 1000, value: force, color: "hot", smallestLimit: 2 },
];

function drawPlot(plot, index, isDue) {
  const { canvas } = plot, pen = context(canvas), [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [left, right, top, bottom] = [44, 10, 8, 24], length = state.count / STEPS_PER_MS;
  const x = i => left + (width - left - right) * i / state.count, y = value => height - bottom - (height - top - bottom) * value / plot.limit;
  if (isDue || !plot.layer) {
    plot.layer ??= document.createElement("canvas");
    plot.layer.width = canvas.width; plot.layer.height = canvas.height;
    const layerPen = plot.layer.getContext("2d"), ratio = devicePixelRatio || 1;
    layerPen.setTransform(ratio, 0, 0, ratio, 0, 0);
    layerPen.clearRect(0, 0, width, height);
    let largest = plot.smallestLimit;
    for (const rows of [state.rows, state.before]) rows.forEach((_, i) => { largest = Math.max(largest, plot.value(rows, i) / plot.unit); });
    if (plot.all) for (const row of state.rows) for (const value of plot.all(row)) largest = Math.max(largest, value / plot.unit);
    const decade = 10 ** Math.floor(Math.log10(largest / 5)), tick = decade * [1, 2, 5, 10].find(factor => largest / (factor * decade) <= 5);
    plot.limit = tick * Math.ceil(1.02 * largest / tick);
    layerPen.font = "12px system-ui, sans-serif";
    layerPen.textBaseline = "middle";
    layerPen.lineWidth = 1;
    for (let value = 0; value <= plot.limit * 1.001; value += tick) {
      layerPen.strokeStyle = colors.line; layerPen.beginPath(); layerPen.moveTo(left, y(value)); layerPen.lineTo(width - right, y(value)); layerPen.stroke();
      layerPen.fillStyle = colors.soft; layerPen.textAlign = "right"; layerPen.fillText(String(Number(value.toPrecision(6))), left - 6, y(value));
    }
    layerPen.textAlign = "center";
    for (let time = 0; time <= length; time += 2) layerPen.fillText(time === 10 ? "10 ms" : String(time), x(time * STEPS_PER_MS), height - bottom + 13);
    layerPen.save();
    layerPen.beginPath(); layerPen.rect(left, 0, width - left - right, height - bottom + 1); layerPen.clip();
    const line = (rows, value, color, thick, alpha) => {
      layerPen.strokeStyle = color; layerPen.lineWidth = thick; layerPen.globalAlpha = alpha; layerPen.lineJoin = "round";
      layerPen.beginPath();
      rows.forEach((_, i) => layerPen[i ? "lineTo" : "moveTo"](x(i), y(value(rows, i) / plot.unit)));
      layerPen.stroke();
      layerPen.globalAlpha = 1;
    };
    if (plot.all) for (const blade of blades) line(state.rows, (rows, i) => rows[i][GAPS + blade], colors.cool, 1, 0.22);
    line(state.before, plot.value, colors.soft, 1.2, 0.5);
    line(state.rows, plot.value, colors[plot.color], 2, 1);
    layerPen.restore();
  }
  pen.drawImage(plot.layer, 0, 0, width, height);
  if (state.rows.length) {
    pen.strokeStyle = colors.soft; pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(x(index), top); pen.lineTo(x(index), height - bottom); pen.stroke();
    pen.fillStyle = colors[plot.color];
    pen.beginPath(); pen.arc(x(index), y(plot.value(state.rows, index) / plot.unit), 4, 0, TURN); pen.fill();
  }
}

function draw(now) {
  const index = Math.min(Math.floor(state.at), state.rows.length - 1);
  // During a computation, layers are drawn only a few times per second, because drawing would slow it down.
  const isDue = layersOutdated && (state.done || now - layersDrawn > 200);
  if (index < 0 || !(isDue || index !== indexDrawn)) return;
  const row = state.rows[index];
  drawRotor(row, index);
  plots.forEach(plot => drawPlot(plot, index, isDue));
  if (isDue) [layersOutdated, layersDrawn] = [false, now];
  indexDrawn = index;
  clock.value = String(index);
  const time = `${(1000 * row[TIME]).toFixed(2)} ms`;
  clock.setAttribute("aria-valuetext", time);
  find(".now b").textContent = time;
  const touching = blades.filter(blade => row[FORCES + blade] > 0).length;
  find(".now span").textContent = `${(row[ANGLE] / TURN).toFixed(2)} revolutions`;
  find(".now i").textContent = touching ? `${touching} ${touching === 1 ? "blade rubs" : "blades rub"}` : "no contact";
}

function frame(now) {
  const passed = Math.min(now - lastFrame, 100);
  lastFrame = now;
  if (state.playing && state.rows.length) {
    // Playback is a thousand times slower than the rotor: one second shows one millisecond.
    const reached = state.rows.length - 1;
    if (state.at <= reached) state.at = Math.min(state.at + passed / 1000 * STEPS_PER_MS, reached);
    if (state.done && state.at >= state.count) setPlaying(false);
  }
  draw(now);
  requestAnimationFrame(frame);
}

function setPlaying(playing) {
  if (playing && state.at >= state.count) state.at = 0;
  state.playing = playing;
  play.textContent = playing ? "Pause" : "Run";
}

// ---- Controls

function label(slider) {
  const value = Number(slider.value), shown = slider.closest("label").querySelector("b");
  const texts = { speed: `${value} rad/s = ${Math.round(value * 30 / Math.PI).toLocaleString("en")} rpm`, friction: value.toFixed(2), clearance: `${value} µm` };
  shown.textContent = texts[slider.name];
  slider.setAttribute("aria-valuetext", texts[slider.name]);
}

sliders.forEach(slider => {
  label(slider);
  slider.addEventListener("input", () => { label(slider); run(); });
});
clock.addEventListener("input", () => { setPlaying(false); state.at = Number(clock.value); });
play.addEventListener("click", () => setPlaying(!state.playing));
find(".reset").addEventListener("click", () => { sliders.forEach(slider => { slider.value = slider.defaultValue; label(slider); }); run(); });
find(".again").addEventListener("click", () => start(null, true));
addEventListener("resize", dirty);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColors);

readColors();
setPlaying(!matchMedia("(prefers-reduced-motion: reduce)").matches);
document.body.dataset.busy = "true";
if (typeof WebAssembly !== "object" || typeof DecompressionStream !== "function") {
  failed("this browser cannot run the simulation: it needs WebAssembly and DecompressionStream. Update the browser, or use another one.");
} else {
  Promise.all(["wasm", "rom", "scene"].map(unpack)).then(([wasm, rom, scene]) => {
    state.files = { wasm, rom, scene };
    start(null, true);
  }).catch(error => failed(`the data of the page cannot be read: ${error.message}. Reload the page.`));
}
requestAnimationFrame(frame);

// The book shows this page in a frame.
if (parent !== window) new ResizeObserver(() => parent.postMessage({ height: document.documentElement.offsetHeight }, "*")).observe(document.documentElement);

// Used by tests.
window.tryIt = { state, start, NAMES, WIDTH };
})();

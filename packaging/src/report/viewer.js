"use strict";
(() => {
const root = document.getElementById("viewer"), canvas = root.querySelector("canvas");
const find = name => root.querySelector(name), note = find(".note");
const fail = text => { note.textContent = text; note.hidden = false; find(".controls").hidden = true; };
const header = JSON.parse(document.getElementById("run-header").textContent);
const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true, premultipliedAlpha: true });
if (!gl) { fail("The animation needs WebGL 2, which this browser does not provide. Enable it, or use another browser. The figures below are complete without it."); return; }
if (!self.DecompressionStream) { fail("This browser cannot decompress the data of the animation. Update it, or use another browser. The figures below are complete without it."); return; }

const packed = Uint8Array.from(atob(document.getElementById("run-data").textContent), c => c.charCodeAt(0));
new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer()
  .then(start).catch(error => { fail("The animation cannot be shown: " + error.message); console.error(error); });

const VERTEX = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
layout(location = 0) in vec3 place; layout(location = 1) in vec2 light;
uniform mat4 camera; uniform sampler2D weights, basis, forces, wall;
uniform int rank, count, sectors, nodes, first, walled; uniform float scale, gap, turn, angles, largest, dot_size; uniform vec3 shift; uniform bool round_body;
out vec3 where_; out float moved; out float hot;
const float TURN = 6.283185307;
vec3 of_basis(int i) { return texelFetch(basis, ivec2(i % 1024, i / 1024), 0).rgb; }
float wall_at(float angle) {
  float at = fract(angle / TURN + 1.0) * angles; int n = int(angles), i = int(at);
  return mix(texelFetch(wall, ivec2(i % n, 0), 0).r, texelFetch(wall, ivec2((i + 1) % n, 0), 0).r, fract(at));
}
void main() {
  vec3 u = vec3(0.0);
  for (int k = 0; k < rank; k++) u += texelFetch(weights, ivec2(k, gl_InstanceID), 0).r * of_basis(k * count + first + gl_VertexID);
  moved = largest > 0.0 ? length(u) / largest : 0.0;
  float own = turn + TURN * float(gl_InstanceID) / float(sectors);
  vec3 p;
  if (round_body) {
    float r = length(place.xy); vec2 e = place.xy / r; float angle = atan(e.y, e.x);
    float drawn = r + scale * dot(u.xy, e) + (scale - 1.0) * gap + (walled > 0 ? scale * wall_at(angle) : 0.0);
    angle += own + scale * (e.x * u.y - e.y * u.x) / r;
    p = vec3(drawn * cos(angle), drawn * sin(angle), place.z + scale * u.z);
  } else {
    vec3 q = place + scale * u;
    p = vec3(cos(own) * q.x - sin(own) * q.y, sin(own) * q.x + cos(own) * q.y, q.z);
  }
  where_ = p + shift;
  hot = light.y > 0.0 && nodes > 0 ? light.y * texelFetch(forces, ivec2(int(light.x), gl_InstanceID), 0).r : 0.0;
  gl_Position = camera * vec4(where_, 1.0);
  gl_PointSize = dot_size * (0.35 + 0.65 * sqrt(clamp(hot, 0.0, 1.0)));
  if (dot_size > 0.0) gl_Position.z -= 0.004 * gl_Position.w;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 where_; in float moved; in float hot;
uniform vec3 eye, steel, blue; uniform float alpha, dot_size, resting; uniform int mode;
out vec4 color;
vec3 heat(float h) { return h < 0.6 ? mix(vec3(0.85, 0.28, 0.06), vec3(1.0, 0.57, 0.17), h / 0.6) : mix(vec3(1.0, 0.57, 0.17), vec3(1.0, 0.93, 0.6), (h - 0.6) / 0.4); }
void main() {
  float h = clamp(hot, 0.0, 1.0);
  if (mode == 1) {
    float r = 2.0 * length(gl_PointCoord - 0.5);
    if (h < 0.002) { if (resting == 0.0 || r > 0.5) discard; color = vec4(blue, 1.0) * resting; return; }
    float a = r < 0.4 ? 1.0 : 0.75 * pow(max(0.0, (1.0 - r) / 0.6), 2.0);
    if (a < 0.01) discard;
    color = vec4(heat(h) * a, a); return;
  }
  if (mode == 2) { color = vec4(mix(blue, heat(h), step(0.002, h)), 1.0); return; }
  vec3 normal = normalize(cross(dFdx(where_), dFdy(where_))), to_eye = normalize(eye - where_);
  float facing = abs(dot(normal, to_eye));
  vec3 base = mix(steel, blue, pow(clamp(moved, 0.0, 1.0), 0.8));
  vec3 lit = base * (0.45 + 0.6 * facing) + 0.12 * pow(facing, 24.0);
  lit = mix(lit, heat(h), smoothstep(0.0, 0.12, h) * (0.55 + 0.45 * h));
  // A translucent shell is denser where it is seen edge-on.
  float a = alpha < 1.0 ? alpha + (1.0 - alpha) * 0.55 * pow(1.0 - facing, 3.0) : 1.0;
  color = vec4(lit * a, a);
}`;

function start(buffer) {
  const program = link();
  const uniform = new Proxy({}, { get: (known, name) => known[name] ??= gl.getUniformLocation(program, name) });
  // All low bytes of an array come before all high bytes.
  const u16 = (place, count) => { const [low, high] = [0, count].map(more => new Uint8Array(buffer, place + more, count)); return Uint16Array.from(low, (byte, i) => byte | high[i] << 8); };
  const i16 = ([place, unit], count) => Float32Array.from(new Int16Array(u16(place, count).buffer), v => v * unit);
  const times = header.times, frames = times.length, ANGLES = header.angles;
  const walls = header.walls.map(own => ({ ...own, change: i16(own.change, ANGLES * frames), now: new Float32Array(ANGLES), texture: texture() }));
  let reach = 0, low = Infinity, hardest = 0;
  const bodies = header.bodies.map((own, index) => body(own, index));
  walls.filter(own => own.carrier === null || !bodies[own.carrier].triangles).forEach(own => bodies.push(shell(own)));
  const rotors = bodies.filter(own => own.role === "rotor");
  rotors.forEach(own => { if (own.triangles && own.inner > 0.25 * own.outer) bodies.push(drum(own)); });
  if (!Number.isFinite(low)) low = 0;
  const totals = header.totals;

  const moving = Math.max(1e-12, ...bodies.map(own => own.largest)), extent = Math.max(1e-9, ...bodies.map(own => own.height));
  const usual = Math.max(1, 0.2 * extent / moving);
  const is_round = walls.length > 0;
  const hit = header.hit, hit_body = hit && bodies[hit.body];
  const state = { at: 0, scale: is_round ? usual : Math.min(usual, 1 + usual / 4), playing: false, yaw: 0, pitch: 0, near: 1, view: "all", turn: false, pace: 1 };
  const limits = [1, Math.max(100, 10 * usual)];
  const first_view = () => Object.assign(state, state.view === "all" ? { yaw: 0.5, pitch: 0.3, near: 1 } : { yaw: 0.75, pitch: 0.35, near: 1 });
  first_view();

  function texture() {
    const own = gl.createTexture(); gl.bindTexture(gl.TEXTURE_2D, own);
    for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, which, gl.NEAREST);
    return own;
  }
  function fill(own, width, height, values, channels = 1) {
    gl.bindTexture(gl.TEXTURE_2D, own);
    const [inside, format] = channels === 3 ? [gl.RGB32F, gl.RGB] : [gl.R32F, gl.RED];
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, format, gl.FLOAT, values);
  }
  function vertices(places, lights, indices) {
    const own = gl.createVertexArray(); gl.bindVertexArray(own);
    [[places, 3], [lights, 2]].forEach(([values, size], at) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer()); gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
    });
    if (indices) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer()); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW); }
    return own;
  }
  function body(own, index) {
    const points = own.points, places = i16(own.place, 3 * points), surface = points - own.nodes;
    const basis = new Float32Array(3 * points * own.rank), rows = Math.max(1, Math.ceil(points * own.rank / 1024));
    own.basis.forEach((one, k) => basis.set(i16(one, 3 * points), 3 * points * k));
    const padded = new Float32Array(3 * 1024 * rows); padded.set(basis);
    const weights = own.weights.map(one => i16(one, frames * own.sectors));
    const size = own.forces[2] ? own.sectors * own.nodes : 0, forces = i16(own.forces, frames * size);
    hardest = forces.reduce((most, force) => Math.max(most, force), hardest);
    const node = u16(own.lights, points), strength = u16(own.light, points), lights = new Float32Array(2 * points);
    for (let p = 0; p < points; p++) { lights[2 * p] = node[p]; lights[2 * p + 1] = strength[p] / 32767; }
    const radii = [], z = [];
    for (let p = 0; p < points; p++) { radii.push(Math.hypot(places[3 * p], places[3 * p + 1])); z.push(places[3 * p + 2]); }
    const outer = radii.reduce((a, b) => Math.max(a, b), 0), inner = radii.reduce((a, b) => Math.min(a, b), outer);
    reach = Math.max(reach, Math.hypot(outer, ...[Math.max(...z.map(Math.abs))].map(v => own.role === "free" ? v : 0)));
    const result = { ...own, index, size, forces, weights, outer, inner, z: [Math.min(...z), Math.max(...z)], texture: texture(), basis: texture(), light: texture(),
      height: own.sectors > 1 ? Math.max(outer - inner, 0.15 * outer) : 0.25 * outer, now: new Float32Array(Math.max(1, own.sectors * own.rank)), lit: new Float32Array(Math.max(1, size)),
      lines: own.lines[1] ? vertices(places, lights, u16(...own.lines)) : null, line_count: own.lines[1],
      triangles: own.triangles[1] ? vertices(places, lights, u16(...own.triangles)) : null, triangle_count: own.triangles[1],
      dots: own.nodes ? vertices(places.slice(3 * surface), lights.slice(2 * surface).map((v, i) => i % 2 ? 1 : i / 2), null) : null, surface,
      walled: own.wall, gap: own.wall === null || !walls[own.wall] ? 0 : walls[own.wall].gap };
    fill(result.basis, 1024, rows, padded, 3);
    result.largest = sizes(result, basis);
    return result;
  }
  // Largest displacement (m) of a subset of the points at a subset of the times.
  function sizes(own, basis) {
    let most = 0;
    const step = Math.max(1, Math.floor(own.points / 60)), jump = Math.max(1, Math.floor(frames * own.sectors / 1500));
    for (let s = 0; s < frames * own.sectors; s += jump) for (let p = 0; p < own.points; p += step) {
      let [x, y, z] = [0, 0, 0];
      for (let k = 0; k < own.rank; k++) { const w = own.weights[k][s], at = 3 * (k * own.points + p); x += w * basis[at]; y += w * basis[at + 1]; z += w * basis[at + 2]; }
      most = Math.max(most, Math.hypot(x, y, z));
    }
    return most;
  }
  // A body of revolution without displacements: rows of radius and axial position.
  function revolved(rows, extra) {
    const places = [], corners = [];
    rows.forEach(([radius, z], k) => { for (let i = 0; i < ANGLES; i++) {
      const angle = 2 * Math.PI * i / ANGLES, next = (i + 1) % ANGLES;
      places.push(radius * Math.cos(angle), radius * Math.sin(angle), z);
      if (k > 0) corners.push((k - 1) * ANGLES + i, (k - 1) * ANGLES + next, k * ANGLES + next, (k - 1) * ANGLES + i, k * ANGLES + next, k * ANGLES + i);
    } });
    const outer = Math.max(...rows.map(row => row[0]));
    reach = Math.max(reach, outer);
    return { rank: 0, points: places.length / 3, sectors: 1, nodes: 0, size: 0, forces: [], weights: [], largest: 0, height: 0, outer, cylindrical: true, texture: texture(),
      basis: texture(), light: texture(), now: new Float32Array(1), lit: new Float32Array(1), motion: null, triangle_count: corners.length, walled: null, gap: 0,
      triangles: vertices(new Float32Array(places), new Float32Array(places.length / 3 * 2), new Uint16Array(corners)),
      lines: extra.rims ? vertices(new Float32Array(places), new Float32Array(places.length / 3 * 2), new Uint16Array(rims(rows.length))) : null, line_count: 4 * ANGLES, ...extra };
  }
  // Lines along the first and the last row.
  function rims(count) { return [0, (count - 1) * ANGLES].flatMap(row => Array.from({ length: ANGLES }, (_, i) => [row + i, row + (i + 1) % ANGLES]).flat()); }
  function shell(own) {
    const few = own.rows.length > 9 ? own.rows.filter((_, i) => i % Math.ceil(own.rows.length / 9) === 0 || i === own.rows.length - 1) : own.rows;
    // The drawn shell is wider than the contact, so that its shape is visible.
    const [first, last] = [few[0], few[few.length - 1]], more = Math.max(0.25 * (last[1] - first[1]), 0.02 * first[0]);
    return revolved([[first[0], first[1] - more], ...few, [last[0], last[1] + more]], { role: "casing", rims: true, walled: walls.indexOf(own), gap: own.gap });
  }
  function drum(own) {
    const [from, to] = own.z, inner = own.inner * 0.999;
    return revolved([[0.45 * inner, from], [inner, from], [inner, to], [0.45 * inner, to]], { role: "drum", motion: own.motion });
  }

  function link() {
    const own = gl.createProgram();
    [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]].forEach(([kind, text]) => {
      const shader = gl.createShader(kind); gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(own, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    });
    gl.linkProgram(own); gl.useProgram(own);
    return own;
  }

  // Sets the state at the time of the slider, interpolated between two stored times.
  const mix = (a, b, share) => a + (b - a) * share;
  function set_time() {
    const f = Math.min(Math.floor(state.at), Math.max(0, frames - 2)), g = Math.min(f + 1, frames - 1), share = state.at - f;
    for (const own of bodies) {
      for (let k = 0; k < own.rank; k++) for (let s = 0; s < own.sectors; s++)
        own.now[s * own.rank + k] = mix(own.weights[k][f * own.sectors + s], own.weights[k][g * own.sectors + s], share);
      for (let i = 0; i < own.size; i++) own.lit[i] = hardest > 0 ? mix(own.forces[f * own.size + i], own.forces[g * own.size + i], share) / hardest : 0;
      if (own.rank) fill(own.texture, own.rank, own.sectors, own.now);
      if (own.size) fill(own.light, own.nodes, own.sectors, own.lit);
      const [a, b] = own.motion ? [own.motion[f], own.motion[g]] : [[0, 0, 0, 0], [0, 0, 0, 0]];
      own.moved = a.map((value, axis) => mix(value, b[axis], share));
    }
    for (const own of walls) { own.now.forEach((_, i) => { own.now[i] = mix(own.change[f * ANGLES + i], own.change[g * ANGLES + i], share); }); fill(own.texture, ANGLES, 1, own.now); }
    return { time: mix(times[f], times[g], share), total: mix(totals[f], totals[g], share) };
  }

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], unit = a => a.map(v => v / Math.hypot(...a));
  const sum = (...terms) => [0, 1, 2].map(axis => terms.reduce((total, [factor, vector]) => total + factor * vector[axis], 0));
  function camera() {
    const angle = hit_body && (state.view === "blade" || state.turn) ? hit_body.moved[0] : 0;
    const axes = state.view === "blade" ? angle + 2 * Math.PI * hit.sector / hit_body.sectors + hit_body.middle : angle;
    let across = [Math.cos(axes), Math.sin(axes), 0], up = [-Math.sin(axes), Math.cos(axes), 0], target = [0, 0, 0], size = reach;
    if (state.view === "blade") {
      [across, up] = [[Math.sin(axes), -Math.cos(axes), 0], across];
      target = sum([mix(hit_body.inner, hit_body.outer, 0.6), up], [0.5 * (hit_body.z[0] + hit_body.z[1]), [0, 0, 1]]); size = 0.62 * hit_body.height;
    } else { target = [0, 0, middle_z]; if (hit_body && hit_body.role === "free") target = sum([1, target], [1, hit_body.moved.slice(1)]); }
    const [sy, cy, sp, cp] = [Math.sin(state.yaw), Math.cos(state.yaw), Math.sin(state.pitch), Math.cos(state.pitch)];
    const away = sum([cp * cy, [0, 0, 1]], [cp * sy, across], [sp, up]);
    const aspect = canvas.width / canvas.height, view = 0.5, distance = 1.04 * size / Math.tan(view / 2) / Math.min(1, aspect) / state.near;
    const eye = sum([1, target], [distance, away]), right = unit(cross(up, away)), high = cross(away, right);
    const f = 1 / Math.tan(view / 2), near = 0.05 * distance, far = distance + 4 * reach;
    const columns = [0, 1, 2].map(axis => [f / aspect * right[axis], f * high[axis], (near + far) / (near - far) * away[axis], -away[axis]]);
    const [x, y, z] = [-dot(right, eye), -dot(high, eye), -dot(away, eye)];
    return { matrix: new Float32Array([...columns.flat(), f / aspect * x, f * y, (near + far) / (near - far) * z + 2 * near * far / (near - far), -z]), eye };
  }
  const middle_z = is_round ? bodies.filter(own => own.z).reduce((sum, own, _, all) => sum + 0.5 * (own.z[0] + own.z[1]) / all.length, 0) : 0;
  if (hit_body) { // Angle of the middle of the first sector.
    const places = i16(header.bodies[hit.body].place, 3 * hit_body.points); let [x, y] = [0, 0];
    for (let p = 0; p < hit_body.points; p++) { x += places[3 * p]; y += places[3 * p + 1]; }
    hit_body.middle = Math.atan2(y, x);
  }

  const color = name => { const [, hex] = getComputedStyle(document.documentElement).getPropertyValue(name).match(/#(\w{6})/); return [0, 2, 4].map(i => parseInt(hex.slice(i, i + 2), 16) / 255); };
  function draw() {
    const ratio = Math.min(2, self.devicePixelRatio || 1), [wide, high] = [canvas.clientWidth, canvas.clientHeight].map(v => Math.max(1, Math.round(v * ratio)));
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    const now = set_time(), view = camera();
    gl.viewport(0, 0, wide, high); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA); gl.useProgram(program);
    gl.uniformMatrix4fv(uniform.camera, false, view.matrix); gl.uniform3fv(uniform.eye, view.eye);
    gl.uniform3fv(uniform.steel, color("--steel")); gl.uniform3fv(uniform.blue, color("--blue")); gl.uniform1f(uniform.angles, ANGLES);
    ["weights", "basis", "forces", "wall"].forEach((name, at) => gl.uniform1i(uniform[name], at));
    const solid = own => own.role !== "casing" || !is_round;
    pass(bodies.filter(solid), 1);
    const dot_size = ratio * (state.view === "blade" ? 30 : 17);
    gl.enable(gl.BLEND); gl.depthMask(false);
    // Far side of the shell, then the near side.
    gl.enable(gl.CULL_FACE);
    for (const side of [gl.FRONT, gl.BACK]) { gl.cullFace(side); pass(bodies.filter(own => !solid(own)), state.view === "blade" ? 0.12 : 0.2); }
    gl.disable(gl.CULL_FACE);
    for (const own of bodies.filter(own => own.dots && (own.size || !own.triangles))) {
      use(own); gl.uniform1i(uniform.first, own.surface); gl.uniform1i(uniform.mode, 1); gl.uniform1f(uniform.dot_size, own.size ? dot_size : 0.5 * dot_size); gl.uniform1f(uniform.resting, own.triangles ? 0 : 0.9);
      gl.bindVertexArray(own.dots); gl.drawArraysInstanced(gl.POINTS, 0, own.nodes, own.sectors);
    }
    gl.disable(gl.BLEND); gl.depthMask(true);
    gl.uniform1f(uniform.dot_size, 0);
    report(now);
  }
  function use(own) {
    [own.texture, own.basis, own.light, own.walled === null || !walls[own.walled] ? own.light : walls[own.walled].texture].forEach((one, at) => { gl.activeTexture(gl.TEXTURE0 + at); gl.bindTexture(gl.TEXTURE_2D, one); });
    gl.activeTexture(gl.TEXTURE4);
    const factor = own.role === "free" ? 1 : state.scale;
    [["rank", own.rank], ["count", own.points], ["sectors", own.sectors], ["nodes", own.size ? own.nodes : 0], ["first", 0], ["walled", own.walled === null || !walls[own.walled] ? 0 : 1], ["round_body", own.cylindrical ? 1 : 0], ["mode", 0]]
      .forEach(([name, value]) => gl.uniform1i(uniform[name], value));
    [["scale", state.scale], ["gap", own.gap], ["turn", own.moved[0]], ["largest", moving], ["dot_size", 0]].forEach(([name, value]) => gl.uniform1f(uniform[name], value));
    gl.uniform3fv(uniform.shift, own.moved.slice(1).map(value => factor * value));
  }
  function pass(list, alpha) {
    for (const own of list) {
      use(own); gl.uniform1f(uniform.alpha, own.role === "casing" && is_round ? alpha : 1);
      if (own.triangles) { gl.bindVertexArray(own.triangles); gl.drawElementsInstanced(gl.TRIANGLES, own.triangle_count, gl.UNSIGNED_SHORT, 0, own.sectors); }
      if (own.lines) { gl.uniform1i(uniform.mode, 2); gl.bindVertexArray(own.lines); gl.drawElementsInstanced(gl.LINES, own.line_count, gl.UNSIGNED_SHORT, 0, own.sectors); }
    }
  }

  const prefix = (value, name) => {
    const [factor, letter] = [[1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]].find(([f]) => Math.abs(value) >= 0.9995 * f) || [1, ""];
    return `${Number((value / factor).toPrecision(3))} ${letter}${name}`;
  };
  const slider = name => find(`input[name=${name}]`), steps = 2000;
  function report({ time, total }) {
    const exact = `${(1e3 * time).toFixed(3)} ms`;
    find(".now").textContent = `t = ${exact}\n${total > 0 ? "contact force " + prefix(total, "N") : "no contact"}`;
    find(".time .value").textContent = exact; find(".scale .value").textContent = `×${Number(state.scale.toPrecision(3))}`;
    slider("time").setAttribute("aria-valuetext", exact); slider("scale").setAttribute("aria-valuetext", find(".scale .value").textContent);
  }
  let asked = false, last = 0;
  const ask = () => { if (!asked) { asked = true; requestAnimationFrame(step); } };
  function step(stamp) {
    asked = false;
    if (state.playing) {
      if (last) state.at = (state.at + Math.min(100, stamp - last) / 1000 * 8 * state.pace) % Math.max(1, frames - 1);
      last = stamp; slider("time").value = Math.round(steps * state.at / Math.max(1, frames - 1));
    }
    draw();
    if (state.playing) ask();
  }
  const play = on => { state.playing = on; last = 0; const button = find(".play"); button.textContent = on ? "Pause" : "Play"; button.setAttribute("aria-pressed", on); ask(); };
  find(".play").addEventListener("click", () => play(!state.playing));
  slider("time").addEventListener("input", event => { state.at = event.target.value / steps * Math.max(0, frames - 1); play(false); });
  slider("scale").addEventListener("input", event => { state.scale = limits[0] * (limits[1] / limits[0]) ** (event.target.value / 1000); ask(); });
  slider("scale").value = 1000 * Math.log(state.scale / limits[0]) / Math.log(limits[1] / limits[0]);
  find("select").addEventListener("change", event => { state.pace = Number(event.target.value); });
  root.querySelectorAll("input[name=view]").forEach(own => own.addEventListener("change", () => { state.view = own.value; first_view(); ask(); }));
  slider("turn")?.addEventListener("change", event => { state.turn = event.target.checked; ask(); });
  const turn = (x, y) => { state.yaw -= x; state.pitch = Math.max(-1.5, Math.min(1.5, state.pitch + y)); ask(); };
  const zoom = factor => { state.near = Math.max(0.3, Math.min(12, state.near * factor)); ask(); };
  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => { if (event.buttons & 1) turn(event.movementX / 150, event.movementY / 150); });
  canvas.addEventListener("wheel", event => { if (event.ctrlKey) { event.preventDefault(); zoom(Math.exp(-event.deltaY / 400)); } }, { passive: false });
  canvas.addEventListener("dblclick", () => { first_view(); ask(); });
  canvas.addEventListener("keydown", event => {
    const keys = { ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1), "+": () => zoom(1.15), "-": () => zoom(1 / 1.15), " ": () => play(!state.playing) };
    if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
  });
  new ResizeObserver(ask).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", ask);

  const most = totals.reduce((a, b) => Math.max(a, b), 0);
  find(".strip path").setAttribute("d", "M0 24" + totals.map((force, f) => `L${(1000 * f / Math.max(1, frames - 1)).toFixed(1)} ${(24 - 23 * (most > 0 ? force / most : 0)).toFixed(1)}`).join("") + "L1000 24z");
  find(".key .cool + b").textContent = `0 to ${prefix(moving, "m")}`; find(".key .hot + b").textContent = hardest > 0 ? `up to ${prefix(hardest, "N")} per contact node` : "none";
  // The first picture shows the largest force; the animation starts shortly before it.
  state.at = Math.max(0, most > 0 ? totals.indexOf(most) : 0);
  slider("time").value = Math.round(steps * state.at / Math.max(1, frames - 1));
  root.dataset.ready = "true";
  if (frames > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) { state.at = Math.max(0, state.at - 10); play(true); } else play(false);
}
})();

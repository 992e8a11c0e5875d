// What the visitor has chosen, and its form in the address:
// #ev=0.5&split=30&solo=2&l1=1,-0.5,k2700&l2=0,0,xff8800  (row 0 is the ambient light)
const LIMIT = 6;

function originalState(scene) {
  return {
    ev: 0, split: 0, solo: -1,
    rows: scene.rows.map((row) => ({ on: row.on, stops: 0, colour: "o" })),
  };
}

function clampNumber(text, low, high, fallback) {
  const value = Number.parseFloat(text);
  return Number.isFinite(value) ? Math.min(high, Math.max(low, value)) : fallback;
}

function writeHash(scene, state) {
  const original = originalState(scene);
  const parts = [];
  if (state.ev !== 0) parts.push(`ev=${state.ev}`);
  if (state.split !== 0) parts.push(`split=${state.split}`);
  if (state.solo >= 0) parts.push(`solo=${state.solo}`);
  state.rows.forEach((row, i) => {
    const was = original.rows[i];
    if (row.on !== was.on || row.stops !== was.stops || row.colour !== was.colour) {
      parts.push(`l${i}=${row.on ? 1 : 0},${row.stops},${row.colour}`);
    }
  });
  return parts.join("&");
}

// Anything in the address that does not fit this photo is left at the original lighting.
function readHash(scene, hash) {
  const state = originalState(scene);
  for (const [key, value] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (key === "ev") state.ev = clampNumber(value, -LIMIT, LIMIT, 0);
    if (key === "split") state.split = clampNumber(value, 0, 100, 0);
    if (key === "solo") state.solo = Math.round(clampNumber(value, -1, scene.rows.length - 1, -1));
    const row = /^l(\d+)$/.test(key) ? state.rows[Number(key.slice(1))] : undefined;
    if (!row) continue;
    const [on, stops, colour] = value.split(",");
    row.on = on === "1";
    row.stops = clampNumber(stops, -LIMIT, LIMIT, 0);
    row.colour = /^(o|k\d{3,5}|x[0-9a-f]{6})$/.test(colour) ? colour : "o";
  }
  return state;
}

const linearFromSrgb = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const srgbFromLinear = (v) => (v <= 0.0031308 ? v * 12.92 : 1.055 * v ** (1 / 2.4) - 0.055);

function hexFromLinear(rgb) {
  const byte = (v) => Math.round(255 * srgbFromLinear(Math.min(1, Math.max(0, v))));
  return "#" + rgb.map((v) => byte(v).toString(16).padStart(2, "0")).join("");
}

// Linear RGB, largest channel 1, of a black body; the table is computed where the page was written.
function blackBody(scene, kelvin) {
  const { kelvins, colours } = scene.temperatures;
  let i = kelvins.findIndex((k) => k >= kelvin);
  if (i <= 0) i = i < 0 ? kelvins.length - 1 : 1;
  const t = Math.min(1, Math.max(0, (kelvin - kelvins[i - 1]) / (kelvins[i] - kelvins[i - 1])));
  return colours[i].map((v, c) => v * t + colours[i - 1][c] * (1 - t));
}

function rowColour(scene, state, i) {
  const code = state.rows[i].colour;
  if (code[0] === "k") return blackBody(scene, Number(code.slice(1)));
  if (code[0] === "x") {
    return [1, 3, 5].map((c) => linearFromSrgb(parseInt(code.slice(c, c + 2), 16) / 255));
  }
  return scene.rows[i].colour;
}

// Linear RGB factor of each layer.
function layerWeights(scene, state) {
  return state.rows.map((row, i) => {
    const lit = state.solo >= 0 ? state.solo === i : row.on;
    return rowColour(scene, state, i).map((v) => (lit ? v * 2 ** row.stops : 0));
  });
}

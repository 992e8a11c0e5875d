// The controls: built from the scene, always redrawn from the state.
const find = (id) => document.getElementById(id);
const scene = JSON.parse(find("scene").textContent);
let state = readHash(scene, location.hash);
let mixer = null;
let peeking = false;

const stopsText = (v) => (v === 0 ? "±0" : (v > 0 ? "+" : "−") + Math.abs(v).toFixed(1)) + " EV";
const { kelvins } = scene.temperatures;
const kelvinFromSlider = (t) => {
  const k = kelvins[0] * (kelvins[kelvins.length - 1] / kelvins[0]) ** t;
  return Math.round(k / 50) * 50;
};
const sliderFromKelvin = (k) =>
  Math.log(k / kelvins[0]) / Math.log(kelvins[kelvins.length - 1] / kelvins[0]);

function colourText(code) {
  if (code[0] === "k") return `${code.slice(1)} K`;
  return code[0] === "x" ? `#${code.slice(1)}` : "as in the photo";
}

// A lamp's own colour has luminance 1, so a channel may exceed what a swatch can show.
const swatch = (rgb) => hexFromLinear(rgb.map((v) => v / Math.max(1, ...rgb)));

function buildRow(row, i) {
  const element = find("row").content.cloneNode(true).firstElementChild;
  const part = (selector) => element.querySelector(selector);
  part("legend").textContent = part(".name").textContent = row.name;
  part(".solo").setAttribute("aria-label", `Solo: only ${row.name}`);
  part(".stops").setAttribute("aria-label", `${row.name}: intensity`);
  part(".kelvin").setAttribute("aria-label", `${row.name}: colour temperature`);
  part(".rgb").setAttribute("aria-label", `${row.name}: any colour`);
  const change = (edit) => { edit(state.rows[i]); update(); };
  part("[role=switch]").onchange = (e) => change((s) => { s.on = e.target.checked; });
  part(".stops").oninput = (e) => change((s) => { s.stops = Number(e.target.value); });
  part(".kelvin").oninput = (e) =>
    change((s) => { s.colour = `k${kelvinFromSlider(Number(e.target.value))}`; });
  part(".rgb").oninput = (e) => change((s) => { s.colour = `x${e.target.value.slice(1)}`; });
  part(".own").onclick = () => change((s) => { s.colour = "o"; });
  part(".solo").onclick = () => { state.solo = state.solo === i ? -1 : i; update(); };
  find("rows").append(element);
  return element;
}

function showRow(element, i) {
  const row = state.rows[i], part = (selector) => element.querySelector(selector);
  const lit = state.solo >= 0 ? state.solo === i : row.on;
  element.classList.toggle("off", !lit);
  part("[role=switch]").checked = row.on;
  part(".stops").value = row.stops;
  const [intensity, colour] = element.querySelectorAll("output");
  intensity.textContent = stopsText(row.stops);
  part(".stops").setAttribute("aria-valuetext", intensity.textContent);
  colour.textContent = colourText(row.colour);
  part(".kelvin").setAttribute("aria-valuetext", colour.textContent);
  if (row.colour[0] !== "x") {
    const kelvin = row.colour[0] === "k" ? Number(row.colour.slice(1)) : scene.rows[i].kelvin;
    part(".kelvin").value = sliderFromKelvin(kelvin);
  }
  part(".rgb").value = swatch(rowColour(scene, state, i));
  part(".own").disabled = row.colour === "o";
  part(".solo").setAttribute("aria-pressed", String(state.solo === i));
}

let scheduled = false;
function update() {
  rowElements.forEach(showRow);
  find("exposure").value = state.ev;
  find("exposure-text").textContent = stopsText(state.ev);
  find("exposure").setAttribute("aria-valuetext", stopsText(state.ev));
  find("split").value = state.split;
  const split = peeking ? 100 : state.split;
  find("divider").style.left = `${split}%`;
  find("tag-before").hidden = split < 12;
  find("tag-after").hidden = split > 88;
  if (!scheduled) requestAnimationFrame(paint);
  scheduled = true;
}

let hashTimer = 0;
function paint() {
  scheduled = false;
  mixer.draw(layerWeights(scene, state), state.ev, peeking ? 100 : state.split);
  // Browsers refuse more than about 100 address changes in 30 seconds.
  clearTimeout(hashTimer);
  hashTimer = setTimeout(() => history.replaceState(null, "", `#${writeHash(scene, state)}`), 250);
}

function drawThumbnails() {
  rowElements.forEach((element, i) => {
    const alone = originalState(scene);
    alone.solo = i;
    mixer.draw(layerWeights(scene, alone), 0, 0);
    const thumb = element.querySelector(".thumb");
    [thumb.width, thumb.height] = [128, 96];
    const scale = Math.max(128 / scene.width, 96 / scene.height);
    const [w, h] = [scene.width * scale, scene.height * scale];
    thumb.getContext("2d").drawImage(find("view"), (128 - w) / 2, (96 - h) / 2, w, h);
  });
}

function download() {
  mixer.draw(layerWeights(scene, state), state.ev, 0);
  find("view").toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "relit.png";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
  update();
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key.toLowerCase() === "b" && !event.repeat) { peeking = true; update(); }
  if (event.key === "0") { reset(); }
  const row = state.rows[Number(event.key)];
  if (/^[1-9]$/.test(event.key) && row) { row.on = !row.on; update(); }
}

function reset() {
  state = { ...originalState(scene), split: state.split };
  update();
}

function fail(sentence) {
  find("message").textContent = sentence;
  find("message").hidden = false;
  find("panel").hidden = true;
  for (const id of ["view", "split", "divider", "tag-before", "tag-after"]) find(id).hidden = true;
}

function connect() {
  find("exposure").oninput = (e) => { state.ev = Number(e.target.value); update(); };
  find("split").oninput = (e) => { state.split = Number(e.target.value); update(); };
  find("original").onclick = reset;
  find("download").onclick = download;
  find("fine").textContent = scene.note;
  addEventListener("keydown", onKey);
  addEventListener("keyup", (e) => { if (e.key.toLowerCase() === "b") { peeking = false; update(); } });
  addEventListener("blur", () => { if (peeking) { peeking = false; update(); } });
  addEventListener("hashchange", () => { state = readHash(scene, location.hash); update(); });
}

async function start() {
  find("photo").src = `data:image/webp;base64,${scene.photo}`;
  const colours = scene.temperatures.colours.map(hexFromLinear);
  document.documentElement.style.setProperty(
    "--temperatures", `linear-gradient(to right, ${colours.join(",")})`);
  const pictures = await Promise.all([scene.photo, ...scene.rows.map((r) => r.data)].map(decodePicture));
  find("view").addEventListener("webglcontextlost", () =>
    fail("The graphics driver dropped this page; reload it to go on with the same lighting."));
  mixer = new Mixer(find("view"), scene, pictures.slice(1), pictures[0]);
  rowElements = scene.rows.map(buildRow);
  drawThumbnails();
  connect();
  for (const id of ["panel", "view", "split", "divider"]) find(id).hidden = false;
  update();
}

let rowElements = [];
start().catch((error) => fail(error.message === "webgl2"
  ? "This browser has no WebGL 2, so the lamps cannot be mixed here; this is the photo as it was taken. Any current Chrome, Edge, Firefox or Safari with hardware graphics will do."
  : `The lighting layers could not be shown: ${error.message}`));

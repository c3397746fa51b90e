// The page: settings go to the worker, a run comes back, pictures follow; the cursor moves by hand or by itself.

let worker, run, waiting = false, wanted = false, cursor = 0, playing = null;

function startWorker() {
  const text = document.getElementById("worker").textContent;
  worker = new Worker(URL.createObjectURL(new Blob([text], {type: "text/javascript"})));
  worker.onmessage = ({data}) => data.ready ? request() : received(data);
  worker.onerror = (event) => { $("outcome").textContent = `The model cannot be run here: ${event.message}`; };
  const wasm = Uint8Array.from(atob($("wasm").textContent), (sign) => sign.charCodeAt(0));
  worker.postMessage({wasm, model: {...model, controls: undefined}});
  waiting = true;
}

// One run at a time: what changes meanwhile is asked for when it is back.
function request() {
  waiting = true;
  wanted = false;
  worker.postMessage({given: given(), number: performance.now()});
}

function settingsChanged() {
  try { history.replaceState(null, "", values.size ? `#${link()}` : location.pathname + location.search); } catch { /* a page without an address */ }
  model.controls.forEach((control) => showControl(control));
  if (waiting) wanted = true; else request();
}

function received(result) {
  waiting = false;
  model.controls.forEach((control, i) => showControl(control,
    i < model.parameters ? result.parameters[i] : result.start[i - model.parameters]));
  $("pictures").classList.toggle("stale", result.refusal > 0);
  if (result.refusal) {
    showRefusal(result);
  } else {
    run = result;
    if (model.scene.length) measureScene(run);
    redraw();
    showFacts(run);
    showWhoseVerdict(values.size === 0);
  }
  document.body.dataset.runs = Number(document.body.dataset.runs ?? 0) + 1;
  document.body.dataset.latency = performance.now() - result.number; // milliseconds
  document.body.dataset.first ??= performance.now();
  if (wanted) request();
}

function redraw() {
  if (!run) return;
  readSizes();
  drawRibbon(run);
  drawPanels(run);
  drawPhase(run);
  show(cursor);
}

// The last point that is not after a time.
function pointAt(t) {
  let low = 0, high = run.times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (run.times[middle] <= t) low = middle + 1; else high = middle;
  }
  return Math.max(0, low - 1);
}

// Show the run at a share of its time.
function show(share, point) {
  const end = span(run)[1], t = share * end, i = point ?? pointAt(t);
  cursor = share;
  $("cursor").value = Math.round(1000 * share);
  const next = run.times[i + 1] > run.times[i] ? (t - run.times[i]) / (run.times[i + 1] - run.times[i]) : 0;
  const mode = modeOf(run.arcs[run.arcOf[i]].mode);
  $("now").textContent = `t = ${format(run.times[i], 5)}, ${mode}`;
  $("cursor").setAttribute("aria-valuetext", `t = ${format(run.times[i], 4)}, mode ${mode}`);
  drawScene(run, i, Math.min(1, Math.max(0, next)));
  drawCursor(run, i);
  const texts = [["t", run.times[i]], ...model.columns.map((name, k) => [withUnit(name), run.columns[k][i]])];
  const row = (name, value) => element("tr", {}, element("th", {textContent: name, scope: "row"}), value);
  const rows = texts.map(([name, x]) => row(name, cell(x)));
  $("values").tBodies[0].replaceChildren(row("mode", element("td", {textContent: mode})), ...rows);
}

function pointed(canvas, made, a, b) {
  if (!run || playing !== null) return;
  if (canvas === $("phase")) {
    const i = nearest(made, a, b);
    show(run.times[i] / span(run)[1], i);
  } else {
    show(Math.min(1, Math.max(0, (a - made.box.left) / (made.box.right - made.box.left))));
  }
}

// Played in real time where a run lasts 4 to 20 s, else within that.
const playTime = () => Math.min(20, Math.max(4, span(run)[1])) / Number($("speed").value);

function play(on) {
  playing = null;
  $("play").textContent = on ? "Pause" : "Play";
  $("play").setAttribute("aria-pressed", String(on));
  if (!on || !run) return;
  if (cursor >= 1) cursor = 0;
  let last = performance.now();
  const step = (now) => {
    if (playing === null) return;
    show(Math.min(1, cursor + (now - last) / (1000 * playTime())));
    last = now;
    if (cursor < 1) playing = requestAnimationFrame(step); else play(false);
  };
  playing = requestAnimationFrame(step);
}

async function copyLink() {
  try {
    await navigator.clipboard.writeText(location.href);
    $("copied").textContent = "Copied.";
  } catch {
    $("copied").textContent = "The address of this page carries the settings.";
  }
}

function build() {
  buildControls();
  buildPlots(redraw, pointed);
  buildFacts();
  $("scene").hidden = !model.scene.length;
  $("speed").append(...[0.25, 0.5, 1, 2, 4].map((value) => element("option", {value, textContent: `${value}\u00d7`, selected: value === 1})));
  $("cursor").addEventListener("input", () => { if (run) { play(false); show($("cursor").valueAsNumber / 1000); } });
  $("play").addEventListener("click", () => play(playing === null));
  $("copy").addEventListener("click", copyLink);
  changed.push(settingsChanged);
  window.addEventListener("hashchange", () => { readLink(); settingsChanged(); });
  window.addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readPalette(); redraw(); });
  readPalette();
  readLink();
  model.controls.forEach((control) => showControl(control));
  startWorker();
}

build();

// The page: settings go to the worker, a run comes back, pictures follow.

const MOST_PANELS = 4;
let worker, run, waiting = false, outdated = false;

function startWorker() {
  const text = document.getElementById("worker").textContent;
  worker = new Worker(URL.createObjectURL(new Blob([text], {type: "text/javascript"})));
  worker.onmessage = ({data}) => data.ready ? request() : received(data);
  worker.onerror = (event) => { $("outcome").textContent = `The model cannot be run here: ${event.message}`; };
  const wasm = Uint8Array.from(atob($("wasm").textContent), (sign) => sign.charCodeAt(0));
  worker.postMessage({wasm, model: {...model, controls: undefined}});
  waiting = true;
}

// One run at a time: what changes meanwhile follows when it is back.
function request() {
  waiting = true;
  outdated = false;
  worker.postMessage({given: given(), number: performance.now()});
}

function settingsChanged() {
  try { history.replaceState(null, "", values.size ? `#${link()}` : location.pathname + location.search); } catch { /* a page without an address */ }
  model.controls.forEach((control) => showControl(control));
  if (waiting) outdated = true; else request();
}

function received(result) {
  waiting = false;
  model.controls.forEach((control, i) => showControl(control,
    i < model.parameters ? result.parameters[i] : result.start[i - model.parameters]));
  $("pictures").classList.toggle("stale", result.refusal > 0);
  if (result.refusal) {
    showRefusal(result);
  } else {
    run = {...withProducts(result), failed: !["until", "final"].includes(model.reasons[result.reason].split(" ")[0])};
    runs = [run];
    zoomTo(...(zoomed && zoomed[1] <= span()[1] ? zoomed : []));
    if (model.scene.length) measureScene(run);
    redraw();
    showFacts(run);
    showWhoseVerdict(values.size === 0);
  }
  document.body.dataset.runs = Number(document.body.dataset.runs ?? 0) + 1;
  document.body.dataset.latency = performance.now() - result.number; // milliseconds
  document.body.dataset.first ??= performance.now();
  if (outdated) request();
}

// `t` is between the point of the run and the next one, which is of the same arc or not.
function sceneAt(t, [i]) {
  const next = run.times[i + 1] > run.times[i] ? (t - run.times[i]) / (run.times[i + 1] - run.times[i]) : 0;
  drawScene(run, i, Math.min(1, Math.max(0, next)));
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
  const [first = "t", second] = model.columns;
  buildPlots(model.columns.slice(0, MOST_PANELS), [second ? [first, second] : ["t", first]], redraw, pointed);
  followers.push(sceneAt);
  buildFacts();
  $("scene").hidden = !model.scene.length;
  $("copy").addEventListener("click", copyLink);
  changed.push(settingsChanged);
  window.addEventListener("hashchange", () => { readLink(); settingsChanged(); });
  buildPlayer();
  readLink();
  model.controls.forEach((control) => showControl(control));
  startWorker();
}

build();

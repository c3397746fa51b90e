// The page of runs that were made before: their numbers are in the page, little-endian, in base64.

const numbersIn = (text, kind) => new kind(Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0)).buffer);

function decoded(given) {
  const [start, end] = [given.arcs.start, given.arcs.end].map((text) => numbersIn(text, Float64Array));
  const [mode, jump, kind] = [given.arcs.mode, given.arcs.jump, given.arcs.kind].map((text) => numbersIn(text, Int32Array));
  const arcs = Array.from(mode, (each, i) => ({start: start[i], end: end[i], mode: each, jump: jump[i], kind: kind[i]}));
  const bands = given.bands.map(([which, from, to]) => ({mode: which, start: from, end: to, kind: 0}));
  return {...given, arcs, bands, arcOf: numbersIn(given.arcOf, Int32Array), times: numbersIn(given.times, Float64Array),
    columns: given.columns.map((text) => numbersIn(text, Float64Array))};
}

function decodedLine(given) {
  return {...given, times: numbersIn(given.times, Float64Array), values: numbersIn(given.values, Float64Array)};
}

function build() {
  model.moving = model.moving.map(decodedLine);
  runs = JSON.parse($("runs").textContent).map(decoded);
  $("scene").hidden = true;
  $("phases").hidden = !model.phases.length;
  buildPlots(model.shown, model.phases, redraw, pointed);
  buildPlayer();
  zoomTo();
  redraw();
}

build();

// Pictures of runs: the ribbon of modes, one panel for each state or output over time, phase space.
// The cursor has a canvas of its own over each. All runs of a page are in `runs`; times go from zero.

const MOST_BANDS = 2000, MOST_MARKED = 60;
const ROW = 26; // of a run's ribbon, in pixels
const panels = new Map(); // name: canvas
const phases = []; // {canvas, across, up}
const kept = new Map(); // canvas: its frame
const overlays = new Map(); // canvas: the one over it
let runs = [], zoomed = null; // what is shown; the part of time, null for all of it

const column = (run, name) => run.columns[model.columns.indexOf(name)];
const last = (array) => array[array.length - 1];
const span = () => [0, Math.max(...runs.map((run) => last(run.times))) || 1];
const part = () => zoomed ?? span();
const looks = () => runs.map((_, k) => runs.length > 1
  ? {colour: palette[`run-${k % 7}`], dashes: [[], [7, 3], [7, 3, 2, 3], [2, 2]][k % 4]} : {colour: palette.curve, dashes: []});

function over(canvas, draw) {
  const made = kept.get(canvas);
  if (made) draw({...made, ...canvasOf(overlays.get(canvas))});
}

// How many of the times are before one, or not after it.
function countOf(times, t, with_it = false) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t || with_it && times[middle] === t) low = middle + 1; else high = middle;
  }
  return low;
}

// The part of a run that is shown, with a point before and one after, each array without copying it.
function clipped(run, ...arrays) {
  const [start, end] = part();
  const [first, behind] = [Math.max(0, countOf(run.times, start) - 1), countOf(run.times, end, true) + 1];
  return arrays.map((array) => array.subarray(first, behind));
}

// The numbers that the range of an axis is from: the last ones of a run that failed are arbitrary.
function counted(run, xs) {
  const [times, inside] = clipped(run, run.times, xs);
  const calm = run.failed ? countOf(times, 0.97 * last(run.times)) : times.length;
  return inside.subarray(0, calm || times.length);
}

function rangeOfAll(name) {
  const [low, high] = rangeOf(...runs.map((run) => counted(run, name === "t" ? run.times : column(run, name))));
  const ends = moving(name).flatMap(({values}) => rangeOf(values));
  const near = [...levels(name).map(({value}) => value), ...ends].filter((x) => x > low - (high - low) / 2 && x < high + (high - low) / 2);
  return near.length ? rangeOf([low, high], near) : [low, high];
}

const levels = (name) => (model.guards ?? []).filter(({state}) => state === name);
const moving = (name) => (model.moving ?? []).filter(({state}) => state === name);

function bands({context, box, x}, run, strength, top = box.top, bottom = box.bottom) {
  const shown = run.bands ?? run.arcs;
  if (shown.length > MOST_BANDS) return;
  for (const {start, end, mode, kind} of shown) {
    const [a, b] = [Math.max(x(start), box.left), Math.min(x(end), box.right)];
    if (b < a) continue;
    context.globalAlpha = kind ? Math.min(1, 2 * strength) : strength;
    context.fillStyle = model.modes[mode].colour;
    context.fillRect(a, top, Math.max(b - a, kind ? 0 : 0.5), bottom - top);
  }
  context.globalAlpha = 1;
}

function drawRibbon() {
  const canvas = $("ribbon"), {context, width, height} = canvasOf(canvas);
  const box = {left: 58, right: width - 8, top: 2, bottom: height - 2}, across = part();
  const x = (t) => box.left + (t - across[0]) / (across[1] - across[0]) * (box.right - box.left);
  const row = (box.bottom - box.top) / runs.length;
  runs.forEach((run, k) => bands({context, box, x}, run, 0.85, box.top + k * row, box.top + (k + 1) * row - 1));
  runs.forEach((run, k) => { if (runs.length > 1) sample({context}, looks()[k], 8, 50, box.top + (k + 0.5) * row); });
  kept.set(canvas, {box, x, across});
}

function sample({context}, {colour, dashes}, left, right, y) {
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.setLineDash(dashes);
  context.beginPath(); context.moveTo(left, y); context.lineTo(right, y); context.stroke();
  context.setLineDash([]);
}

function drawLegend() {
  const seen = new Set(runs.flatMap((run) => (run.bands ?? run.arcs).map(({mode}) => mode)));
  const modes = model.modes.map((mode, i) => [mode, i]).filter(([, i]) => seen.has(i)).map(([mode]) => {
    const square = element("span");
    square.style.background = mode.colour;
    return element("li", {}, square, mode.name);
  });
  const lines = runs.length < 2 ? [] : runs.map((run, k) => {
    const line = element("canvas", {className: "line", width: 44, height: 12});
    sample({context: line.getContext("2d")}, looks()[k], 2, 42, 6);
    line.setAttribute("aria-hidden", "true");
    return element("li", {}, line, run.label);
  });
  $("legend").replaceChildren(...lines, ...modes);
}

const shownPanels = () => [...panels].filter(([, canvas]) => !canvas.parentElement.hidden);

function drawPanels() {
  const shown = shownPanels();
  shown.forEach(([name, canvas], i) => {
    const made = frame(canvas, part(), rangeOfAll(name), {title: withUnit(name), bottom: i === shown.length - 1});
    if (runs.length === 1) bands(made, runs[0], 0.16);
    levels(name).forEach((guard) => level(made, guard));
    moving(name).forEach((guard) => movingLevel(made, guard));
    runs.forEach((run, k) => {
      const [arcOf, times, ys] = clipped(run, run.arcOf, run.times, column(run, name));
      trace(made, arcOf, times, ys, looks()[k]);
      marks(made, run, arcOf, times, ys, looks()[k]);
      if (run.failed) ending(made, last(run.times), runs.length > 1 ? looks()[k].colour : palette.alarm);
    });
    kept.set(canvas, made);
  });
}

// A level at which a transition fires, with its name.
function level({context, box, y}, {value, label}) {
  const at = y(value);
  if (!(at > box.top && at < box.bottom)) return;
  context.strokeStyle = context.fillStyle = palette.faint;
  context.lineWidth = 1;
  context.setLineDash([2, 3]);
  context.beginPath(); context.moveTo(box.left, at); context.lineTo(box.right, at); context.stroke();
  context.setLineDash([]);
  const high = at < (box.top + box.bottom) / 2;
  context.textAlign = "right";
  context.textBaseline = high ? "bottom" : "top";
  context.fillText(fitted(context, label, (box.right - box.left) / 2), box.right - 3, at + (high ? -2 : 2));
}

// A level that moves, with its name at the last time at which it is known and shown.
function movingLevel(made, {times, values, label}) {
  const {context, box, x, y} = made, [, end] = part();
  trace(made, new Int32Array(times.length), times, values, {colour: palette.faint, dashes: [2, 3]});
  let k = countOf(times, end, true) - 1;
  while (k >= 0 && !Number.isFinite(values[k])) k--;
  if (k < 0 || !(x(times[k]) > box.left)) return;
  context.fillStyle = palette.faint;
  context.textAlign = "right";
  context.textBaseline = "top";
  context.fillText(fitted(context, label, x(times[k]) - box.left), x(times[k]) - 3, y(values[k]) + 2);
}

function ending({context, box, x}, t, colour) {
  if (x(t) < box.left || x(t) > box.right + 1) return;
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.beginPath(); context.moveTo(x(t), box.top); context.lineTo(x(t), box.bottom); context.stroke();
}

// Transitions: an open circle before, a full one after, where they are few.
function marks({context, box, x, y}, run, arcOf, xs, ys, {colour}) {
  const jumps = [];
  for (let i = 1; i < arcOf.length && jumps.length <= MOST_MARKED; i++)
    if (arcOf[i] !== arcOf[i - 1] && run.arcs[arcOf[i]].jump !== run.arcs[arcOf[i - 1]].jump) jumps.push(i);
  if (jumps.length > MOST_MARKED) return;
  context.strokeStyle = colour;
  context.lineWidth = 1.2;
  for (const i of jumps) for (const [k, fill] of [[i - 1, palette.ground], [i, colour]]) {
    const [a, b] = [x(xs[k]), y(ys[k])];
    if (!(a >= box.left - 1 && a <= box.right + 1 && b >= box.top - 1 && b <= box.bottom + 1)) continue;
    context.fillStyle = fill;
    context.beginPath(); context.arc(a, b, 2.5, 0, 2 * Math.PI); context.fill(); context.stroke();
  }
}

function drawPhases() {
  for (const {canvas, across, up} of phases) {
    const pick = (run, name) => name === "t" ? run.times : column(run, name);
    const made = frame(canvas, rangeOfAll(across.value), rangeOfAll(up.value),
      {title: `${withUnit(up.value)} over ${withUnit(across.value)}`});
    const points = runs.map((run) => [pick(run, across.value), pick(run, up.value)]);
    runs.forEach((run, k) => {
      const [arcOf, xs, ys] = clipped(run, run.arcOf, ...points[k]);
      trace(made, arcOf, xs, ys, looks()[k]);
      marks(made, run, arcOf, xs, ys, looks()[k]);
    });
    kept.set(canvas, {...made, points});
  }
}

// The cursor at a time; `at` is the point of each run, -1 where it has ended. Values of several runs are in the table.
function drawCursor(t, at) {
  const label = (...numbers) => runs.length > 1 ? "" : numbers.map((x) => format(x, 5)).join(", ");
  const line = ({context, box, x}) => {
    if (x(t) < box.left - 1 || x(t) > box.right + 1) return;
    context.strokeStyle = palette.focus;
    context.lineWidth = 1;
    context.beginPath(); context.moveTo(x(t), box.top); context.lineTo(x(t), box.bottom); context.stroke();
  };
  over($("ribbon"), line);
  for (const [name, canvas] of shownPanels()) over(canvas, (made) => {
    line(made);
    runs.forEach((run, k) => {
      if (at[k] < 0) return;
      const value = valueAt(run, column(run, name), t, at[k]);
      dot(made, made.x(t), made.y(value), label(value));
    });
  });
  for (const {canvas} of phases) over(canvas, (made) => made.points.forEach(([xs, ys], k) => {
    const [a, b] = [xs, ys].map((each) => valueAt(runs[k], each, t, at[k]));
    dot(made, made.x(a), made.y(b), label(a, b));
  }));
}

// The point of all runs nearest to a place in phase space, as the run and the number of the point.
function nearest({points, x, y}, a, b) {
  let best = [0, 0], least = Infinity;
  points.forEach(([xs, ys], k) => {
    const [start, end] = part();
    for (let i = countOf(runs[k].times, start); i < xs.length && runs[k].times[i] <= end; i++) {
      const distance = (x(xs[i]) - a) ** 2 + (y(ys[i]) - b) ** 2;
      if (distance < least) [best, least] = [[k, i], distance];
    }
  });
  return best;
}

function draw() {
  $("ribbon").style.height = `${ROW * Math.max(1, runs.length)}px`;
  readSizes();
  drawRibbon();
  drawLegend();
  drawPanels();
  drawPhases();
}

// Show a part of time; nothing for all of it. No part is shorter than the numbers can tell.
function zoomTo(start, end) {
  const [first, behind] = span();
  [start, end] = [Math.max(first, start ?? first), Math.min(behind, end ?? behind)];
  if (!(end - start > 1e-12 * (behind - first))) return;
  zoomed = start > first || end < behind ? [start, end] : null;
  for (const id of ["farther", "whole", "earlier", "later"]) $(id).disabled = zoomed === null;
}

function buildPanels(shown, redraw) {
  for (const name of model.columns) {
    const canvas = element("canvas"), plot = element("div", {className: "plot panel", hidden: !shown.includes(name)}, canvas);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${withUnit(name)} over time`);
    const box = element("input", {type: "checkbox", checked: !plot.hidden});
    box.addEventListener("change", () => { plot.hidden = !box.checked; redraw(); });
    $("shown").append(element("label", {}, box, ` ${name}`));
    $("panels").append(plot);
    panels.set(name, canvas);
  }
}

function buildPhase([first, second], redraw) {
  const names = ["t", ...model.columns];
  const choice = (chosen) => {
    const select = element("select", {}, ...names.map((name) => element("option", {value: name, textContent: name, selected: name === chosen})));
    select.addEventListener("change", redraw);
    return select;
  };
  const [across, up, canvas] = [choice(first), choice(second), element("canvas", {className: "phase"})];
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Phase space");
  const axes = element("p", {className: "axes"}, element("label", {}, "across ", across), " ", element("label", {}, "up ", up));
  $("phases").append(axes, element("div", {className: "plot"}, canvas));
  phases.push({canvas, across, up});
}

// A drag across a picture over time selects the part to show; a finger moves the cursor instead.
function buildZoom(canvas, redraw) {
  let from = null;
  const places = (event) => {
    const {box, across} = kept.get(canvas), t = ({offsetX: a}) => across[0] + (Math.min(box.right, Math.max(box.left, a)) - box.left) / (box.right - box.left) * (across[1] - across[0]);
    return [Math.min(from, t(event)), Math.max(from, t(event)), t(event)];
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "touch" || event.button || !kept.has(canvas)) return;
    [, , from] = places(event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (from === null) return;
    const [start, end] = places(event);
    over(canvas, ({context, box, x}) => {
      context.fillStyle = palette.focus;
      context.globalAlpha = 0.25;
      context.fillRect(x(start), box.top, x(end) - x(start), box.bottom - box.top);
    });
  });
  canvas.addEventListener("pointerup", (event) => {
    if (from === null) return;
    const [start, end] = places(event), {box, across} = kept.get(canvas);
    from = null;
    if (end - start > 4 / (box.right - box.left) * (across[1] - across[0])) zoomTo(start, end);
    redraw();
  });
  canvas.addEventListener("pointercancel", () => { from = null; });
  canvas.addEventListener("dblclick", () => { zoomTo(); redraw(); });
}

function buildZoomButtons(redraw) {
  const to = (scale, move) => {
    const [start, end] = part(), half = (end - start) / 2, middle = (start + end) / 2 + move * half;
    const [first, behind] = span(), inside = Math.min(behind - half, Math.max(first + half, middle));
    zoomTo((move ? inside : middle) - scale * half, (move ? inside : middle) + scale * half);
    redraw();
  };
  $("closer").addEventListener("click", () => to(0.5, 0));
  $("farther").addEventListener("click", () => to(2, 0));
  $("earlier").addEventListener("click", () => to(1, -1));
  $("later").addEventListener("click", () => to(1, 1));
  $("whole").addEventListener("click", () => { zoomTo(); redraw(); });
}

// `shown` are the columns that have a panel at first, `pairs` the phase plots, `point` is called with a place pointed at.
function buildPlots(shown, pairs, redraw, point) {
  buildPanels(shown, redraw);
  pairs.forEach((pair) => buildPhase(pair, redraw));
  const timed = [$("ribbon"), ...panels.values()];
  for (const canvas of [...timed, ...phases.map(({canvas: each}) => each)]) {
    const at = (event) => {
      const made = kept.get(canvas), {left, top} = canvas.getBoundingClientRect();
      if (made) point(canvas, made, event.clientX - left, event.clientY - top);
    };
    overlays.set(canvas, element("canvas", {className: "overlay"}));
    canvas.after(overlays.get(canvas));
    canvas.addEventListener("pointermove", at);
    canvas.addEventListener("pointerdown", at);
  }
  timed.forEach((canvas) => buildZoom(canvas, redraw));
  buildZoomButtons(redraw);
}

// Pictures of a run: the ribbon of modes, one panel for each state or output over time, phase space.
// The cursor has a canvas of its own over each.

const MOST_PANELS = 4, MOST_BANDS = 2000;
const panels = new Map(); // name: canvas
const kept = new Map(); // canvas: its frame
const overlays = new Map(); // canvas: the one over it

const column = (run, name) => run.columns[model.columns.indexOf(name)];

function over(canvas, draw) {
  const made = kept.get(canvas);
  if (made) draw({...made, ...canvasOf(overlays.get(canvas))});
}

function bands({context, box, x}, run, strength, top = box.top, bottom = box.bottom) {
  if (run.arcs.length > MOST_BANDS) return;
  for (const {start, end, mode, kind} of run.arcs) {
    context.globalAlpha = kind ? Math.min(1, 2 * strength) : strength;
    context.fillStyle = model.modes[mode].colour;
    const a = x(start), b = x(end);
    context.fillRect(a, top, Math.max(b - a, kind ? 0 : 0.5), bottom - top);
  }
  context.globalAlpha = 1;
}

const span = (run) => [0, run.times[run.times.length - 1] || 1];

function drawRibbon(run) {
  const canvas = $("ribbon"), {context, width, height} = canvasOf(canvas);
  const box = {left: 58, right: width - 8, top: 2, bottom: height - 2}, across = span(run);
  const x = (t) => box.left + t / across[1] * (box.right - box.left);
  bands({context, box, x}, run, 0.85);
  kept.set(canvas, {box, x, across});
  const seen = new Set(run.arcs.map((arc) => arc.mode));
  $("legend").replaceChildren(...model.modes.map((mode, i) => [mode, i]).filter(([, i]) => seen.has(i)).map(([mode]) => {
    const sample = element("span");
    sample.style.background = mode.colour;
    return element("li", {}, sample, mode.name);
  }));
}

const shownPanels = () => [...panels].filter(([, canvas]) => !canvas.parentElement.hidden);

function drawPanels(run) {
  const shown = shownPanels();
  shown.forEach(([name, canvas], i) => {
    const bottom = i === shown.length - 1, ys = column(run, name);
    const made = frame(canvas, span(run), rangeOf(ys), {title: withUnit(name), bottom});
    bands(made, run, 0.16);
    trace(made, run.arcOf, run.times, ys);
    kept.set(canvas, made);
  });
}

function drawPhase(run) {
  const canvas = $("phase"), [across, up] = [$("across").value, $("up").value];
  const pick = (name) => name === "t" ? run.times : column(run, name);
  const [xs, ys] = [pick(across), pick(up)];
  const made = frame(canvas, rangeOf(xs), rangeOf(ys), {title: `${withUnit(up)} over ${withUnit(across)}`});
  trace(made, run.arcOf, xs, ys);
  kept.set(canvas, {...made, xs, ys});
}

function drawCursor(run, i) {
  const t = run.times[i];
  const line = ({context, box, x}) => {
    context.strokeStyle = palette.focus;
    context.lineWidth = 1;
    context.beginPath(); context.moveTo(x(t), box.top); context.lineTo(x(t), box.bottom); context.stroke();
  };
  over($("ribbon"), line);
  for (const [name, canvas] of shownPanels()) over(canvas, (made) => {
    line(made);
    const value = column(run, name)[i];
    dot(made, made.x(t), made.y(value), format(value, 5));
  });
  over($("phase"), (made) => {
    const [a, b] = [made.xs[i], made.ys[i]];
    dot(made, made.x(a), made.y(b), `${format(a, 5)}, ${format(b, 5)}`);
  });
}

// The point of a run nearest to a place in phase space.
function nearest({xs, ys, x, y}, a, b) {
  let best = 0, least = Infinity;
  for (let i = 0; i < xs.length; i++) {
    const distance = (x(xs[i]) - a) ** 2 + (y(ys[i]) - b) ** 2;
    if (distance < least) [best, least] = [i, distance];
  }
  return best;
}

function buildPlots(redraw, point) {
  for (const name of model.columns) {
    const canvas = element("canvas"), plot = element("div", {className: "plot panel", hidden: panels.size >= MOST_PANELS}, canvas);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${withUnit(name)} over time`);
    const box = element("input", {type: "checkbox", checked: !plot.hidden});
    box.addEventListener("change", () => { plot.hidden = !box.checked; redraw(); });
    $("shown").append(element("label", {}, box, ` ${name}`));
    $("panels").append(plot);
    panels.set(name, canvas);
  }
  const names = ["t", ...model.columns];
  const [first = "t", second] = model.columns;
  for (const [select, chosen] of [[$("across"), second ? first : "t"], [$("up"), second ?? first]]) {
    select.append(...names.map((name) => element("option", {value: name, textContent: name, selected: name === chosen})));
    select.addEventListener("change", redraw);
  }
  for (const canvas of [$("ribbon"), $("phase"), ...panels.values()]) {
    const at = (event) => {
      const made = kept.get(canvas), {left, top} = canvas.getBoundingClientRect();
      if (made) point(canvas, made, event.clientX - left, event.clientY - top);
    };
    overlays.set(canvas, element("canvas", {className: "overlay"}));
    canvas.after(overlays.get(canvas));
    canvas.addEventListener("pointermove", at);
    canvas.addEventListener("pointerdown", at);
  }
}

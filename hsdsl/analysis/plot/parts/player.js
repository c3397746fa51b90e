// The time that is shown: moved by hand, by pointing at a picture, or by itself; values and pictures follow.

let cursor = 0, playing = null;
const followers = []; // called with (t, point of each run)

function redraw() {
  if (!runs.length) return;
  draw();
  show(cursor);
}

// The last point of each run that is not after a time; -1 where the run has ended before.
const pointsAt = (t) => runs.map((run) => t > last(run.times) ? -1 : Math.max(0, countOf(run.times, t, true) - 1));
const modeAt = (run, i) => i < 0 ? "ended" : modeOf(run.arcs[run.arcOf[i]].mode);

// Show the runs at a share of their time; `chosen` is a run and the number of its point.
function show(share, chosen) {
  const time = chosen ? runs[chosen[0]].times[chosen[1]] : share * span()[1], at = pointsAt(time);
  if (chosen) at[chosen[0]] = chosen[1];
  cursor = share;
  const modes = [...new Set(runs.map((run, k) => modeAt(run, at[k])))].join(", ");
  $("cursor").value = Math.round(1000 * share);
  $("now").textContent = `t = ${format(time, 5)}, ${modes}`;
  $("cursor").setAttribute("aria-valuetext", `t = ${format(time, 4)}, mode ${modes}`);
  followers.forEach((follow) => follow(time, at));
  drawCursor(time, at);
  showValues(time, at);
}

// A column at a time: between its points on a straight line, which is as dense as the curve that is drawn.
function valueAt(run, ys, t, i) {
  if (i < 0 || run.arcOf[i + 1] !== run.arcOf[i] || !(run.times[i + 1] > run.times[i]) || t <= run.times[i]) return ys[i];
  return ys[i] + (ys[i + 1] - ys[i]) * Math.min(1, (t - run.times[i]) / (run.times[i + 1] - run.times[i]));
}

function showValues(time, at) {
  const row = (name, ...cells) => element("tr", {}, element("th", {textContent: name, scope: "row"}), ...cells);
  const text = (textContent) => element("td", {textContent});
  const rows = model.columns.map((name) => row(withUnit(name), ...runs.map((run, k) => cell(valueAt(run, column(run, name), time, at[k])))));
  const heads = runs.length > 1 ? [row("run", ...runs.map((run) => text(run.label)))] : [];
  const modes = row("mode", ...runs.map((run, k) => text(modeAt(run, at[k]))));
  $("values").tBodies[0].replaceChildren(...heads, modes, row("t", cell(time)), ...rows);
}

function pointed(canvas, made, a, b) {
  if (!runs.length || playing !== null) return;
  if (made.points) {
    const [k, i] = nearest(made, a, b);
    show(runs[k].times[i] / span()[1], [k, i]);
  } else {
    const share = Math.min(1, Math.max(0, (a - made.box.left) / (made.box.right - made.box.left)));
    show((made.across[0] + share * (made.across[1] - made.across[0])) / span()[1]);
  }
}

// Played in real time where a run lasts 4 to 20 s, else within that.
const playTime = () => Math.min(20, Math.max(4, span()[1])) / Number($("speed").value);

function play(on) {
  playing = null;
  $("play").textContent = on ? "Pause" : "Play";
  $("play").setAttribute("aria-pressed", String(on));
  if (!on || !runs.length) return;
  if (cursor >= 1) cursor = 0;
  let before = performance.now();
  const step = (now) => {
    if (playing === null) return;
    show(Math.min(1, cursor + (now - before) / (1000 * playTime())));
    before = now;
    if (cursor < 1) playing = requestAnimationFrame(step); else play(false);
  };
  playing = requestAnimationFrame(step);
}

function buildPlayer() {
  $("speed").append(...[0.25, 0.5, 1, 2, 4].map((value) => element("option", {value, textContent: `${value}\u00d7`, selected: value === 1})));
  $("cursor").addEventListener("input", () => { if (runs.length) { play(false); show($("cursor").valueAsNumber / 1000); } });
  $("play").addEventListener("click", () => play(playing === null));
  window.addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readPalette(); redraw(); });
  readPalette();
}

// What a run says in words: why it ended, what it noted, its transitions; and why settings are refused.

const MOST_ROWS = 500;
const time = (t) => `t = ${format(t, 10)}`;
const edgeOf = (mode, k) => model.modes[mode]?.edges[k]?.name ?? "?";

function refusal({refusal: why, at}) {
  const parameter = model.controls[at]?.name, start = model.startStates[at], setting = model.settings[at];
  return [
    "", `parameter ${parameter} has no finite value with these parameters`,
    `parameter ${parameter} is below its minimum`, `parameter ${parameter} is above its maximum`,
    `initial.${start} has no finite value with these parameters`, `${setting} has no finite value with these parameters`,
    `${setting} must be positive`, `input ${model.inputs[at]} has a sample that is not finite`,
    `the sample times of input ${model.inputs[at]} do not increase`,
    "floor, sign, abs, min, max or atan2 of time switches too often in this run", "the memory of the page is full",
  ][why];
}

function stopped(run) {
  const {reason, failure, mode, edge, surface, time: t, most} = run, wall = model.modes[mode].walls[surface - model.modes[mode].edges.length];
  const ends = `the domain of mode ${modeOf(mode)} ends at ${wall}: at ${time(t)} the state`;
  const nothing = `in mode ${modeOf(mode)} an expression has no finite value at ${time(t)}`;
  const stuck = {
    "wall": `left_domain: ${ends} leaves it`,
    "not finite": `not_finite: ${nothing} or soon after`,
    "other": `step_underflow: in mode ${modeOf(mode)} no step from ${time(t)} is short enough; hsdsl run says more`,
  };
  const sentences = {
    "until": `until: reached ${time(t)}`,
    "until in strip": `until: reached ${time(t)} inside the strip of ${edgeOf(mode, edge)}, mode unchanged`,
    "until on guard": `until: reached ${time(t)} on the guard of ${edgeOf(mode, edge)}, mode unchanged`,
    "final": `final: entered final mode ${modeOf(mode)} at ${time(t)}`,
    "zeno": `zeno: at ${time(t)} transitions return to the same state in mode ${modeOf(mode)} without end`,
    "limit": `transition_limit: made ${most} transitions by ${time(t)}${most === 20000 ? "; a page makes no more" : ""}`,
    "waiting": `waiting_limit: by ${time(t)} more executions of an event wait than may`,
    "reset not finite": `not_finite: the reset of ${edgeOf(mode, edge)} has no finite value at ${time(t)}`,
    "here not finite": `not_finite: ${nothing}`,
    "step not finite": `not_finite: ${nothing}`,
    "entered outside": `left_domain: ${ends} was entered outside it`,
    "left": `left_domain: ${ends} leaves it`,
    "stuck": stuck[model.failures[failure]] ?? stuck.other,
    "interrupted": `interrupted at ${time(t)}: a run in a page may take 10 s and 256 MB`,
    "accumulated": `zeno: ${run.notes.length ? noted(run.notes[run.notes.length - 1]) : time(t)}`,
  };
  return sentences[model.reasons[reason]] ?? `${model.reasons[reason]} at ${time(t)}`;
}

function noted({kind, mode, surface, number, time: t, other}) {
  const edge = edgeOf(mode, surface);
  return {
    "crowded": `more than 16 transitions fall within the relaxation: from ${time(t)} on each waits in a strip`,
    "in contact": `${number ? "at rest on" : "motion along"} the guard of ${edge} from ${time(t)} to ${time(other)}`,
    "replaced": `Zeno at ${time(t)}: the limit of the transitions of ${edge} after number ${number} replaces them`,
    "accumulates": `the transitions of ${edge} accumulate at ${time(t)}, and no motion along its guard is known there`,
    "takes turn": `transitions, ${edge} the last of them, take turns and accumulate at ${time(t)}: no motion is known there`,
    "coupled": `several guards hold the state at ${time(t)}, among them that of ${edge}, and no single motion along them is known`,
    "unsettled": `no polynomial fits surface ${surface} of mode ${modeOf(mode)} to round-off at ${time(t)}`,
    "slides": `sliding at ${time(t)}: the flows of ${modeOf(mode)} and ${modeOf(number)} lead into each other`,
  }[model.notices[kind]];
}

function changes({mode, edge, target, before, after, resumed}) {
  if (Number.isNaN(resumed)) return "the run ended first";
  const from = model.modes[mode].states, to = model.modes[mode].edges[edge].states;
  const had = (name) => hasState(mode, from.indexOf(name)) ? before[from.indexOf(name)] : undefined;
  const texts = to.map((name, k) => [name, after[k], had(name)]).filter(([name, a, b], k) => a !== b && hasState(target, k) && model.columns.includes(name))
    .map(([name, a, b]) => `${name}: ${b === undefined ? "" : `${format(b)} \u2192 `}${format(a)}`);
  return texts.join(", ") || "unchanged";
}

function transitionRow(made, index) {
  const edge = model.modes[made.mode].edges[made.edge];
  const tied = made.alternatives.map((k) => edgeOf(made.mode, k)).join(", ");
  const name = element("td", {textContent: tied ? `${edge.name} (with ${tied})` : edge.name});
  if (tied) name.title = `reached together with ${tied}`;
  const to = element("td", {textContent: `${modeOf(made.mode)} \u2192 ${modeOf(made.target)}`});
  return element("tr", {}, element("td", {textContent: index}), cell(made.time), name, to, element("td", {textContent: changes(made)}));
}

function showFacts(run) {
  const tied = run.transitions.filter((made) => made.alternatives.length).length;
  const facts = [stopped(run), `${run.transitions.length} transitions, ${run.rows} rows, computed in ${run.milliseconds.toFixed(1)} ms`,
    ...run.notes.map(noted), ...tied ? [`${tied} transitions with other guards reached at the same instant`] : []];
  $("run").replaceChildren(...facts.map((textContent) => element("li", {textContent})));
  $("outcome").className = "";
  $("outcome").textContent = `${stopped(run)}, after ${run.transitions.length} transitions`;
  const left = run.transitions.length - MOST_ROWS;
  const rows = run.transitions.slice(0, MOST_ROWS).map(transitionRow);
  if (left > 0) rows.push(element("tr", {}, element("td", {colSpan: 5, textContent: `${left} more`})));
  $("transitions").tBodies[0].replaceChildren(...rows);
}

function showRefusal(result) {
  $("outcome").className = "alarm";
  $("outcome").textContent = `Refused: ${refusal(result)}. The pictures are those of the settings before.`;
}

function buildFacts() {
  const heads = ["", "t", "edge", "modes", "changes"].map((textContent) => element("th", {textContent, scope: "col"}));
  $("transitions").tHead.append(element("tr", {}, ...heads));
  $("verdict").textContent = `${model.verdict.theorem} (${model.exported})`;
  $("reasons").replaceChildren(...model.verdict.reasons.map((textContent) => element("li", {textContent})));
  $("about").replaceChildren(...model.about.map((textContent) => element("li", {textContent})));
}

function showWhoseVerdict(own) {
  $("verdict-title").textContent = own ? "Verdict of the exported settings" : "Verdict of the exported settings, not of these";
  for (const id of ["verdict", "reasons"]) $(id).classList.toggle("stale", !own);
}

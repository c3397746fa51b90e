// The worker of a page: the model as WebAssembly. It gets settings and answers with a run, as arrays of numbers.
"use strict";

const SECONDS = 10, SAMPLES = 8000, TRANSITIONS = 20000; // what a run on a page may take
const NAMES = ["at", "reason", "mode", "edge", "surface", "failure", "time", "points", "arcs", "transitions", "notes",
  "most", "until", "parametersAt", "startAt", "timesAt", "arcOfAt", "statesAt", "resultsAt", "arcAt", "rowTimesAt",
  "transitionAt", "beforeAt", "afterAt", "alternativesAt", "noteAt", "rows"]; // as in `show` in page.c
let model, wasm;

const doubles = (at, count) => new Float64Array(wasm.memory.buffer, at, count).slice();

// A table of structures: one mapping from field to number for each.
function table(at, count, {size, fields}) {
  const memory = new DataView(wasm.memory.buffer);
  const read = {i4: (k) => memory.getInt32(k, true), i8: (k) => Number(memory.getBigInt64(k, true)),
    f8: (k) => memory.getFloat64(k, true)};
  return Array.from({length: count}, (_, i) => Object.fromEntries(
    Object.entries(fields).map(([name, [offset, kind]]) => [name, read[kind](at + i * size + offset)])));
}

function read() {
  const numbers = new Float64Array(wasm.memory.buffer, wasm.view());
  const view = Object.fromEntries(NAMES.map((name, i) => [name, numbers[i]]));
  const parameters = [...doubles(view.parametersAt, model.parameters)], start = [...doubles(view.startAt, model.starts)];
  return {...view, parameters, start};
}

function columns(view) {
  const n = view.points, results = doubles(view.resultsAt, n * model.outputs);
  const states = Array.from({length: model.states}, (_, s) => doubles(view.statesAt + 8 * n * s, n));
  const outputs = Array.from({length: model.outputs}, (_, k) => {
    const column = new Float64Array(n);
    for (let i = 0; i < n; i++) column[i] = results[i * model.outputs + k];
    return column;
  });
  return [...states, ...outputs];
}

function transitions(view) {
  const alternatives = new Int32Array(wasm.memory.buffer, view.alternativesAt);
  let used = 0;
  return table(view.transitionAt, view.transitions, model.layouts.transition).map((made, i) => ({
    ...made,
    before: [...doubles(view.beforeAt + 8 * model.width * i, model.width)],
    after: [...doubles(view.afterAt + 8 * model.width * i, model.width)],
    alternatives: [...alternatives.slice(used, used += made.alternatives)],
  }));
}

function run(given) {
  const began = performance.now();
  new Float64Array(wasm.memory.buffer, wasm.given(), given.length + 3).set([...given, 1000 * SECONDS, SAMPLES, TRANSITIONS]);
  const refusal = wasm.run(), view = read();
  if (refusal) return {refusal, ...view};
  const rows = new Float64Array(wasm.memory.buffer, view.rowTimesAt, view.rows);
  const arcs = table(view.arcAt, view.arcs, model.layouts.arc).map(({first, jump, mode, kind}) => ({start: rows[first], jump, mode, kind}));
  arcs.forEach((arc, i) => { arc.end = i + 1 < arcs.length ? arcs[i + 1].start : rows[rows.length - 1]; });
  return {refusal, ...view, arcs, times: doubles(view.timesAt, view.points), arcOf: doubles(view.arcOfAt, view.points),
    columns: columns(view), transitions: transitions(view), notes: table(view.noteAt, view.notes, model.layouts.note),
    milliseconds: performance.now() - began};
}

onmessage = async ({data}) => {
  if (data.wasm) {
    model = data.model;
    const imports = {page: {now: () => performance.now()}};
    wasm = (await WebAssembly.instantiate(data.wasm, imports)).instance.exports;
    wasm._initialize();
    postMessage({ready: true});
    return;
  }
  const result = run(data.given);
  const large = result.refusal ? [] : [result.times, result.arcOf, ...result.columns];
  postMessage({...result, number: data.number}, large.map((array) => array.buffer));
};

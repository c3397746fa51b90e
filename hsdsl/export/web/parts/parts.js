// Systems of parts: the compiled code has one mode, and the number of each part's mode among its states. A run is shown
// by its product modes, which are numbered as they are visited.

const whole = model.modes.length, products = new Map();

function productOf(mode, state) {
  const {names, modes, numbers, owners, owned, colours} = model.parts;
  const at = numbers.map((place) => place < 0 ? 0 : Math.round(state[place]) - 1);
  const name = names.map((part, k) => `${part}=${modes[k][at[k]]}`).join(" "), key = `${mode} ${name}`;
  if (!products.has(key)) {
    const has = owners.map((part, s) => part >= 0 && owned[s][at[part]] === "1");
    products.set(key, model.modes.length);
    model.modes.push({...model.modes[mode], name, has, colour: colours[(model.modes.length - whole) % colours.length]});
  }
  return products.get(key);
}

// Whether a mode has the state in a place.
const hasState = (mode, place) => model.modes[mode].has?.[place] ?? true;

function withProducts(run) {
  for (const made of run.transitions) made.target = model.modes[made.mode].edges[made.edge].target;
  const seen = (columns) => columns.filter((_, s) => !model.unseen.includes(s));
  if (!model.parts) return {...run, columns: seen(run.columns)};
  const {owners} = model.parts, firsts = run.arcs.map((_, k) => run.arcOf.indexOf(k));
  const at = (point) => owners.map((_, s) => run.columns[s][point]);
  const arcs = run.arcs.map((arc, k) => ({...arc, mode: productOf(arc.mode, at(firsts[k]))}));
  run.columns.slice(0, owners.length).forEach((column, s) => {
    for (let i = 0; i < column.length; i++) if (!hasState(arcs[run.arcOf[i]].mode, s)) column[i] = NaN;
  });
  for (const made of run.transitions) {
    made.target = made.after.some(Number.isNaN) ? undefined : productOf(made.target, made.after);
    made.mode = productOf(made.mode, made.before);
  }
  const modeOn = (t) => arcs.findLast((arc) => arc.start <= t)?.mode ?? arcs[0].mode;
  const notes = run.notes.map((note) => ({...note, mode: modeOn(note.time)}));
  return {...run, arcs, notes, mode: last(arcs).mode, columns: seen(run.columns)};
}

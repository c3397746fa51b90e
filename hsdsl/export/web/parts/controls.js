// Sliders with number boxes. A value that is set goes before the model's own expression, and is part of the link.

const values = new Map(); // name: number, of what is set
const rows = new Map();
const changed = [];

function setValue(control, value) {
  if (control.fixed || !Number.isFinite(value)) return;
  values.set(control.name, value);
  changed.forEach((listener) => listener());
}

function unset(control) {
  if (values.delete(control.name)) changed.forEach((listener) => listener());
}

function label(control) {
  const name = control.group === "initial" ? control.name.slice(8) : control.name;
  return control.unit ? `${name} [${control.unit}]` : name;
}

function addControl(control, place) {
  const id = `control-${place}`;
  const number = element("input", {type: "number", step: "any", id, name: control.name});
  const slider = element("input", {type: "range", step: "any", min: control.low, max: control.high});
  slider.setAttribute("aria-label", `${label(control)}, slider`);
  const again = element("button", {type: "button", className: "again", textContent: "\u21ba", title: "Reset"});
  again.setAttribute("aria-label", `Reset ${label(control)}`);
  const title = element("label", {htmlFor: id, textContent: label(control), title: control.about});
  const row = element("div", {className: "control"}, title, number, again, slider);
  if (control.fixed) number.disabled = slider.disabled = true;
  slider.addEventListener("input", () => setValue(control, slider.valueAsNumber));
  number.addEventListener("input", () => setValue(control, number.valueAsNumber));
  number.addEventListener("blur", () => showControl(control));
  again.addEventListener("click", () => { unset(control); number.focus(); });
  rows.set(control.name, {row, number, slider, shown: control.value});
  return row;
}

function showControl(control, computed) {
  const row = rows.get(control.name);
  if (control.hidden) return;
  if (computed !== undefined) row.shown = computed;
  const value = values.get(control.name) ?? row.shown;
  row.row.classList.toggle("set", values.has(control.name));
  if (document.activeElement !== row.number) row.number.value = String(value);
  row.slider.min = Math.min(control.low, value);
  row.slider.max = Math.max(control.high, value);
  row.slider.value = String(value);
}

// What the compiled code is given: not-a-number for what the model's own expression gives.
function given() {
  return model.controls.map(({name, given, value}) => values.get(name) ?? (given ? value : NaN));
}

function link() {
  return [...values].map(([name, value]) => `${encodeURIComponent(name)}=${value}`).join("&");
}

function readLink() {
  values.clear();
  for (const part of location.hash.slice(1).split("&")) {
    const [name, text] = part.split("=").map(decoded);
    const control = model.controls.find((each) => each.name === name);
    const value = text && text.trim() ? Number(text) : NaN;
    if (control && !control.fixed && Number.isFinite(value)) values.set(name, value);
  }
}

function decoded(text) {
  try { return decodeURIComponent(text); } catch { return ""; }
}

function buildControls() {
  const groups = [["parameters", "Parameters"], ["initial", "Initial state"]];
  for (const [group, title] of groups) {
    const own = model.controls.map((control, i) => [control, i]).filter(([control]) => control.group === group && !control.hidden);
    if (own.length) $("controls").append(element("h2", {textContent: title}), ...own.map((pair) => addControl(...pair)));
  }
  const fixed = model.controls.filter((control) => control.fixed && !control.hidden).map((control) => control.name);
  $("notes-on-settings").textContent = fixed.length ? `Fixed in a page: ${fixed.join(", ")}. They decide when an input ` +
    "switches, or how errors are controlled; export again with --set to change them." : "";
  $("notes-on-settings").className = "faint";
  $("reset").addEventListener("click", () => { values.clear(); changed.forEach((listener) => listener()); });
}

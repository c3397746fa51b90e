"use strict";
// Elements, numbers as text, and the model. Texts of a model become text nodes only.

const model = JSON.parse(document.getElementById("model").textContent);
const $ = (id) => document.getElementById(id);

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

function format(x, digits = 7) {
  if (Number.isNaN(x) || x === undefined) return "\u2013";
  const text = Number(x.toPrecision(digits));
  const size = Math.abs(text);
  return size !== 0 && (size < 1e-4 || size >= 1e7) ? text.toExponential().replace("e+", "e") : String(text);
}

// A number with all of its digits where it is looked for: in a title, and in data-value.
function cell(x) {
  const made = element("td", {textContent: format(x), title: String(x)});
  made.dataset.value = x;
  return made;
}

const modeOf = (k) => model.modes[k]?.name ?? "?";
const withUnit = (name) => model.units[name] ? `${name} [${model.units[name]}]` : name;
const palette = {}; // the colours of the style sheet

function readPalette() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "text", "faint", "line", "curve", "focus", "ground", "alarm", ...Array.from({length: 7}, (_, k) => `run-${k}`)]) palette[name] = style.getPropertyValue(`--${name}`).trim();
}

// Canvases with axes: their size in device pixels, ranges, round numbers on scales, curves without what is not a number.

const sizes = new Map(); // of canvases, read all at once: each reading has the browser lay out the page

function readSizes() {
  for (const canvas of document.querySelectorAll("canvas")) {
    const {width, height} = canvas.getBoundingClientRect();
    sizes.set(canvas, [width, height]);
  }
}

// A canvas emptied for drawing.
function canvasOf(canvas) {
  const ratio = window.devicePixelRatio || 1, [width, height] = sizes.get(canvas);
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  return {context, width, height};
}

// The range of numbers, a little wider than they are.
function rangeOf(...arrays) {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) for (const x of array) if (Number.isFinite(x)) { if (x < low) low = x; if (x > high) high = x; }
  if (low > high) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  const room = high - low > 1e-12 * size ? 0.06 * (high - low) : 0.1 * size || 1; // a range of round-off is none
  return [low - room, high + room];
}

function ticks([low, high], most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((each) => each >= raw) ?? raw;
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high && found.length < 50; k++) found.push(k * step);
  return found.map((x) => [x, format(Number(x.toPrecision(12)))]);
}

// A frame: where numbers are on a canvas, with its axes drawn.
function frame(canvas, across, up, {title = "", bottom = true, left = 58} = {}) {
  const {context, width, height} = canvasOf(canvas);
  const box = {left, right: width - 8, top: title ? 18 : 6, bottom: height - (bottom ? 18 : 6)};
  const x = (value) => box.left + (value - across[0]) / (across[1] - across[0]) * (box.right - box.left);
  const y = (value) => box.bottom - (value - up[0]) / (up[1] - up[0]) * (box.bottom - box.top);
  context.strokeStyle = palette.line;
  context.fillStyle = palette.faint;
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const [value, text] of ticks(up, Math.max(4, (box.bottom - box.top) / 34))) {
    context.beginPath(); context.moveTo(box.left, y(value)); context.lineTo(box.right, y(value)); context.stroke();
    context.fillText(text, box.left - 5, y(value));
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const [value, text] of bottom ? ticks(across, Math.max(2, (box.right - box.left) / 80)) : [])
    context.fillText(text, Math.min(x(value), width - context.measureText(text).width / 2), box.bottom + 5);
  if (title) {
    context.fillStyle = palette.text;
    context.textAlign = "left";
    context.fillText(title, box.left, 2);
  }
  return {context, box, x, y, across, up};
}

// A curve through the points of a run; it is cut where an arc ends, or a number is none.
function trace({context, box, x, y}, arcOf, xs, ys, {colour, dashes}) {
  context.save();
  context.beginPath();
  context.rect(box.left, box.top - 1, box.right - box.left, box.bottom - box.top + 2);
  context.clip();
  context.strokeStyle = colour;
  context.lineWidth = 1.4;
  context.setLineDash(dashes);
  context.lineJoin = "round";
  context.beginPath();
  let arc = -1;
  for (let i = 0; i < xs.length; i++) {
    const a = x(xs[i]), b = y(ys[i]);
    if (!Number.isFinite(a) || !Number.isFinite(b)) { arc = -1; continue; }
    if (arcOf[i] === arc) context.lineTo(a, b); else context.moveTo(a, b);
    arc = arcOf[i];
  }
  context.stroke();
  context.restore();
}

// A text that is cut where it would be wider.
function fitted(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let letters = text.length;
  while (letters > 1 && context.measureText(`${text.slice(0, letters)}\u2026`).width > width) letters--;
  return `${text.slice(0, letters)}\u2026`;
}

// A dot with a text, on the side where there is room.
function dot({context, box}, a, b, text) {
  if (!Number.isFinite(a) || !Number.isFinite(b)) return;
  context.fillStyle = palette.focus;
  context.beginPath(); context.arc(a, b, 4, 0, 2 * Math.PI); context.fill();
  const [right, high] = [a > (box.left + box.right) / 2, b < (box.top + box.bottom) / 2];
  context.textAlign = right ? "right" : "left";
  context.textBaseline = high ? "top" : "bottom";
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = palette.ground;
  context.fillStyle = palette.text;
  const place = [a + (right ? -8 : 8), b + (high ? 3 : -3)];
  context.strokeText(text, ...place);
  context.fillText(text, ...place);
}

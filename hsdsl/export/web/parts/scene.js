// The scene at a time: shapes whose numbers are the last columns of a run.

const COILS = 8;
let whole; // the box that all of the run's shapes are in

function numbersOf(run, i, next, share) {
  const first = model.columns.length, found = [];
  for (let k = first; k < run.columns.length; k++) {
    const a = run.columns[k][i], b = run.columns[k][next];
    found.push(Number.isFinite(b) ? a + share * (b - a) : a);
  }
  return found;
}

function shapesOf(numbers) {
  let at = 0;
  return model.scene.map(({kind, points, numbers: count}) => {
    const own = numbers.slice(at, at += count);
    const where = Array.from({length: points}, (_, k) => [own[2 * k], own[2 * k + 1]]);
    return {kind, points: where, sizes: own.slice(2 * points), whole: own.every(Number.isFinite)};
  });
}

function reach({kind, points, sizes}) {
  const [x, y] = points[0], [a, b] = sizes;
  if (kind === "view") return [[x - a / 2, y - b / 2], [x + a / 2, y + b / 2]];
  const half = kind === "circle" ? Math.abs(a) : kind === "box" ? Math.hypot(a, b) / 2 : 0;
  return half ? [[x - half, y - half], [x + half, y + half]] : points;
}

// The box of all shapes at all times; of a long run at a thousand of them.
function measureScene(run) {
  const step = Math.max(1, Math.floor(run.times.length / 1000)), corners = [];
  for (let i = 0; i < run.times.length; i += step)
    for (const shape of shapesOf(numbersOf(run, i, i, 0))) if (shape.whole && shape.kind !== "view") corners.push(...reach(shape));
  whole = [rangeOf(corners.map(([x]) => x)), rangeOf(corners.map(([, y]) => y))];
}

function spring(context, [[x, y], [u, v]], width) {
  const length = Math.hypot(u - x, v - y) || 1, [a, b] = [(u - x) / length, (v - y) / length];
  context.moveTo(x, y);
  for (let k = 0; k <= 2 * COILS; k++) {
    const s = (0.12 + 0.76 * k / (2 * COILS)) * length, side = k === 0 || k === 2 * COILS ? 0 : k % 2 ? width : -width;
    context.lineTo(x + a * s - b * side, y + b * s + a * side);
  }
  context.lineTo(u, v);
}

function drawShape(context, {kind, points, sizes}, place, scale) {
  const at = points.map(place);
  context.beginPath();
  if (kind === "point") context.arc(...at[0], 4, 0, 2 * Math.PI);
  if (kind === "circle") context.arc(...at[0], Math.abs(sizes[0]) * scale, 0, 2 * Math.PI);
  if (kind === "line") at.forEach(([x, y], k) => k ? context.lineTo(x, y) : context.moveTo(x, y));
  if (kind === "spring") spring(context, at, Math.min(8, 0.06 * Math.hypot(at[1][0] - at[0][0], at[1][1] - at[0][1]) + 3));
  if (kind === "box") {
    const [width, height, angle] = sizes, [c, s] = [Math.cos(angle), Math.sin(angle)];
    [[-1, -1], [1, -1], [1, 1], [-1, 1]].forEach(([p, q], k) => {
      const [x, y] = [p * width / 2, q * height / 2];
      const corner = place([points[0][0] + c * x - s * y, points[0][1] + s * x + c * y]);
      if (k) context.lineTo(...corner); else context.moveTo(...corner);
    });
    context.closePath();
  }
  context.globalAlpha = 0.35;
  if (kind === "circle" || kind === "box") context.fill();
  context.globalAlpha = 1;
  if (kind === "point") context.fill(); else context.stroke();
}

// `share` is how far the time is from the point to the next one of the same arc.
function drawScene(run, i, share = 0) {
  if (!model.scene.length) return;
  const {context, width, height} = canvasOf($("scene")), next = run.arcOf[i + 1] === run.arcOf[i] ? i + 1 : i;
  const shapes = shapesOf(numbersOf(run, i, next, share)).filter(shape => shape.whole);
  const view = shapes.filter(({kind, sizes: [a, b]}) => kind === "view" && a > 0 && b > 0).pop();
  const [[left, low], [right, high]] = view ? reach(view) : [[whole[0][0], whole[1][0]], [whole[0][1], whole[1][1]]];
  const scale = Math.min((width - 16) / (right - left), (height - 16) / (high - low));
  const middle = [(left + right) / 2, (low + high) / 2];
  const place = ([x, y]) => [width / 2 + (x - middle[0]) * scale, height / 2 - (y - middle[1]) * scale];
  context.strokeStyle = palette.ink;
  context.fillStyle = palette.curve;
  context.lineWidth = 2;
  context.lineJoin = "round";
  for (const shape of shapes) if (shape.kind !== "view") drawShape(context, shape, place, scale);
}

// Axes and curves on a canvas, in the colours of the style sheet and as sharp as the screen.

/** Colours and fonts of the page as they are now. */
export function theme() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return {
    ink: of("--ink"),
    quiet: of("--quiet"),
    line: of("--line"),
    grid: of("--grid"),
    ground: of("--curve-ground"),
    accent: of("--accent"),
    series: [1, 2, 3, 4, 5, 6, 7, 8].map((i) => of(`--series-${i}`)),
    isDark: matchMedia("(prefers-color-scheme: dark)").matches,
    font: style.fontFamily,
  };
}

const FONT_SIZE = 12;
const MARGIN = { left: 46, right: 12, top: 8, bottom: 36 };

/** Round numbers between two, about as many as asked for. */
export function ticks([low, high], wanted) {
  const raw = (high - low) / Math.max(1, wanted);
  const size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * size).find((s) => s >= raw) ?? raw;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: last - first + 1 }, (_, i) => {
    const value = (first + i) * step;
    return { value, label: Math.abs(value) >= 1e5 ? value.toExponential(0) : value.toFixed(decimals) };
  });
}

/** A canvas with the size that it has on the screen. */
export function surface(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/**
 * Draws axes and returns what places data in them. Limits are pairs; `log` has powers of ten up the side; `square` keeps
 * both axes in one scale.
 */
export function axes(canvas, { x, y, xLabel, yLabel, log = false, square = false, xTicks, yTicks }) {
  const { context, width, height } = surface(canvas);
  const colours = theme();
  let { left, right, top, bottom } = MARGIN;
  if (square) {
    const unit = Math.min((width - left - right) / (x[1] - x[0]), (height - top - bottom) / (y[1] - y[0]));
    const spare = width - left - right - unit * (x[1] - x[0]);
    left += spare / 2;
    right += spare / 2;
    const spareHeight = height - top - bottom - unit * (y[1] - y[0]);
    top += spareHeight / 2;
    bottom += spareHeight / 2;
  }
  const [w, h] = [width - left - right, height - top - bottom];
  const scale = (value) => (log ? Math.log10(value) : value);
  const [low, high] = [scale(y[0]), scale(y[1])];
  const px = (value) => left + (w * (value - x[0])) / (x[1] - x[0]);
  const py = (value) => top + h - (h * (scale(value) - low)) / (high - low);
  context.font = `${FONT_SIZE}px ${colours.font}`;
  context.lineWidth = 1;
  context.fillStyle = colours.quiet;
  const rows = yTicks ?? (log ? powers(y) : ticks(y, Math.min(6, h / 38)));
  const columns = xTicks ?? ticks(x, Math.min(8, w / 56));
  context.strokeStyle = colours.grid;
  context.beginPath();
  rows.forEach(({ value }) => line(context, left, py(value), left + w, py(value)));
  columns.forEach(({ value }) => line(context, px(value), top, px(value), top + h));
  context.stroke();
  context.textAlign = "right";
  context.textBaseline = "middle";
  rows.forEach(({ value, label }) => context.fillText(label, left - 6, py(value)));
  context.textAlign = "center";
  context.textBaseline = "top";
  columns.forEach(({ value, label }) => context.fillText(label, px(value), top + h + 5));
  if (xLabel) context.fillText(xLabel, left + w / 2, top + h + 20);
  if (yLabel) {
    context.save();
    context.translate(left - 40, top + h / 2);
    context.rotate(-Math.PI / 2);
    context.fillText(yLabel, 0, 0);
    context.restore();
  }
  context.strokeStyle = colours.line;
  context.strokeRect(left, top, w, h);
  return { context, colours, px, py, left, top, width: w, height: h };
}

function powers([low, high]) {
  const first = Math.ceil(Math.log10(low) - 1e-9);
  const last = Math.floor(Math.log10(high) + 1e-9);
  const every = Math.max(1, Math.ceil((last - first) / 5));
  const all = [];
  for (let power = last; power >= first; power -= every) {
    const value = 10 ** power;
    all.push({ value, label: power >= -3 ? String(+value.toPrecision(1)) : `1e${power}` });
  }
  return all;
}

function line(context, x0, y0, x1, y1) {
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
}

/** Draws within the axes alone. */
export function within({ context, left, top, width, height }, draw) {
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  draw();
  context.restore();
}

/** A curve of the values from `offset` on; a gap where one is missing. */
export function curve({ context, px, py }, xs, values, offset = 0) {
  let isDown = false;
  context.beginPath();
  for (let i = 0; i < xs.length; i++) {
    const value = values[offset + i];
    if (Number.isNaN(value)) {
      isDown = false;
      continue;
    }
    if (isDown) context.lineTo(px(xs[i]), py(value));
    else context.moveTo(px(xs[i]), py(value));
    isDown = true;
  }
  context.stroke();
}

/** The least and the largest of many numbers, without the missing ones. */
export function extent(...arrays) {
  let [low, high] = [Infinity, -Infinity];
  for (const array of arrays) {
    for (const value of array) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}

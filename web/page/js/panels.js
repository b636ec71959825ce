// The plots of the page, one function each: what they show is said in their captions too.

import { axes, curve, extent, surface, theme, within } from "./plot.js";

const WAVELENGTH = "wavelength (nm)";

const label = (kind) => (kind === "illuminant" ? "relative power" : "reflectance");

/** Limits for spectra: from 0, and to 1 for reflectances that stay below it. */
function limits(kind, [, high], low = 0) {
  if (kind === "reflectance") return [Math.min(0, low), Math.max(1, high * 1.02)];
  return [Math.min(0, low), high * 1.06 || 1];
}

/** A colour that shows on the ground of the page: no darker than that, or no lighter. */
function shown(colours, rgb) {
  const scale = colours.isDark ? Math.max(1, 125 / Math.max(1, ...rgb)) : 0.78;
  return `rgb(${Array.from(rgb, (v) => Math.round(v * scale)).join(" ")})`;
}

function colourOf(colours, bytes, index) {
  return bytes.length > 3 * index ? shown(colours, bytes.subarray(3 * index, 3 * index + 3)) : colours.quiet;
}

/** Spectra as they were measured. */
export function dataPanel(canvas, data) {
  const all = extent(...data.tables.map((table) => table.values));
  const x = [data.first_nm, data.last_nm];
  const frame = axes(canvas, { x, y: limits(data.kind, all, all[0]), xLabel: WAVELENGTH, yLabel: label(data.kind) });
  frame.context.lineWidth = 1;
  frame.context.globalAlpha = 0.55;
  within(frame, () => {
    for (const { values, colours, wavelengths } of data.tables) {
      for (let i = 0; i * wavelengths.length < values.length; i++) {
        frame.context.strokeStyle = colourOf(frame.colours, colours, i);
        curve(frame, wavelengths, values, i * wavelengths.length);
      }
    }
  });
  frame.context.globalAlpha = 1;
}

/** The mean, and a standard deviation of the model around it. */
export function meanPanel(canvas, { wavelengths, mean, deviation, kind }) {
  const low = mean.map((m, i) => m - deviation[i]);
  const high = mean.map((m, i) => m + deviation[i]);
  const all = extent(low, high);
  const y = kind === "reflectance" ? [Math.min(0, all[0]), Math.min(1, Math.max(all[1] * 1.1, 0.2))] : limits(kind, all, all[0]);
  const frame = axes(canvas, { x: ends(wavelengths), y, xLabel: WAVELENGTH, yLabel: label(kind) });
  const { context, colours, px, py } = frame;
  within(frame, () => {
    context.beginPath();
    wavelengths.forEach((nm, i) => context.lineTo(px(nm), py(high[i])));
    [...wavelengths].reverse().forEach((nm, i) => context.lineTo(px(nm), py(low[low.length - 1 - i])));
    context.fillStyle = colours.series[0];
    context.globalAlpha = 0.2;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = colours.series[0];
    context.lineWidth = 2.2;
    curve(frame, wavelengths, mean);
  });
}

const ends = (wavelengths) => [wavelengths[0], wavelengths[wavelengths.length - 1]];

const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [4, 2], [1, 2], [10, 2], [6, 2, 1, 2, 1, 2]];

/** The basis vectors, each with its number at its end and a dash of its own. */
export function basisPanel(canvas, { wavelengths, basis }) {
  const some = basis.slice(0, 8);
  const size = 1.08 * Math.max(...some.flat().map(Math.abs));
  const frame = axes(canvas, { x: ends(wavelengths), y: [-size, size], xLabel: WAVELENGTH, yLabel: "unit length" });
  const { context, colours, px, py } = frame;
  context.strokeStyle = colours.quiet;
  context.beginPath();
  context.moveTo(px(wavelengths[0]), py(0));
  context.lineTo(px(wavelengths[wavelengths.length - 1]), py(0));
  context.stroke();
  some.forEach((row, i) => {
    context.strokeStyle = colours.series[i];
    context.lineWidth = i === 0 ? 2.4 : 1.6;
    context.setLineDash(DASHES[i]);
    within(frame, () => curve(frame, wavelengths, row));
    context.setLineDash([]);
    // Where a vector is largest nobody else is likely to be.
    const at = row.reduce((best, value, band) => (Math.abs(value) > Math.abs(row[best]) ? band : best), 0);
    mark(frame, px(wavelengths[at]), py(row[at]), String(i + 1), colours.series[i]);
  });
}

function mark({ context, colours }, x, y, text, colour) {
  context.beginPath();
  context.arc(x, y, 8, 0, 2 * Math.PI);
  context.fillStyle = colours.ground;
  context.fill();
  context.lineWidth = 1.4;
  context.strokeStyle = colour;
  context.stroke();
  context.fillStyle = colours.ink;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(text, x, y + 0.5);
}

/** Shares of variance that are left, in percent, by the number of components. */
export function left(explained) {
  let sum = 0;
  return explained.map((share) => Math.max(1e-7, 100 * (1 - (sum += share))));
}

/** The variance that is left unexplained by each number of components; that of the model is filled. */
export function leftPanel(canvas, { all_explained: all, basis }) {
  const rest = left(all);
  const k = basis.length;
  const least = Math.min(...rest);
  const y = [10 ** Math.floor(Math.log10(least / 1.5)), 100];
  const every = all.length > 8 ? 2 : 1;
  const xTicks = rest.map((_, i) => ({ value: i + 1, label: (i + 1) % every ? "" : String(i + 1) }));
  const frame = axes(canvas, { x: [0.4, all.length + 0.6], y, log: true, xLabel: "components k", yLabel: "left (%)", xTicks });
  const { context, colours, px, py } = frame;
  context.strokeStyle = colours.quiet;
  context.lineWidth = 1.4;
  curve(frame, rest.map((_, i) => i + 1), rest);
  rest.forEach((value, i) => {
    context.beginPath();
    context.arc(px(i + 1), py(value), i + 1 === k ? 6 : 3.5, 0, 2 * Math.PI);
    context.fillStyle = i < k ? colours.accent : colours.ground;
    context.fill();
    context.strokeStyle = colours.accent;
    context.stroke();
  });
}

/** The first draws as curves, each in its colour. */
export function curvesPanel(canvas, { draws, model }) {
  const { wavelengths, kind } = model;
  const y = limits(kind, extent(draws.spectra));
  const frame = axes(canvas, { x: ends(wavelengths), y, xLabel: WAVELENGTH, yLabel: label(kind) });
  const { context, colours } = frame;
  context.lineWidth = 1.25;
  within(frame, () => {
    for (let i = 0; i * wavelengths.length < draws.spectra.length; i++) {
      context.strokeStyle = colourOf(colours, draws.colours, i);
      curve(frame, wavelengths, draws.spectra, i * wavelengths.length);
    }
  });
}

/** Columns of chips that fill a block of this aspect without a gap, and are about square. */
function columnsOf(count, aspect) {
  const misfit = (columns) => Math.abs(Math.log((columns * columns) / (count * aspect)));
  const full = Array.from({ length: count }, (_, i) => i + 1).filter((columns) => count % columns === 0);
  return full.reduce((best, columns) => (misfit(columns) < misfit(best) ? columns : best), 1);
}

/** The same draws as chips, as they look under the illuminant. */
export function chipsPanel(canvas, { draws }) {
  const { context, width, height } = surface(canvas);
  const count = draws.colours.length / 3;
  if (count === 0) {
    context.fillStyle = theme().quiet;
    context.font = `14px ${theme().font}`;
    context.fillText("These wavelengths have no light that the eye sees.", 8, 24);
    return;
  }
  const columns = columnsOf(count, width / height);
  const [w, h] = [width / columns, height / Math.ceil(count / columns)];
  for (let i = 0; i < count; i++) {
    const [r, g, b] = draws.colours.subarray(3 * i, 3 * i + 3);
    context.fillStyle = `rgb(${r} ${g} ${b})`;
    const [x, y] = [(i % columns) * w, Math.floor(i / columns) * h];
    context.beginPath();
    context.roundRect(x + 1, y + 1, w - 2, h - 2, 2.5);
    context.fill();
  }
}

/** Chromaticities of draws and data, in the part of the diagram that they take up. */
export function chromaticityPanel(canvas, { draws, model, locus }) {
  const colours = theme();
  const points = [draws.chromaticity, model.chromaticities];
  let [x, y] = [
    [0, 0.75],
    [0, 0.85],
  ];
  if (model.kind === "illuminant" && points.some((p) => p.length > 0)) {
    // Daylights lie close together.
    const even = extent(...points.map((p) => p.filter((_, i) => i % 2 === 0)));
    const odd = extent(...points.map((p) => p.filter((_, i) => i % 2 === 1)));
    const room = Math.max(even[1] - even[0], odd[1] - odd[0], 0.04) * 0.62;
    const [cx, cy] = [(even[0] + even[1]) / 2, (odd[0] + odd[1]) / 2];
    x = [Math.max(0, cx - room), Math.min(0.75, cx + room)];
    y = [Math.max(0, cy - room), Math.min(0.85, cy + room)];
  }
  const frame = axes(canvas, { x, y, xLabel: "x", yLabel: "y", square: true });
  const { context, px, py } = frame;
  within(frame, () => {
    context.beginPath();
    for (let i = 0; i + 1 < locus.length - 2; i += 2) context.lineTo(px(locus[i]), py(locus[i + 1]));
    context.closePath();
    context.strokeStyle = colours.quiet;
    context.lineWidth = 1.2;
    context.stroke();
    const data = model.chromaticities;
    const every = Math.max(1, Math.ceil(data.length / 2 / 700));
    context.strokeStyle = colours.ink;
    context.globalAlpha = 0.5;
    context.lineWidth = 1;
    context.beginPath();
    for (let i = 0; i < data.length; i += 2 * every) {
      const [cx, cy] = [px(data[i]), py(data[i + 1])];
      context.moveTo(cx - 2.5, cy - 2.5);
      context.lineTo(cx + 2.5, cy + 2.5);
      context.moveTo(cx - 2.5, cy + 2.5);
      context.lineTo(cx + 2.5, cy - 2.5);
    }
    context.stroke();
    context.globalAlpha = 0.5;
    context.fillStyle = colours.accent;
    const some = draws.chromaticity;
    for (let i = 0; i < some.length; i += 2) context.fillRect(px(some[i]) - 1.1, py(some[i + 1]) - 1.1, 2.2, 2.2);
    context.globalAlpha = 1;
    const white = locus.length - 2;
    context.strokeStyle = colours.series[1];
    context.lineWidth = 2;
    context.beginPath();
    context.arc(px(locus[white]), py(locus[white + 1]), 5, 0, 2 * Math.PI);
    context.stroke();
  });
  context.fillStyle = colours.ink;
  context.textAlign = "left";
  context.textBaseline = "middle";
  const white = locus.length - 2;
  context.strokeStyle = colours.ground;
  context.lineWidth = 3;
  context.lineJoin = "round";
  const at = [px(locus[white]) + 8, py(locus[white + 1]) - 10];
  context.strokeText("D65", ...at);
  context.fillText("D65", ...at);
}

/** Metamers as curves, in the colour that they share. */
export function metamerCurvesPanel(canvas, { metamers, model }) {
  const { wavelengths, kind } = model;
  const frame = axes(canvas, { x: ends(wavelengths), y: limits(kind, extent(metamers.spectra)), xLabel: WAVELENGTH, yLabel: label(kind) });
  const { context, colours } = frame;
  context.strokeStyle = colourOf(colours, metamers.lights[0].colours, 0);
  context.globalAlpha = 0.8;
  within(frame, () => {
    for (let i = 0; i * wavelengths.length < metamers.spectra.length; i++) {
      curve(frame, wavelengths, metamers.spectra, i * wavelengths.length);
    }
  });
  context.globalAlpha = 1;
}

/** The colours of metamers under each light, a block each: where they part, a block is not of one colour. */
export function metamerChipsPanel(canvas, { metamers }) {
  const { context, width, height } = surface(canvas);
  const { ink, font } = theme();
  const { lights } = metamers;
  const [gap, top] = [10, 20];
  const block = (width - gap * (lights.length - 1)) / lights.length;
  context.font = `13px ${font}`;
  context.textBaseline = "top";
  lights.forEach(({ name, colours }, number) => {
    const left = number * (block + gap);
    context.fillStyle = ink;
    context.fillText(name, left, 0);
    const count = colours.length / 3;
    const columns = columnsOf(count, block / (height - top));
    const [w, h] = [block / columns, (height - top) / Math.ceil(count / columns)];
    for (let i = 0; i < count; i++) {
      context.fillStyle = `rgb(${colours.subarray(3 * i, 3 * i + 3).join(" ")})`;
      const [x, y] = [left + (i % columns) * w, top + Math.floor(i / columns) * h];
      // Without seams, so that what is of one colour is seen as one.
      context.fillRect(x - 0.25, y - 0.25, w + 0.5, h + 0.5);
    }
  });
}

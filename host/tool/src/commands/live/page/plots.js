// Plots of the last seconds, and of the line of the last train.

import { digits } from "./text.js";

/** Seconds that are shown. */
const SPAN = 20;

/**
 * What is drawn where: units per SI unit, the least span of the axis, above which noise does not fill the
 * plot, and the colour.
 */
const QUANTITIES = {
  deformation_m: {
    plot: "deformation-plot", axis: "deformation, µm", per: 1e6, span: 10, colour: "--blue", side: 3,
  },
  force_n: { plot: "deformation-plot", axis: "force, N", per: 1, span: 0.1, colour: "--orange", side: 1 },
  frequency_hz: {
    plot: "frequency-plot", axis: "frequency, MHz", per: 1e-6, span: 0.001, colour: "--blue", side: 3,
  },
  current_a: { plot: "current-plot", axis: "current, A", per: 1, span: 1, colour: "--orange", side: 3 },
};
/** A second series of a quantity has another colour. */
const FURTHER = ["--green", "--red", "--amber", "--quiet"];

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const size = (element) => ({ width: element.clientWidth, height: element.clientHeight });

/** Ends of an axis: those of the values with some room, and not closer than a least span. */
function range(span) {
  return (_, least, greatest) => {
    if (least == null) return [0, span];
    const room = Math.max(0.05 * (greatest - least), 0.5 * (span - (greatest - least)));
    return [least - room, greatest + room];
  };
}

/** Numbers at an axis, all with the same decimals. */
function numbers(_, splits, __, ___, step) {
  let decimals = 0;
  while (decimals < 9 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6) decimals++;
  return splits.map((value) => value.toFixed(decimals));
}

function axis(label, of, scale, side) {
  return {
    label, scale, side,
    stroke: colour(of),
    grid: { stroke: colour("--grid"), width: 1, show: side !== 1 },
    ticks: { stroke: colour("--grid"), width: 1 },
    values: numbers,
    labelSize: 20,
    size: side === 2 ? 32 : 64,
    font: "12px system-ui", labelFont: "12px system-ui",
  };
}

/** Before time zero there is nothing. */
function timeAxis() {
  const values = (_, splits) => splits.map((time) => (time < 0 ? "" : String(time)));
  return { ...axis("time, s", "--quiet", "x", 2), incrs: [5], values };
}

/** A plot that is made again when its place or the colours of the page change. */
class Plot {
  #element;
  #plot;
  #make;

  constructor(id, make) {
    this.#element = document.getElementById(id);
    this.#make = make;
    new ResizeObserver(() => this.#plot?.setSize(this.#size())).observe(this.#element);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.remake());
  }

  #size() {
    const legend = this.#element.querySelector(".u-legend")?.offsetHeight ?? 0;
    const { width, height } = size(this.#element);
    return { width, height: height - legend };
  }

  /** Makes it anew. */
  remake() {
    this.#plot?.destroy();
    this.#plot = null;
    const made = this.#make();
    if (!made) return;
    const options = { ...size(this.#element), cursor: { show: false }, ...made.options };
    this.#plot = new uPlot(options, made.data, this.#element);
    this.#plot.setSize(this.#size());
  }

  /** Shows data of the same series. */
  setData(data) {
    this.#plot?.setData(data);
  }
}

/** A quantity of a converter's channel over time. */
class Column {
  constructor({ quantity, sensor, channel }, length) {
    this.quantity = quantity;
    this.place = `${sensor}.${channel}`;
    this.values = new Array(length).fill(null);
  }
}

/** The quantities over the last seconds. */
export class TimePlots {
  #times = [];
  #columns = new Map();
  #plots = new Map();
  #isDrawing = false;

  constructor() {
    for (const { plot } of Object.values(QUANTITIES)) {
      if (!this.#plots.has(plot)) this.#plots.set(plot, new Plot(plot, () => this.#options(plot)));
    }
  }

  /** The line does not go on from here. */
  interrupt() {
    if (this.#times.length === 0) return;
    this.#times.push(this.#times.at(-1));
    for (const { values } of this.#columns.values()) values.push(null);
  }

  /** Adds a batch. Time that goes back is that of a tool that was started again. */
  add({ time_s, columns }) {
    if (time_s[0] < this.#times.at(-1)) this.#clear();
    const before = this.#times.length;
    this.#times.push(...time_s);
    for (const column of columns) {
      const key = `${column.quantity} ${column.sensor} ${column.channel}`;
      if (!this.#columns.has(key)) this.#begin(key, new Column(column, before));
      const of = this.#columns.get(key);
      for (const value of column.values) {
        of.values.push(value == null ? null : value * QUANTITIES[column.quantity].per);
      }
    }
    for (const { values } of this.#columns.values()) {
      while (values.length < this.#times.length) values.push(null);
    }
    this.#forget();
    this.#draw();
  }

  #clear() {
    this.#times.length = 0;
    for (const { values } of this.#columns.values()) values.length = 0;
  }

  #begin(key, column) {
    this.#columns.set(key, column);
    this.#plots.get(QUANTITIES[column.quantity].plot).remake();
  }

  /** Drops what has left the plots. */
  #forget() {
    const from = this.#times.at(-1) - SPAN;
    const gone = this.#times.findIndex((time) => time >= from);
    if (gone <= 0) return;
    this.#times.splice(0, gone);
    for (const { values } of this.#columns.values()) values.splice(0, gone);
  }

  /** Draws with the browser's next picture. */
  #draw() {
    if (this.#isDrawing) return;
    this.#isDrawing = true;
    requestAnimationFrame(() => {
      this.#isDrawing = false;
      for (const [id, plot] of this.#plots) plot.setData(this.#data(id));
    });
  }

  #of(id) {
    return [...this.#columns.values()].filter(({ quantity }) => QUANTITIES[quantity].plot === id);
  }

  #data(id) {
    return [this.#times, ...this.#of(id).map(({ values }) => values)];
  }

  #options(id) {
    const columns = this.#of(id);
    if (columns.length === 0) return null;
    const shown = Object.entries(QUANTITIES).filter(([, { plot }]) => plot === id);
    const series = columns.map(({ quantity, place }, index) => {
      const { axis: label, colour: own } = QUANTITIES[quantity];
      const alike = columns.slice(0, index).filter((other) => other.quantity === quantity).length;
      return {
        label: `${label} ${place}`,
        scale: quantity,
        stroke: colour(alike ? FURTHER[(alike - 1) % FURTHER.length] : own),
        width: 1.5,
        // What goes by the right axis is often proportional to the rest, and would cover it.
        dash: QUANTITIES[quantity].side === 1 ? [6, 6] : null,
        points: { show: false },
      };
    });
    return {
      data: this.#data(id),
      options: {
        legend: { show: columns.length > shown.length, live: false },
        scales: {
          x: { time: false, range: (_, least, greatest) => [greatest - SPAN, greatest] },
          ...Object.fromEntries(shown.map(([quantity, { span }]) => [quantity, { range: range(span) }])),
        },
        axes: [timeAxis(),
          ...shown.map(([quantity, of]) => axis(of.axis, of.colour, quantity, of.side))],
        series: [{}, ...series],
      },
    };
  }
}

/** 1/x against the actuated layer's compliance. */
export class LinePlot {
  #line = null;
  #plot = new Plot("line-plot", () => this.#line && this.#options());

  show(line) {
    this.#line = line;
    this.#plot.remake();
    const board = `${digits(line.board_load_ratio, 3)} ± ${digits(2 * line.board_standard_error, 2)}`;
    document.getElementById("line-text").textContent =
      `Measurement ${line.measurement}: c_S/c_L is ${digits(line.load_ratio, 3)} by this line, ` +
      `${board} by the board` + (line.every > 1 ? `. Drawn: one sample of ${line.every}.` : ".");
  }

  #options() {
    const { points } = this.#line;
    return {
      data: [
        points.map((point) => point.compliance),
        points.map((point) => point.inverse_per_m * 1e-3),
        points.map((point) => point.line_per_m * 1e-3),
      ],
      options: {
        legend: { show: false },
        scales: { x: { time: false } },
        axes: [
          axis("c_S/c_D(I), attraction included", "--quiet", "x", 2),
          axis("1/x without drift, 1/mm", "--quiet", "y", 3),
        ],
        series: [
          {},
          {
            paths: () => null,
            points: { show: true, size: 4, fill: colour("--blue"), width: 0 },
          },
          { stroke: colour("--orange"), width: 2, points: { show: false } },
        ],
      },
    };
  }
}

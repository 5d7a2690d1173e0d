// The dialogue of a calibration. It shows how far the tool is; closing it changes nothing.

import { percent, stiffness } from "./text.js";

const button = document.getElementById("calibrate");
const dialog = document.getElementById("calibration");
const fields = (name) => dialog.querySelectorAll(`[data-field="${name}"]`);

export class Calibration {
  #send;
  #phase = "";
  #shown = "";

  constructor(send) {
    this.#send = send;
    button.addEventListener("click", () => this.#open());
    for (const of of dialog.querySelectorAll("[data-action]")) {
      of.addEventListener("click", () => this.#act(of.dataset.action));
    }
  }

  #act(action) {
    const requests = {
      start: "calibrate",
      abort: "abort_calibration",
      keep: "keep_calibration",
      dismiss: "close_calibration",
    };
    if (action in requests) this.#send(requests[action]);
    if (action === "close" || action === "dismiss") dialog.close();
  }

  #open() {
    if (!dialog.open) dialog.showModal();
    this.#focus();
  }

  show(calibration) {
    const shown = JSON.stringify(calibration);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const hasEnded = this.#phase === "running" && calibration.phase !== "running";
    const isOther = this.#phase !== calibration.phase;
    this.#phase = calibration.phase;
    this.#fill(calibration);
    button.textContent = { running: "Calibration…", found: "Calibration result…" }[this.#phase] ?? "Calibrate…";
    if (hasEnded) this.#open();
    else if (isOther && dialog.open) this.#focus();
  }

  #fill({ phase, reason, run, runs, pressed, figures }) {
    for (const part of dialog.querySelectorAll("[data-phase]")) part.hidden = part.dataset.phase !== phase;
    const set = (name, text) => fields(name).forEach((field) => { field.textContent = text; });
    if (reason) set("reason", reason.replace(/\.$/, phase === "failed" ? "" : "."));
    if (runs) set("runs", runs);
    if (run) {
      set("step", `Run ${run} of ${runs}: ${pressed}.`);
      for (const bar of fields("progress")) [bar.max, bar.value] = [runs, run - 1];
    }
    if (figures) {
      set("kept", `Calibration ${figures.calibration_id} is active and stored.`);
      fields("figures").forEach((table) => table.replaceChildren(...rows(figures)));
    }
  }

  /** The part that shows has the focus: its first button. */
  #focus() {
    dialog.querySelector("[data-phase]:not([hidden]) button")?.focus();
  }
}

function rows(figures) {
  const lines = [
    ["Actuated layer", stiffness(figures.actuated_n_per_m)],
    ["for a sensing layer of", stiffness(figures.sensing_n_per_m)],
    [`Stiffer at ${figures.peak_current_a.toFixed(1)} A by`, percent(figures.rise)],
    ["Attraction then", `${(1e3 * figures.attraction_n).toFixed(0)} mN`],
    [
      `Uncertainty of c_L of ${figures.loads.join(", ")} c_S`,
      figures.uncertainty.map(percent).join(", "),
    ],
    ["Made at", `${figures.calibrated_at_c.toFixed(1)} °C`],
    ["Runs", String(figures.runs)],
  ];
  return lines.map(([name, text]) => {
    const [row, head, cell] = ["tr", "th", "td"].map((tag) => document.createElement(tag));
    head.scope = "row";
    head.textContent = name;
    cell.textContent = text;
    row.append(head, cell);
    return row;
  });
}

// The last stiffness, and the list of all measurements.

import { at, say } from "./elements.js";
import { age, digits, stiffness } from "./text.js";

const NUMBERS = ["stiffness_n_per_m", "standard_error_n_per_m", "lower_n_per_m", "upper_n_per_m", "force_n"];

/** The stiffness of an estimate. */
function value({ stiffness_n_per_m }) {
  return stiffness_n_per_m == null ? "Rigid" : stiffness(stiffness_n_per_m);
}

/** The ends of its interval, N/mm. */
function interval({ lower_n_per_m, upper_n_per_m }) {
  const lower = digits(lower_n_per_m * 1e-3, 3);
  return upper_n_per_m == null ? `at least ${lower}` : `${lower} to ${digits(upper_n_per_m * 1e-3, 3)}`;
}

/** A field of CSV. */
function field(text) {
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** All measurements as CSV, the oldest first. A number that there is none of is empty. */
function csv(measurements) {
  const rows = measurements.map(({ time_ms, number, outcome: { estimate, refusal } }) => [
    new Date(time_ms).toISOString(), number, ...NUMBERS.map((name) => estimate?.[name] ?? ""), refusal ?? "",
  ]);
  const lines = [["time_utc", "measurement", ...NUMBERS, "refusal"], ...rows];
  return lines.map((line) => `${line.map((of) => field(String(of))).join(",")}\n`).join("");
}

export class Measurements {
  #measurements = [];

  constructor() {
    at("save").addEventListener("click", () => this.#save());
  }

  /** Takes the list, the oldest first. */
  take(measurements) {
    this.#measurements = measurements;
    at("measurements").replaceChildren(...measurements.map((of) => this.#row(of)).reverse());
    at("measurements-list").hidden = measurements.length === 0;
    at("no-measurements").hidden = measurements.length > 0;
    at("save").ariaDisabled = String(measurements.length === 0);
  }

  /** Shows the last stiffness, and what was refused since, at a time. */
  show(now_ms) {
    const last = this.#measurements.at(-1);
    const estimated = this.#measurements.findLast(({ outcome }) => outcome.estimate);
    const refusal = last?.outcome.refusal;
    const details = [];
    if (estimated) {
      const { number, time_ms, limited_by, relaxation, modulus_text, outcome: { estimate } } = estimated;
      say(at("stiffness"), value(estimate));
      say(at("interval"), estimate.upper_n_per_m == null
        ? `at least ${stiffness(estimate.lower_n_per_m)} (95\u00a0%)`
        : `between ${digits(estimate.lower_n_per_m * 1e-3, 3)} and ${stiffness(estimate.upper_n_per_m)} (95\u00a0%)`);
      say(at("modulus"), modulus_text.join("; "));
      say(at("limited-by"), [limited_by, relaxation].filter(Boolean).join(" "));
      details.push(`Measurement ${number}, at ${estimate.force_n.toFixed(2)} N, ${age(now_ms - time_ms)}`);
    } else {
      say(at("modulus"), "");
      say(at("limited-by"), "");
      say(at("stiffness"), "–");
      say(at("interval"), last ? "No stiffness yet." : "Nothing is measured yet.");
    }
    say(at("refusal"), refusal ? `Measurement ${last.number} refused: ${refusal}` : "");
    if (refusal) details.push(`${estimated ? "refused" : "Refused"} ${age(now_ms - last.time_ms)}`);
    say(at("result-details"), details.join("; "));
  }

  #row({ time_ms, outcome: { estimate, refusal } }) {
    const row = document.createElement("tr");
    row.insertCell().textContent = new Date(time_ms).toTimeString().slice(0, 8);
    if (estimate) {
      row.insertCell().textContent = value(estimate);
      row.insertCell().textContent = interval(estimate);
    } else {
      const cell = row.insertCell();
      cell.colSpan = 2;
      cell.textContent = `Refused: ${refusal}`;
    }
    return row;
  }

  #save() {
    if (this.#measurements.length === 0) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csv(this.#measurements)], { type: "text/csv" }));
    link.download = "palpate-measurements.csv";
    link.click();
    URL.revokeObjectURL(link.href);
  }
}

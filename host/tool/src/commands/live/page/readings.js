// Numbers, states, faults and the buttons beside them.

import { at, say } from "./elements.js";
import { percent, plain, uncertain, words } from "./text.js";

export class Readings {
  #send;
  #armed = false;
  #skipped = 0;
  #answered = null;
  #faults = "";
  #values = new Map();

  constructor(send) {
    this.#send = send;
    this.#button("arm", () => send(this.#armed ? "disarm" : "arm"));
    this.#button("stop", () => send("abort"));
    this.#button("restart", () => send("restart"));
  }

  #button(id, act) {
    at(id).addEventListener("click", (event) => {
      if (event.currentTarget.ariaDisabled !== "true") act();
    });
  }

  /** Whether the tool answers. */
  connect(isConnected) {
    if (isConnected) return;
    this.#date(false);
    say(at("connection"),
      "No connection to palpate live. Start it again; this page tries every second.", "bad");
    this.#allow([]);
  }

  /** Batches of samples that this page did not take in time. */
  skip(count) {
    this.#skipped += count;
  }

  show(state) {
    const { known } = state;
    const isRunning = state.calibration.phase === "running";
    if (known.gone) say(at("connection"), known.gone, "bad");
    else if (isRunning) say(at("connection"), "Calibration under way", "wait");
    else say(at("connection"), "Connected", "good");
    this.#date(!known.gone && !isRunning);
    this.#allow(known.gone ? [] : isRunning ? ["stop"] : ["arm", "stop", "restart"]);
    say(at("board"), `${known.board}${state.title}`);
    document.title = known.gone ? "palpate: no board" : "palpate";
    this.#armed = known.armed;
    say(at("arm"), known.armed ? "Disarm" : "Arm");
    say(at("state"), `${known.armed ? "Armed" : "Not armed"}. ${state.doing ?? ""}`);
    this.#list(state);
    this.#showFaults(state.faults);
    this.#losses(known);
    this.#answer(state.answer);
  }

  /** Whether the readings are those of this moment; dimmed if they are not. */
  #date(isCurrent) {
    document.body.classList.toggle("stale", !isCurrent);
  }

  /** Buttons that can be pressed. One that cannot keeps the focus. */
  #allow(ids) {
    for (const id of ["arm", "stop", "restart"]) at(id).ariaDisabled = String(!ids.includes(id));
  }

  /** All numbers with their names. */
  #list({ known, contact }) {
    const rows = [];
    for (const sample of known.samples.filter(Boolean)) {
      const several = known.samples[1] || sample.channels.length > 1;
      for (const channel of sample.channels) {
        const place = several ? ` ${sample.sensor}.${channel.channel}` : "";
        const beyond = channel.extrapolated ? ", beyond the curve" : "";
        rows.push([`Deformation${place}`,
          uncertain(channel.deformation_m, channel.deformation_sigma_m, "µm", 1e-6, 2) + beyond]);
        rows.push([`Frequency${place}`, `${(channel.frequency_hz * 1e-6).toFixed(6)} MHz`]);
      }
      rows.push(["Force", uncertain(sample.force_n, sample.force_sigma_n, "N", 1, 3)]);
      rows.push(["Coil current", plain(sample.current_a, "A", 2)]);
    }
    rows.push(["Contact", contact ?? "not known yet"]);
    if (known.status) {
      rows.push(["Coil temperature", plain(known.status.temperature_c, "°C", 1)]);
      rows.push(["Coil supply", plain(known.status.supply_v, "V", 1)]);
      const load = known.status.processor_load;
      rows.push(["Processor", load == null ? "not measured" : percent(load)]);
    }
    this.#fill(rows);
  }

  /** Elements stay as long as their names do. */
  #fill(rows) {
    if (rows.length !== this.#values.size || rows.some(([name]) => !this.#values.has(name))) {
      at("readings").replaceChildren();
      this.#values.clear();
      for (const [name] of rows) {
        const [term, value] = [document.createElement("dt"), document.createElement("dd")];
        term.textContent = name;
        at("readings").append(term, value);
        this.#values.set(name, value);
      }
    }
    for (const [name, text] of rows) say(this.#values.get(name), text);
  }

  #showFaults(faults) {
    const shown = JSON.stringify(faults);
    if (shown === this.#faults) return;
    this.#faults = shown;
    const none = document.createElement("p");
    none.textContent = "None.";
    at("faults").replaceChildren(...(faults.length ? faults.map((fault) => this.#fault(fault)) : [none]));
  }

  #fault({ number, name, meaning, location, value, limit }) {
    const [box, title, text, found] = ["div", "h3", "p", "p"].map((tag) => document.createElement(tag));
    const clear = document.createElement("button");
    box.className = "fault";
    title.textContent = `${number} ${words(name)}`;
    text.textContent = meaning;
    const numbers = [["value", value], ["limit", limit]].filter(([, number]) => number != null);
    found.className = "quiet";
    found.textContent = [`At: ${words(location)}`,
      ...numbers.map(([what, number]) => `${what} ${Number(number.toPrecision(6))}`)].join(", ");
    clear.type = "button";
    clear.ariaLabel = `Clear fault ${number}`;
    clear.textContent = "Clear";
    clear.addEventListener("click", () => this.#send({ clear_fault: name }));
    box.append(title, text, found, clear);
    return box;
  }

  #losses(known) {
    const { status } = known;
    const parts = [`${known.missing} of ${known.received + known.missing} records`];
    if (known.damaged) parts.push(`${known.damaged} damaged frames`);
    if (status) parts.push(`${status.conversions_lost + status.second_conversions_lost} conversions`);
    if (this.#skipped) parts.push(`${this.#skipped} batches of samples that this page did not take in time`);
    say(at("losses"), `${parts.join(", ")} lost.`);
  }

  #answer({ number, text, is_refusal }) {
    if (number === this.#answered) return;
    this.#answered = number;
    say(at("answer"), text, is_refusal ? "bad" : "good");
  }
}

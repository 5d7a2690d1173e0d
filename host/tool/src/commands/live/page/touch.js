// Touches on an array of coils: place with its 95 % ellipse over the coils, force and radius.

import { at, say } from "./elements.js";
import { uncertain, words } from "./text.js";

const SVG = "http://www.w3.org/2000/svg";
/** How long an ellipse stays, s. */
const STAYS_S = 2;
/** Root of the 95 % quantile of chi-square with two degrees of freedom, -2 ln 0.05. */
const QUANTILE = 2.447747;
/** Lengths of the map are millimetres. */
const MM = 1e3;

/** An element of the map; y points up. */
function drawn(name, kind, attributes) {
  const element = document.createElementNS(SVG, name);
  element.setAttribute("class", kind);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

/** The ellipse of a claimed place. */
function region({ x_m, y_m, x_sigma_m, y_sigma_m, correlation }) {
  const [xx, yy, xy] = [x_sigma_m ** 2, y_sigma_m ** 2, correlation * x_sigma_m * y_sigma_m];
  const [mean, half] = [(xx + yy) / 2, (xx - yy) / 2];
  const axis = (variance) => MM * QUANTILE * Math.sqrt(Math.max(variance, 0));
  const difference = Math.hypot(half, xy);
  const [x, y, degrees] = [MM * x_m, -MM * y_m, -90 / Math.PI * Math.atan2(xy, half)];
  return drawn("ellipse", "region", {
    cx: x, cy: y, rx: axis(mean + difference), ry: axis(mean - difference), transform: `rotate(${degrees} ${x} ${y})`,
  });
}

/** Place, force and radius with their uncertainties, or why there are none. */
function text(touch) {
  const { x_m, y_m, x_sigma_m, y_sigma_m, force_n, force_uncertainty, radius_m, radius_uncertainty } = touch;
  if (x_m == null) return words(touch.verdict);
  const place = [["x", x_m, x_sigma_m], ["y", y_m, y_sigma_m]]
    .map(([name, value, sigma]) => `${name} ${uncertain(value, sigma, "mm", 1e-3, 2)}`);
  const radius = radius_m == null
    ? "radius not determined"
    : `radius ${uncertain(radius_m, radius_m * radius_uncertainty, "mm", 1e-3, 2)}`;
  return [...place, uncertain(force_n, force_n * force_uncertainty, "N", 1, 3), radius].join(", ");
}

export class TouchMap {
  #array = "";
  #last = null;
  #regions = [];

  show({ known, array }) {
    const { touch, time_s } = known;
    at("touch").hidden = !touch;
    if (!touch) return;
    this.#draw(array);
    say(at("touch-text"), text(touch));
    const shown = JSON.stringify(touch);
    if (touch.x_m != null && shown !== this.#last) {
      const element = region(touch);
      at("touch-map").append(element);
      this.#regions.push({ time_s, element });
    }
    this.#last = shown;
    const goes = ({ time_s: since_s }) => since_s > time_s || since_s < time_s - STAYS_S;
    this.#regions.filter(goes).forEach(({ element }) => element.remove());
    this.#regions = this.#regions.filter((of) => !goes(of));
  }

  /** Coils and disc; without an array, 10 mm to each side. */
  #draw(array) {
    const shown = JSON.stringify(array ?? null);
    if (shown === this.#array) return;
    this.#array = shown;
    const { coils_m, centre_m, reach_m } = array ?? { coils_m: [], centre_m: [0, 0], reach_m: 0.01 };
    const far = Math.max(...[...coils_m, centre_m].flat().map(Math.abs), reach_m) * MM * 1.2;
    at("touch-map").setAttribute("viewBox", `${-far} ${-far} ${2 * far} ${2 * far}`);
    const circle = (kind, [x, y], r) => drawn("circle", kind, { cx: MM * x, cy: -MM * y, r });
    at("touch-map").replaceChildren(
      circle("disc", centre_m, MM * reach_m),
      ...coils_m.map((coil) => circle("coil", coil, far / 25)),
    );
    this.#regions = [];
  }
}

// Numbers and units in words.

/** A number with so many significant digits, four decimals at most. */
export function digits(value, count) {
  if (value === 0) return "0";
  const whole = Math.floor(Math.log10(Math.abs(value))) + 1;
  return value.toFixed(Math.min(Math.max(count - whole, 0), 4));
}

/** A stiffness in N/mm. */
export function stiffness(nPerM) {
  return `${digits(nPerM * 1e-3, 3)} N/mm`;
}

/** A value with two standard uncertainties, in a unit that is so much of the SI unit. */
export function uncertain(value, sigma, unit, scale, places) {
  if (value == null) return "not calibrated";
  const number = (value / scale).toFixed(places);
  return sigma == null ? `${number} ${unit}` : `${number} ± ${(2 * sigma / scale).toFixed(places)} ${unit}`;
}

/** A value, or that it is not measured. */
export function plain(value, unit, places) {
  return value == null ? "not measured" : `${value.toFixed(places)} ${unit}`;
}

/** How long something is ago, ms. */
export function age(ms) {
  const s = Math.max(0, ms) * 1e-3;
  if (s < 120) return `${s.toFixed(0)} s ago`;
  return s < 7200 ? `${(s / 60).toFixed(0)} min ago` : `${(s / 3600).toFixed(0)} h ago`;
}

/** A part as per cent. */
export function percent(part) {
  return `${digits(100 * part, 2)} %`;
}

/** A number that the protocol has a name for, as words. */
export function words(name) {
  return String(name).replaceAll("_", " ");
}

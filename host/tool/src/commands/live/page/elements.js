// Elements of the page.

export const at = (id) => document.getElementById(id);

/** Sets a text only where it differs: a screen reader says what is set. */
export function say(element, text, level) {
  if (element.textContent !== text) element.textContent = text;
  if (level) element.dataset.level = level;
}

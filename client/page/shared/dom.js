/** Finding, creating and updating elements. */

const SVG = 'http://www.w3.org/2000/svg';

/**
 * @template {HTMLElement} T
 * @param {string} id
 * @returns {T}
 */
export function element(id) {
  return /** @type {T} */ (document.getElementById(id));
}

/**
 * @template {keyof HTMLElementTagNameMap} Name
 * @param {Name} name
 * @param {Partial<HTMLElementTagNameMap[Name]>} [properties]
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[Name]}
 */
export function make(name, properties = {}, ...children) {
  const created = Object.assign(document.createElement(name), properties);
  created.append(...children);
  return created;
}

/**
 * @param {string} name
 * @param {Record<string, string | number>} [attributes]
 */
export function svg(name, attributes = {}) {
  const created = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) created.setAttribute(key, String(value));
  return created;
}

/**
 * Set an element's text if it differs: a screen reader reads a live region again whenever its text is set.
 *
 * @param {Element} target
 * @param {string} text
 */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/**
 * Set what an element contains without touching what stays in its place: it keeps the focus and what is typed.
 *
 * @param {Element} target
 * @param {Element[]} children
 */
export function setChildren(target, children) {
  const wanted = new Set(children);
  for (const child of [...target.children]) if (!wanted.has(child)) child.remove();
  children.forEach((child, at) => {
    if (target.children[at] !== child) target.insertBefore(child, target.children[at] ?? null);
  });
}

/**
 * Make a button do nothing while its work goes on. Disabled, it would lose the keyboard's focus.
 *
 * @param {HTMLButtonElement} button
 * @param {() => Promise<void>} work
 */
export function onClick(button, work) {
  button.addEventListener('click', async () => {
    if (button.getAttribute('aria-disabled') === 'true') return;
    button.setAttribute('aria-disabled', 'true');
    await work().finally(() => button.removeAttribute('aria-disabled'));
  });
}

/**
 * Set the lines of a list, without touching those that stay.
 *
 * @param {Element} list
 * @param {string[]} lines
 */
export function setLines(list, lines) {
  while (list.children.length > lines.length) list.lastChild?.remove();
  lines.forEach((line, at) => setText(list.children[at] ?? list.appendChild(make('li')), line));
}

// Small helpers around the DOM. Text from data goes in as text nodes only.
type Child = Node | string | number | null | undefined | false;
type Attributes = Record<string, string | number | boolean | ((event: never) => void) | undefined>;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  apply(element, attributes, children);
  return element;
}

export function svg(tag: string, attributes: Attributes = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  apply(element, attributes, children);
  return element;
}

function apply(element: Element, attributes: Attributes, children: Child[]): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === false) continue;
    if (typeof value === 'function') {
      element.addEventListener(name.slice(2), value as unknown as EventListener);
    } else {
      element.setAttribute(name, value === true ? '' : String(value));
    }
  }
  for (const child of children) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
}

export const byId = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

/** Up to `digits` significant digits, with thin thousands; "–" for nothing. */
export function format(value: number | undefined | null, digits = 3): string {
  if (value === undefined || value === null || !Number.isFinite(value)) return '–';
  if (Number.isInteger(value)) return value.toLocaleString('en-US').replace(/,/g, '\u202f');
  if (Math.abs(value) >= 10 ** digits) return format(Math.round(value), digits);
  return String(Number(value.toPrecision(digits)));
}

export const percent = (value: number | undefined | null, digits = 1): string =>
  value === undefined || value === null || !Number.isFinite(value)
    ? '–' : `${(100 * value).toFixed(digits)}\u202f%`;

/** A group of buttons of which one is pressed; arrow keys move, as in a radio group. */
export function choice<T extends string>(
  label: string, options: {value: T; text: string; title?: string}[], value: T,
  changed: (value: T) => void,
): {element: HTMLElement; set: (value: T) => void} {
  const buttons = options.map((option) =>
    h('button', {
      type: 'button', role: 'radio', 'data-value': option.value, title: option.title,
      onclick: () => choose(option.value),
    }, option.text));
  const element = h('div', {class: 'choice', role: 'radiogroup', 'aria-label': label,
    onkeydown: (event: KeyboardEvent) => {
      const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
      if (!step) return;
      event.preventDefault();
      const now = buttons.findIndex((b) => b.getAttribute('aria-checked') === 'true');
      const next = buttons[(now + step + buttons.length) % buttons.length];
      choose(next.dataset.value as T);
      next.focus();
    }}, ...buttons);
  const set = (chosen: T) => {
    for (const button of buttons) {
      const on = button.dataset.value === chosen;
      button.setAttribute('aria-checked', String(on));
      button.tabIndex = on ? 0 : -1;
    }
  };
  const choose = (chosen: T) => {
    set(chosen);
    changed(chosen);
  };
  set(value);
  return {element, set};
}

// Panels of the page without a browser: what stands for its elements.
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {dirname, join} from 'node:path';
import {fileURLToPath, pathToFileURL} from 'node:url';
import {buildSync} from 'esbuild';

/** Stands for an element; text is that of all children. */
export class Element {
  constructor(tag) {
    Object.assign(this, {tag, children: [], attributes: {}, dataset: {}, style: {}, listeners: {}, parent: null});
    this.classList = {add() {}, toggle() {}};
  }
  append(...children) {
    for (const child of children.filter((one) => one !== null)) {
      if (child instanceof Element) child.parent = this;
      this.children.push(child);
    }
  }
  replaceChildren(...children) {
    this.children = [];
    this.append(...children);
  }
  remove() { this.parent.children = this.parent.children.filter((child) => child !== this); }
  setAttribute(name, value) {
    this.attributes[name] = value;
    if (name.startsWith('data-')) this.dataset[name.slice(5)] = value;
  }
  removeAttribute(name) { delete this.attributes[name]; }
  getAttribute(name) { return this.attributes[name]; }
  addEventListener(name, listener) { this.listeners[name] = listener; }
  click() { this.listeners.click(); }
  get inside() { return this.children.filter((child) => child instanceof Element).flatMap((child) => [child, ...child.inside]); }
  /** By tag, .class, #id or [data-name=value]. */
  querySelector(selector) {
    const [, name, value] = selector.match(/^\[([\w-]+)=(.*)\]$/) ?? [];
    const fits = ({tag, attributes}) => name ? attributes[name] === value
      : [tag, `.${attributes.class}`, `#${attributes.id}`].includes(selector);
    return this.inside.find(fits) ?? null;
  }
  get options() { return this.inside.filter(({tag}) => tag === 'option'); }
  get childElementCount() { return this.children.filter((child) => child instanceof Element).length; }
  set textContent(text) { this.children = [text]; }
  get text() { return this.children.map((child) => child.text ?? String(child)).join(''); }
}

/** What a file of src exports. The page is empty again. */
export async function load(file) {
  const page = {};
  globalThis.Node = Element;
  globalThis.document = {
    body: new Element('body'), createElement: (tag) => new Element(tag), createElementNS: (_, tag) => new Element(tag),
    getElementById: (id) => (page[id] ??= new Element('div')),
  };
  globalThis.requestAnimationFrame = (draw) => setTimeout(draw, 0);
  globalThis.IntersectionObserver = class { observe() {} };
  const folder = mkdtempSync(join(tmpdir(), 'pencilscan_panel_'));
  try {
    const outfile = join(folder, 'panel.mjs');
    const source = join(dirname(fileURLToPath(import.meta.url)), '../src', file);
    buildSync({entryPoints: [source], bundle: true, format: 'esm', outfile, logLevel: 'error'});
    return await import(pathToFileURL(outfile).href);
  } finally {
    rmSync(folder, {recursive: true});
  }
}

/** A promise that is kept when told so. */
export function later() {
  let resolve;
  const promise = new Promise((keep) => (resolve = keep));
  return {promise, resolve};
}

/** Until all that waits for nothing else is done. */
export const settled = () => new Promise((done) => setTimeout(done, 10));

// The row of frames, without a browser: what carries a mark. node --test web/test
import assert from 'node:assert/strict';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {dirname, join} from 'node:path';
import {test} from 'node:test';
import {fileURLToPath, pathToFileURL} from 'node:url';
import {buildSync} from 'esbuild';

/** Stands for an element; text is that of all children. */
class Element {
  constructor(tag) {
    Object.assign(this, {tag, children: [], attributes: {}, dataset: {}});
  }
  append(...children) { this.children.push(...children.filter((child) => child !== null)); }
  setAttribute(name, value) { this.attributes[name] = value; }
  addEventListener() {}
  querySelector() { return null; }
  get text() { return this.children.map((child) => child.text ?? String(child)).join(''); }
}

async function strip(results) {
  const folder = mkdtempSync(join(tmpdir(), 'pencilscan_strip_'));
  try {
    const outfile = join(folder, 'strip.mjs');
    const source = join(dirname(fileURLToPath(import.meta.url)), '../src/frame_strip.ts');
    buildSync({entryPoints: [source], bundle: true, format: 'esm', outfile});
    globalThis.Node = Element;
    globalThis.document = {createElement: (tag) => new Element(tag)};
    globalThis.IntersectionObserver = class { observe() {} };
    const {FrameStrip} = await import(pathToFileURL(outfile).href);
    return new FrameStrip({source: {index: {results}}});
  } finally {
    rmSync(folder, {recursive: true});
  }
}

const frame = (name, more = {}) => ({name, run: '', detail: 'full', parts: ['thumb'], missing: [], summary: {points: 9}, ...more});

test('pictures that nobody asked for are no alarm, an unreadable part and a warning are', async () => {
  const {element} = await strip([
    frame('000000', {missing: [{what: 'pictures', why: 'no picture of cam0', kind: 'missing'}]}),
    frame('000001', {missing: [{what: 'points.ply', why: 'cut short', kind: 'unreadable'}]}),
    frame('000002', {summary: {points: 9, warnings: 2}}),
  ]);
  assert.deepEqual(element.children.map(({text}) => text), ['000000', '000001!', '000002!']);
});

test('a page that opens later than at the first frame says why', async () => {
  const shapes = [frame('000000', {detail: 'shape'}), frame('000001')];
  assert.match((await strip(shapes)).note.text, /opened at the first of them/);
  assert.doesNotMatch((await strip([...shapes].reverse())).note.text, /opened/);
});

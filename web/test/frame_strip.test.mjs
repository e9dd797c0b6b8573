// The row of frames, without a browser: what carries a mark, and thumbnails. node --test web/test
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {later, load, settled} from './elements.mjs';

async function strip(results, source = {}) {
  const {FrameStrip} = await load('frame_strip.ts');
  return new FrameStrip({source: {index: {results}, ...source}});
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

test('a thumbnail that leaves and comes back while it is read is there once', async (t) => {
  const asked = [];
  t.mock.method(URL, 'revokeObjectURL', () => {});
  const frames = await strip([frame('000000')], {imageUrl: () => {
    asked.push(later());
    return asked.at(-1).promise;
  }});
  const place = frames.element.querySelector('.thumb');
  void frames.fill(0, place);
  frames.empty(place);
  void frames.fill(0, place);
  asked.forEach(({resolve}, k) => resolve(`blob:${k}`));
  await settled();
  assert.equal(place.childElementCount, 1);
  assert.deepEqual(URL.revokeObjectURL.mock.calls.map((call) => call.arguments[0]), ['blob:1']);
  frames.empty(place);
  assert.equal(place.childElementCount, 0);
});

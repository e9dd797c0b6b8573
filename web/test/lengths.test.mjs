// Digits of lengths, legends of depth and types of pictures, without a browser. node --test web/test
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Element, load, settled} from './elements.mjs';

test('lengths have the decimals that the size of the scene deserves', async () => {
  const {lengthText, placeText} = await load('figure_text.ts');
  const cases = [
    [12.3456, 150, '12.35'], [12.3456, 100, '12.35'], [12.3456, 99, '12.346'], // mm
    [0.0123456, 0.15, '0.01235'], [1.23456, 1, '1.2346'], // m, baselines
    [1234.56, 1500, '1234.6'], [123456.7, 1e5, '123457'],
    [0.0123456, 0, '0.0123'], [12.3456, NaN, '12.3'], [NaN, 150, '–'],
  ];
  for (const [value, extent, text] of cases) assert.equal(lengthText(value, extent), text, `${value} within ${extent}`);
  assert.equal(placeText([0.1, -0.0234567, 1 / 3], 0.15), '0.10000, -0.02346, 0.33333');
  assert.equal(placeText([0.1, -0.0234567, 1 / 3], 0), '0.10000, -0.02346, 0.33333'); // by its own size
  assert.equal(placeText([0, 0, 0], 0), '0, 0, 0');
});

const device = (...t) => ({name: '', width: 4, height: 3, K: [], distortion: [], R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], t});

test('the size of the scene is that of the volume, or else of the places of the devices', async () => {
  const {extentOf} = await load('figure_text.ts');
  const rig = {cameras: [device(0, 0, 0)], projectors: [device(1, -3, 2)], volume: {center: [0, 0, 0], radius: 0.2}};
  assert.equal(extentOf(rig), 0.2);
  assert.equal(extentOf({...rig, volume: {center: [0, 0, 0], radius: null}}), 3);
  assert.equal(extentOf({...rig, volume: undefined}), 3);
  assert.equal(extentOf({...rig, volume: undefined, projectors: []}), 0);
  assert.equal(extentOf(null), 0);
});

test('a distance in metres is more than zero', async (t) => {
  const {Measuring} = await load('measuring.ts');
  Element.prototype.getContext = () => new Proxy({}, {get: () => () => {}, set: () => true});
  t.after(() => delete Element.prototype.getContext);
  const measuring = new Measuring(() => ({position: null, radius: 0.2, extent: 0.15, eye: [0, 0, 1], unit: 'm'}), () => {});
  measuring.start('distance');
  measuring.add([0, 0, 0]);
  measuring.add([0.0012, 0, 0]);
  assert.equal(measuring.readout.text, 'Distance 0.00120 m');
});

test('the selected point is shown in the decimals of its rig', async () => {
  const {Inspector} = await load('inspector.ts');
  const listeners = {};
  new Inspector({
    result: 0, source: {index: {results: [{}]}, has: () => false}, curves: null, cameras: [],
    rig: {cameras: [], projectors: [], patterns: [], unit: 'm', volume: {center: [0, 0, 0], radius: 0.15}},
    on: (what, listener) => (listeners[what] = listener), patternOf: () => undefined, position: () => [0.0123456, 0, -0.1],
    points: {projector: [0], pattern: [0], line: [0], sigma: [1e-5], confidence: [255], stride: 1},
    selection: {camera: 0, u: 5, v: 5, point: 0, sample: -1},
  });
  listeners.selection();
  assert.match(document.getElementById('inspector').text, /3-D point0\.01235, 0\.00000, -0\.10000 m/);
});

test('so is the place under the pointer', async () => {
  const {Hovering} = await load('hovering.ts');
  const canvas = new Element('canvas');
  const rig = {unit: 'm', volume: {center: [0, 0, 0], radius: 0.15}};
  const picture = {canvas, meshHit: () => ({vertex: 0, point: {toArray: () => [0.0123456, 0, -0.1]}})};
  const hovering = new Hovering({rig}, picture, () => ({mode: 'shading', mesh: {}, points: false}));
  canvas.listeners.pointermove({buttons: 0, pointerType: 'mouse', offsetX: 1, offsetY: 1});
  await settled();
  assert.equal(hovering.element.text, '0.01235, 0.00000, -0.10000 m');
});

/** Colours (red green blue) and legend of a depth map of one row. */
async function depthOf(t, unit, ...depth) {
  const {depthLegend, depthPicture} = await load('image_layers.ts');
  const data = new Uint8ClampedArray(4 * depth.length);
  Element.prototype.getContext = () => ({createImageData: () => ({data}), putImageData() {}});
  t.after(() => delete Element.prototype.getContext);
  const canvas = depthPicture({columns: depth.length, rows: 1, stride: 4, source: 'mesh', depth: Float32Array.from(depth)});
  const legend = new Element('div');
  legend.append(...depthLegend(canvas, unit));
  return {colors: depth.map((_, i) => [...data.slice(4 * i, 4 * i + 3)].join()), legend};
}

const [kNear, kFar, kNone] = ['253,231,37', '68,1,84', '24,24,28'];

test('both ends of the depth differ, whatever the unit', async (t) => {
  const ends = async (unit, ...depth) => {
    const {colors, legend} = await depthOf(t, unit, ...depth);
    assert.deepEqual(colors, [kNear, kNone, kFar]);
    return legend.querySelector('.ramp-ends').children.map(({text}) => text);
  };
  assert.deepEqual(await ends('mm', 512.34, NaN, 698.76), ['512', '699 mm']);
  assert.deepEqual(await ends('m', 0.51234, Infinity, 0.69876), ['0.512', '0.699 m']);
  assert.deepEqual(await ends('units', 2.5, -Infinity, 2.5625), ['2.5000', '2.5625 units']);
});

test('a depth map that knows nothing has no range', async (t) => {
  for (const depth of [[NaN, NaN], [Infinity, -Infinity], []]) {
    const {colors, legend} = await depthOf(t, 'mm', ...depth);
    assert.ok(colors.every((color) => color === kNone), colors.join(' '));
    assert.equal(legend.text, 'Depth (mesh)not known anywhere');
  }
});

test('a depth map of one depth has one colour, which is in the legend', async (t) => {
  const {colors, legend} = await depthOf(t, 'm', 0.8125, NaN, 0.8125);
  assert.deepEqual(colors, [kNear, kNone, kNear]);
  assert.equal(legend.text, 'Depth (mesh)0.813 m');
  assert.match(legend.querySelector('i').attributes.style, new RegExp(kNear));
});

test('the address of a picture has the type of its bytes', async (t) => {
  const {Source} = await load('data.ts');
  const blobs = [];
  t.mock.method(URL, 'createObjectURL', (blob) => blobs.push(blob));
  Object.defineProperty(document.getElementById('index'), 'textContent', {value: '{"mode": "report"}'});
  const source = new Source();
  const parts = ['\xff\xd8\xff\xe0\0\x10JFIF\0', '\x89PNG\r\n\x1a\n\0\0\0\rIHDR', 'RIFF\x24\0\0\0WEBPVP8 ', 'RIFF\x24\0\0\0WAVE', ''];
  for (const [i, bytes] of parts.entries()) {
    Object.defineProperty(document.getElementById(`part/${i}/thumb`), 'textContent', {value: btoa(bytes)});
    await source.imageUrl(i, 'thumb');
  }
  assert.deepEqual(blobs.map(({type}) => type), ['image/jpeg', 'image/png', 'image/webp', '', '']);
  assert.deepEqual(blobs.map(({size}) => size), parts.map(({length}) => length));
});

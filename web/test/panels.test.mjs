// Panels without a browser: what arrives late or fails, and what a click changes meanwhile. node --test web/test
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {later, load, settled} from './elements.mjs';

const plane = (z) => ({position: Float32Array.of(0, 0, z, 1, 0, z, 0, 1, z), index: Uint32Array.of(0, 1, 2)});

/** What a panel asks of the app, with a method that tells its listeners. */
function appOf(results, more) {
  const listeners = {};
  return {
    result: 0, reference: null, rig: null, cameras: [], points: null, curves: null, selection: null,
    source: {index: {results, failed: [], mode: 'report'}, has: (result, part) => results[result].parts.includes(part), ...more},
    on: (what, listener) => (listeners[what] = listener),
    tell: (what) => listeners[what](),
    show(result) {
      this.result = result;
      this.tell('result');
    },
  };
}

const result = (...parts) => ({name: parts.join(), run: '', parts, missing: [], summary: {}, detail: 'full'});

test('a mesh that was compared with one frame is compared with the next one anew', async () => {
  const {ReferenceView} = await load('reference_view.ts');
  const app = appOf([result('mesh'), result('mesh')], {mesh: async (i) => plane(i / 128)});
  const view = new ReferenceView(app);
  const mesh = plane(1 / 64);
  for (const [i, distance] of [[0, 1 / 64], [1, 1 / 128]]) {
    app.reference = {result: i, how: 'difference'};
    assert.ok(await view.read());
    view.compare(mesh);
    assert.deepEqual([...mesh.difference], [distance, distance, distance]);
    const {difference} = mesh;
    view.compare(mesh);
    assert.equal(mesh.difference, difference);
  }
});

async function viewerOf(app) {
  const {Viewer} = await load('viewer.ts');
  return {viewer: new Viewer(app), panel: document.getElementById('viewer')};
}

test('a frame without a surface changes no choice', async () => {
  const app = appOf([result('mesh', 'points'), result('points'), result('measured'), result('mesh')]);
  const {panel} = await viewerOf(app);
  const chosen = () => ['mesh', 'measured', 'none'].find((value) =>
    panel.querySelector(`[data-value=${value}]`).getAttribute('aria-checked') === 'true');
  const seen = [0, 1, 2, 3].map((i) => {
    app.show(i);
    return [chosen(), panel.querySelector('#show-points').checked];
  });
  assert.deepEqual(seen, [['mesh', false], ['none', true], ['measured', false], ['mesh', false]]);
});

test('a surface that cannot be read is said to be unreadable, of the frame that is shown', async () => {
  const reading = later();
  const app = appOf([result('mesh'), result('points')], {mesh: () => reading.promise.then(() => {
    throw new Error('cut short');
  })});
  const {viewer, panel} = await viewerOf(app);
  viewer.picture = new Proxy({}, {get: () => () => {}});
  viewer.recolor = () => {};
  const message = panel.querySelector('.overlay-message');
  app.show(0);
  app.show(1);
  reading.resolve();
  await settled();
  assert.doesNotMatch(message.text, /cut short/);
  app.show(0);
  await settled();
  assert.match(message.text, /cannot be shown: Error: cut short/);
});

test('Pause and Play within a frame make one run, not two', async () => {
  const {Timeline} = await load('timeline.ts');
  const results = [0, 1, 2, 3].map((i) => ({...result('mesh'), name: String(i)}));
  const app = appOf(results, {mesh: async () => plane(0), sequence: () => new Promise(() => {})});
  const times = [];
  new Timeline(app, {play: () => times.push(performance.now())});
  const find = (id) => document.getElementById('timeline').querySelector(id);
  find('#speed').value = '2';
  find('#loop').checked = true;
  for (let k = 0; k < 3; ++k) find('#play').click();
  while (times.length < 2) await settled();
  find('#play').click();
  assert.ok(times[1] - times[0] > 250, `${times[1] - times[0]} ms between two frames`);
});

test('pictures that arrive after Clear are of no point', async () => {
  const {Inspector} = await load('inspector.ts');
  const image = later();
  const app = appOf([result('image/0', 'image/1')], {image: () => image.promise});
  Object.assign(app, {
    cameras: [{name: 'cam0', width: 10}, {name: 'cam1', width: 10}], patternOf: () => undefined, sees: () => ({u: 5, v: 5}),
    position: () => [0, 0, 0], clearSelection() {
      this.selection = null;
      this.tell('selection');
    },
    points: {projector: [0], pattern: [0], line: [0], sigma: [0.1], confidence: [255], stride: 1},
    selection: {camera: 0, u: 5, v: 5, point: 0, sample: -1},
  });
  new Inspector(app);
  app.tell('selection');
  app.clearSelection();
  image.resolve({width: 10});
  await settled(); // a complaint of what waited would end the test
  assert.match(document.getElementById('inspector').text, /Click a curve/);
});

test('details that cannot be read are one fault, however often they are asked for', async () => {
  const {Figures} = await load('figures.ts');
  const app = appOf([result()], {details: async () => {
    throw new Error('cut short');
  }});
  new Figures(app);
  for (let k = 0; k < 2; ++k) {
    app.show(0);
    await settled();
    assert.equal(document.getElementById('warnings').text, 'Cannot be read: detailsError: cut short');
  }
});

// The time line of a sequence: curves, marks, playing, comparing. node --test web/test
import assert from 'node:assert/strict';
import {readFileSync, rmSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {pathToFileURL} from 'node:url';
import {drawn, faintTexts, looksNew, pixels, until} from './looks.mjs';
import {makeScene, openBrowser, openPage, run, startView} from './scene.mjs';

let scene;
let browser;
let address; // of a report of five frames, of which one has no result
let table;

before(async () => {
  scene = makeScene(5);
  run('sequence', 'finish', '--out', scene.out);
  rmSync(join(scene.out, '000003'), {recursive: true});
  const file = join(scene.out, 'sequence.json');
  const sequence = JSON.parse(readFileSync(file));
  sequence.table[3] = {frame: '000003', state: 'failed'};
  sequence.holes = [{frame: '000003', state: 'failed', reason: 'cam1: black'}];
  sequence.events = [{frame: '000002', last_frame: '000004', text: 'from frame 000002: camera cam1 moved'}];
  for (const row of sequence.table) delete row.warnings;
  sequence.table[1].warnings = sequence.table[2].warnings = ['too <b>dark</b>'];
  writeFileSync(file, JSON.stringify(sequence));
  table = sequence.table;
  run('report', scene.out, '--out', join(scene.folder, 'sequence.html'));
  address = pathToFileURL(join(scene.folder, 'sequence.html')).href;
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  scene?.dispose();
});

async function openSequence(of = address, ...more) {
  const opened = await openPage(browser, of, ...more);
  await opened.page.waitForSelector('#timeline[data-sequence]');
  return opened;
}

const value = (page, figure) => page.locator(`output[data-figure=${figure}]`).innerText();
const played = (page) => page.evaluate(() => Number(document.getElementById('timeline').dataset.played ?? 0));

test('the table of the sequence is shown as curves, with what it says of the frame shown', async () => {
  const {page, complaints} = await openSequence();
  const figures = ['points', 'labelled_share', 'crossing_px', 'measured_share', 'line_width_px', 'saturated_pixels'];
  assert.deepEqual(await page.locator('output[data-figure]').evaluateAll((all) => all.map((e) => e.dataset.figure)), figures);
  for (const [item, row] of [[0, 0], [3, 4]]) { // the fourth result is the fifth frame
    await page.locator('.frame').nth(item).click();
    await until(async () => Number((await value(page, 'points')).replace(/\D/g, '')) === table[row].points, 'points');
    assert.ok(Math.abs(parseFloat(await value(page, 'labelled_share')) - 100 * table[row].labelled_share) < 0.051);
    assert.ok(Math.abs(parseFloat(await value(page, 'crossing_px')) / table[row].crossing_px - 1) < 0.006);
  }
  // A curve is in two pieces where a frame has no result.
  const pieces = (await page.locator('.curve').first().getAttribute('d')).match(/M/g).length;
  assert.equal(pieces, 2);
  await page.selectOption('#curve-device', 'cam1');
  const share = 100 * table[4]['cam1.labelled_share'];
  await until(async () => Math.abs(parseFloat(await value(page, 'labelled_share')) - share) < 0.051, 'of cam1');
  assert.equal(await page.locator('output[data-figure=points]').count(), 0); // cameras have none
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('events, warnings and frames without a result are marks that lead to their frame', async () => {
  const {page} = await openSequence();
  await page.click('.mark-list summary');
  const marks = await page.locator('.mark-list li').allInnerTexts();
  assert.equal(marks.length, 3, String(marks));
  const text = marks.join('\n');
  assert.match(text, /000001 – 000002\s+warning too <b>dark<\/b>/); // two neighbours, one mark
  assert.match(text, /000002 – 000004\s+event from frame 000002: camera cam1 moved/);
  assert.match(text, /000003\s+no result failed: cam1: black/);
  assert.equal(await page.locator('.mark-track i').count(), 3);
  await page.click('.mark-list .event button');
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '2');
  assert.match(await page.locator('.frame-name').innerText(), /^000002/);
  await page.click('.mark-list .hole button');
  assert.match(await page.locator('.frame-name').innerText(), /^000003 · no result/);
  await page.context().close();
});

test('pointing into a curve scrubs, and letting go opens the frame', async () => {
  const {page} = await openSequence();
  const seen = new Set([(await pixels(page, '#canvas-3d')).hash]);
  await page.locator('.curve-area').first().scrollIntoViewIfNeeded();
  const box = await page.locator('.curve-area').first().boundingBox();
  const at = (row) => box.x + (box.width * (row + 0.5)) / 5;
  await page.mouse.move(at(1), box.y + 20);
  await page.mouse.down();
  await looksNew(page, '#canvas-3d', seen, 'scrubbed');
  assert.match(await page.locator('.frame-name').innerText(), /^000001/);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.loaded), '0');
  await page.mouse.move(at(4), box.y + 20);
  await page.mouse.up();
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '3');
  await looksNew(page, '#canvas-3d', seen, 'the last frame');
  await page.context().close();
});

test('playing ends at the last frame unless it shall loop', async () => {
  const {page} = await openSequence();
  await page.selectOption('#speed', '30');
  await page.uncheck('#loop');
  await page.click('#play');
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '3');
  assert.match(await page.locator('#play').innerText(), /Play/);
  assert.equal(await played(page), 3);
  await page.check('#loop');
  await page.click('#play');
  await until(async () => (await played(page)) >= 10, 'it does not loop');
  await page.click('#play');
  await page.context().close();
});

test('two frames stand side by side, or one shows how far it is from the other', async () => {
  const {page, complaints} = await openSequence();
  await page.locator('.frame').nth(2).click();
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '2');
  const seen = new Set([(await pixels(page, '#canvas-3d')).hash]);
  await page.click('[data-value=beside]');
  await looksNew(page, '#canvas-3d', seen, 'side by side');
  assert.match(await page.locator('.half.right').innerText(), /000001/);
  // Left and right half show two shapes in the same place.
  await page.click('[data-value=difference]');
  await looksNew(page, '#canvas-3d', seen, 'the difference');
  // The ball moves by 4 mm a frame: nearly all of it lies within 4 mm before or behind.
  const ends = () => page.locator('.legend input').evaluateAll((all) => all.map((e) => Number(e.value)));
  await until(async () => (await ends()).length === 2, 'no scale');
  const [low, high] = await ends();
  assert.ok(low === -high && high >= 3.5 && high <= 4.6, `${low} to ${high}`);
  const cells = await page.locator('.compared tbody tr').first().locator('th, td').allInnerTexts();
  assert.match(cells[0], /Measured points/);
  const [a, b, change] = cells.slice(1).map((cell) => Number(cell.replace(/[^\d-]/g, '')));
  assert.deepEqual([a, b, change], [table[2].points, table[1].points, a - b]);
  // With itself: nothing differs.
  await page.click('#pin');
  await until(async () => (await ends())[1] < 0.1, 'a frame differs from itself');
  await page.click('#timeline [data-value=off]');
  await until(async () => (await page.locator('.legend input').count()) === 0, 'the scale stays');
  assert.equal(await page.locator('#color-mode').inputValue(), 'shading');
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('view gives the same, with as many faces as are asked for', async () => {
  const {address: served, stop} = await startView(scene.out);
  const {page, complaints, requests} = await openSequence(served);
  assert.equal(await page.locator('.mark-track i').count(), 3);
  await page.selectOption('#play-faces', '100');
  await page.click('#play');
  await until(async () => (await played(page)) >= 3, 'it does not play');
  assert.ok(requests.some((url) => url.endsWith('/play/100')), String(requests));
  await drawn(page);
  assert.deepEqual(complaints, []);
  await page.context().close();
  await stop();
});

test('a broken table costs its curves only', async () => {
  const file = join(scene.out, 'sequence.json');
  const text = readFileSync(file);
  for (const [broken, says] of [['{', /cannot be read/], ['{"table": [{"frame": "9"}]}', /knows other frames/]]) {
    writeFileSync(file, broken);
    run('report', scene.out, '--out', join(scene.folder, 'broken.html'), '--overwrite');
    const {page, complaints} = await openSequence(pathToFileURL(join(scene.folder, 'broken.html')).href);
    assert.match(await page.locator('.curve-head').innerText(), says);
    assert.ok((await page.locator('output[data-figure]').count()) >= 2); // what every frame says itself
    assert.deepEqual(complaints, []);
    await page.context().close();
  }
  writeFileSync(file, text);
});

test('it fits phones and stands out, light and dark', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const {page} = await openSequence(address, {width: 390, height: 844}, {colorScheme});
    await page.click('.mark-list summary');
    await page.click('[data-value=difference]');
    await drawn(page);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 390);
    assert.deepEqual(await faintTexts(page), []);
    await page.context().close();
  }
});

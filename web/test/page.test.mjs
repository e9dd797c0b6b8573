// The page in a real browser: node --test web/test
import assert from 'node:assert/strict';
import {mkdirSync, mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {pathToFileURL} from 'node:url';
import {drawn, faintTexts, looksNew, pixels, until} from './looks.mjs';
import {makeScene, openBrowser, openPage, patience, readPoints, run, startView} from './scene.mjs';

let scene;
let browser;
let single; // address of the report of one frame, with truth
let sequence; // of three frames
let points; // of the frame

before(async () => {
  scene = makeScene(3);
  run('report', join(scene.out, '000000'), '--truth', join(scene.truth, '000000', 'mesh.ply'),
    '--out', join(scene.folder, 'single.html'));
  run('report', scene.out, '--out', join(scene.folder, 'sequence.html'));
  single = pathToFileURL(join(scene.folder, 'single.html')).href;
  sequence = pathToFileURL(join(scene.folder, 'sequence.html')).href;
  points = readPoints(join(scene.out, '000000', 'points.ply'));
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  scene?.dispose();
});

const fact = (page, name) => page.locator(`[data-fact="${name}"]`).innerText();

test('opens from a file without a complaint or a request', async () => {
  const {page, complaints, requests} = await openPage(browser, single);
  assert.deepEqual(complaints, []);
  assert.deepEqual(requests, [single]);
  assert.match(await page.locator('#figures').innerText(), /Measured points/);
  assert.match(await page.locator('#figures').innerText(), /Line recall by spacing/);
  await page.context().close();
});

test('is interactive soon', async () => {
  const context = await browser.newContext({viewport: {width: 1366, height: 768}});
  context.setDefaultTimeout(patience);
  const page = await context.newPage();
  const began = Date.now();
  await page.goto(single);
  await page.waitForSelector('html[data-ready]');
  assert.ok(Date.now() - began < 60000); // a machine under load; web/benchmark.mjs has the time of a quiet one
  await context.close();
});

test('the 3-D picture shows a shaded shape, in every colour mode another one', async () => {
  const {page} = await openPage(browser, single);
  const before = await pixels(page, '#canvas-3d');
  assert.ok(before.colors > 100, `${before.colors} colours`);
  assert.ok(before.ground < 0.95);
  const seen = new Set([before.hash]);
  for (const mode of ['sigma', 'confidence', 'hole', 'distance', 'projector', 'camera', 'line', 'albedo']) {
    await page.selectOption('#color-mode', mode);
    await looksNew(page, '#canvas-3d', seen, mode);
  }
  await page.context().close();
});

test('views from devices, with keys and mouse', async () => {
  const {page} = await openPage(browser, single);
  const seen = new Set([(await pixels(page, '#canvas-3d')).hash]);
  const differs = (what) => looksNew(page, '#canvas-3d', seen, what);
  for (const view of ['c0', 'c1', 'p0', 'p1', 'Back']) {
    await page.selectOption('#view-from', view);
    await differs(view);
  }
  await page.locator('#canvas-3d canvas').focus();
  await page.keyboard.press('ArrowLeft');
  await differs('arrow key');
  await page.keyboard.press('+');
  await differs('plus key');
  await page.context().close();
});

test('the view of a camera puts a point where the camera has it', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#view-from', 'c0');
  await drawn(page);
  const some = points.filter((p) => p.camera === 0).filter((_, i) => i % 500 === 0);
  const box = await page.locator('#canvas-3d canvas').boundingBox();
  const scale = Math.min(box.width / 480, box.height / 360);
  for (const p of some) {
    const at = await page.locator('#canvas-3d canvas').evaluate(
      (canvas, xyz) => canvas.pencilscanProject(xyz), [p.x, p.y, p.z]);
    const x = box.width / 2 + (p.u - 239.5) * scale;
    const y = box.height / 2 + (p.v - 179.5) * scale;
    assert.ok(Math.hypot(at.x - x, at.y - y) < 1.5 * scale, `${at.x},${at.y} against ${x},${y}`);
  }
  await page.context().close();
});

test('layers of the images switch', async () => {
  const {page} = await openPage(browser, single);
  const seen = new Set();
  for (const layer of ['none', 'local', 'projector', 'color', 'confidence', 'undecided']) {
    await page.selectOption('#layer', layer);
    const {colors} = await looksNew(page, '#canvas-image', seen, layer);
    assert.ok(colors > 10, layer);
  }
  for (const act of [
    () => page.check('#show-crossings'),
    () => page.click('[data-value=holes]'),
    () => page.click('[data-value=depth]'),
    () => page.click('.camera-strip button:nth-child(2)'),
  ]) {
    await act();
    await looksNew(page, '#canvas-image', seen, String(act));
  }
  await page.context().close();
});

test('a click on a curve tells what points.ply says of it', async () => {
  const {page} = await openPage(browser, single);
  const candidates = points.map((p, i) => ({...p, i})).filter((p) => p.camera === 0);
  for (const share of [0.2, 0.5, 0.8]) {
    const p = candidates[Math.floor(share * candidates.length)];
    // Zoomed in, so that the click is exact to a fraction of a pixel.
    await page.locator('.camera-strip button').first().click();
    const canvas = page.locator('#canvas-image canvas');
    await canvas.focus();
    await page.keyboard.press('Escape'); // what was selected before
    await until(async () => (await page.locator('[data-fact]').count()) === 0, 'the selection stays');
    await page.keyboard.press('0');
    const where = () => canvas.evaluate((c, [u, v]) => c.pencilscanToCanvas(u, v), [p.u, p.v]);
    const box = await canvas.boundingBox();
    const scale = () => canvas.evaluate((c, [u, v]) => {
      const [a, b] = [c.pencilscanToCanvas(u, v), c.pencilscanToCanvas(u + 1, v)];
      return Math.hypot(b.x - a.x, b.y - a.y);
    }, [p.u, p.v]);
    for (let k = 0; k < 6; ++k) {
      const [at, before] = [await where(), await scale()];
      await page.mouse.move(box.x + at.x, box.y + at.y);
      await page.mouse.wheel(0, -400); // which does not wait for the page
      if (before < 59) await until(async () => (await scale()) > before, 'the wheel does not zoom');
    }
    const at = await where();
    await page.mouse.click(box.x + at.x, box.y + at.y);
    assert.equal(await fact(page, 'Camera'), 'cam0');
    assert.match(await fact(page, 'Vertex'), new RegExp(`^${p.i} of`));
    assert.equal(await fact(page, 'Projector'), `proj${p.projector}`);
    assert.match(await fact(page, 'Line'), new RegExp(`^${p.line} of`));
    const xyz = (await fact(page, '3-D point')).match(/-?[\d.]+/g).map(Number);
    [p.x, p.y, p.z].forEach((x, k) => assert.ok(Math.abs(xyz[k] - x) < 0.02, `${xyz} against ${p.x}`));
    const sigma = Number((await fact(page, 'Sigma')).split(' ')[0]);
    assert.ok(Math.abs(sigma / p.sigma - 1) < 0.02);
    assert.match(await fact(page, 'Code evidence'), /blue|cyan|red|yellow/);
  }
  await page.context().close();
});

test('a click on the shape selects the measurement there, and the image follows', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#view-from', 'c1');
  await drawn(page);
  const p = points.find((q) => q.camera === 1 && Math.hypot(q.u - 240, q.v - 180) < 15);
  const canvas = page.locator('#canvas-3d canvas');
  const at = await canvas.evaluate((c, xyz) => c.pencilscanProject(xyz), [p.x, p.y, p.z]);
  const box = await canvas.boundingBox();
  await page.mouse.click(box.x + at.x, box.y + at.y);
  const xyz = (await fact(page, '3-D point')).match(/-?[\d.]+/g).map(Number);
  const away = Math.hypot(xyz[0] - p.x, xyz[1] - p.y, xyz[2] - p.z);
  assert.ok(away < 1, `${away} mm off`);
  const camera = await fact(page, 'Camera');
  assert.equal(await page.locator('.camera-strip [aria-pressed=true] span').innerText(), camera);
  assert.ok((await page.locator('.crops figure').count()) >= 1);
  const vertex = await fact(page, 'Vertex');
  await page.click('text=along line ›');
  assert.notEqual(await fact(page, 'Vertex'), vertex);
  await page.context().close();
});

test('distances and angles are measured', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#view-from', 'c0');
  await drawn(page);
  const box = await page.locator('#canvas-3d canvas').boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.click('[data-value=distance]');
  await page.mouse.click(x - 40, y);
  await page.mouse.click(x + 40, y);
  const length = Number((await page.locator('.readout').innerText()).match(/[\d.]+/)[0]);
  const perPixel = 577 / (900 * Math.min(box.width / 480, box.height / 360)); // mm, at the centre's depth
  assert.ok(Math.abs(length / (80 * perPixel) - 1) < 0.3, `${length} mm`);
  await page.click('[data-value=angle]');
  await page.mouse.click(x - 60, y);
  await page.mouse.click(x + 60, y);
  assert.match(await page.locator('.readout').innerText(), /normals [\d.]+°/);
  await page.context().close();
});

test('a sequence plays and its frames open', async () => {
  const {page, complaints} = await openPage(browser, sequence);
  assert.equal(await page.locator('.frame').count(), 3);
  const still = await pixels(page, '#canvas-3d');
  await page.click('#play');
  await page.waitForFunction(() => Number(document.getElementById('timeline').dataset.played) >= 4);
  await page.click('#play');
  await page.locator('.frame').nth(2).click();
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '2');
  await looksNew(page, '#canvas-3d', new Set([still.hash]), 'the third frame');
  assert.match(await page.locator('.frame-name').innerText(), /3 of 3/);
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('fits phones, and dark screens', async () => {
  for (const size of [{width: 390, height: 844}, {width: 1366, height: 768}]) {
    const {page, complaints} = await openPage(browser, single, size, {colorScheme: 'dark'});
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(wide <= size.width, `${wide} px wide on ${size.width}`);
    assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'dark');
    if (size.width < 500) {
      await page.click('#panel-tabs [data-panel=images]');
      assert.ok(await page.locator('#canvas-image').isVisible());
    }
    assert.deepEqual(complaints, []);
    await page.context().close();
  }
});

test('every control has a name', async () => {
  const {page} = await openPage(browser, sequence);
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll('button, select, input, canvas[tabindex], a')].filter((e) =>
      !(e.getAttribute('aria-label') || e.textContent.trim() || e.title ||
        e.closest('label')?.textContent.trim())).map((e) => e.outerHTML.slice(0, 120)));
  assert.deepEqual(nameless, []);
  await page.context().close();
});

test('text stands out from its ground, light and dark', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const {page} = await openPage(browser, sequence, undefined, {colorScheme});
    await page.locator('.camera-strip button').first().click();
    await page.locator('#canvas-image canvas').focus();
    await page.keyboard.press('Enter');
    assert.deepEqual(await faintTexts(page), []);
    await page.context().close();
  }
});

test('keys alone reach and use everything', async () => {
  const {page} = await openPage(browser, sequence);
  const stops = [];
  for (let i = 0; i < 60; ++i) {
    await page.keyboard.press('Tab');
    const stop = await page.evaluate(() => {
      const e = document.activeElement;
      if (!e || e === document.body) return null;
      const style = getComputedStyle(e);
      return {what: e.id || e.getAttribute('aria-label') || e.textContent.trim().slice(0, 30), outline: style.outlineStyle,
        where: [...document.querySelectorAll('*')].indexOf(e)};
    });
    if (!stop) break;
    stops.push(stop);
  }
  assert.match(stops[0].what, /^Skip/);
  for (const wanted of ['theme', 'color-mode', 'view-from', 'layer', 'play', 'frame-slider']) {
    assert.ok(stops.some(({what}) => what === wanted), `Tab does not reach ${wanted}`);
  }
  assert.deepEqual(stops.filter(({outline}) => outline === 'none'), []); // where one is, is seen
  assert.deepEqual(stops.map(({where}) => where), stops.map(({where}) => where).sort((a, b) => a - b));
  // From the picture to a measurement, along its line, and back.
  await page.locator('#canvas-image canvas').focus();
  for (let k = 0; k < 20 && !(await page.locator('[data-fact=Vertex]').count()); ++k) {
    await page.keyboard.press(k % 2 ? 'ArrowLeft' : '+'); // until a labelled curve is in the middle
    await page.keyboard.press('Enter');
  }
  const vertex = await fact(page, 'Vertex');
  await page.keyboard.press(']');
  assert.notEqual(await fact(page, 'Vertex'), vertex);
  await page.keyboard.press('Escape');
  assert.equal(await page.locator('[data-fact]').count(), 0);
  await page.context().close();
});

test('headings, landmarks and names are those of a document', async () => {
  const {page} = await openPage(browser, single);
  const found = await page.evaluate(() => ({
    levels: [...document.querySelectorAll('h1, h2, h3, h4')].filter((e) => e.checkVisibility()).map((e) => Number(e.tagName[1])),
    ids: [...document.querySelectorAll('[id]')].map((e) => e.id),
    unnamed: [...document.querySelectorAll('[role=img], [role=region], [role=radiogroup], [role=group], [role=application], section')]
      .filter((e) => e.checkVisibility() && !e.getAttribute('aria-label') && !e.querySelector('h2')).map((e) => e.outerHTML.slice(0, 80)),
    main: document.querySelectorAll('main').length,
    lang: document.documentElement.lang,
  }));
  assert.equal(found.levels[0], 1);
  assert.ok(found.levels.every((level, i) => i === 0 || level <= found.levels[i - 1] + 1), String(found.levels));
  assert.equal(new Set(found.ids).size, found.ids.length);
  assert.deepEqual(found.unnamed, []);
  assert.deepEqual([found.main, found.lang], [1, 'en']);
  await page.context().close();
});

test('a folder without anything has neither report nor view; a view of failed frames names them', async () => {
  const empty = mkdtempSync(join(tmpdir(), 'pencilscan_empty_'));
  mkdirSync(join(empty, '000000', 'pictures'), {recursive: true});
  assert.throws(() => run('report', empty), (error) => error.status === 2);
  await assert.rejects(startView(empty), /view ended with 2/);
  writeFileSync(join(empty, 'inputs.json'), '{}');
  const {address, stop} = await startView(empty);
  const context = await browser.newContext();
  context.setDefaultTimeout(patience);
  const page = await context.newPage();
  await page.goto(address);
  assert.match(await page.locator('#failed').innerText(), /Frame 000000\s+its folder holds neither a result nor/);
  await context.close();
  await stop();
  rmSync(empty, {recursive: true});
});

test('view serves the same page and stops on Ctrl-C', async () => {
  const {address, stop} = await startView(scene.out);
  const {page, complaints, requests} = await openPage(browser, address);
  assert.deepEqual(complaints, []);
  assert.ok(requests.every((url) => url.startsWith(address)));
  assert.ok((await pixels(page, '#canvas-3d')).colors > 100);
  await page.click('#play');
  await page.waitForFunction(() => Number(document.getElementById('timeline').dataset.played) >= 3);
  await page.context().close();
  assert.deepEqual(await stop(), {code: 0, signal: null});
});

// The page in a real browser: node --test web/test
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {pathToFileURL} from 'node:url';
import {makeScene, openBrowser, openPage, readPoints, run} from './scene.mjs';

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

/** Decoded pixels of a screenshot of one element: counts of distinct colours. */
async function pixels(page, selector) {
  const png = await page.locator(selector).screenshot();
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const {data} = context.getImageData(0, 0, bitmap.width, bitmap.height);
    const counts = new Map();
    let hash = 0;
    for (let i = 0; i < data.length; i += 4) {
      const key = (data[i] << 16) | (data[i + 1] << 8) | data[i + 2];
      counts.set(key, (counts.get(key) ?? 0) + 1);
      hash = (Math.imul(hash, 31) + key) | 0;
    }
    const most = Math.max(...counts.values());
    return {colors: counts.size, ground: most / (data.length / 4), hash};
  }, png.toString('base64'));
}

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
  const page = await context.newPage();
  const began = Date.now();
  await page.goto(single);
  await page.waitForSelector('html[data-ready]');
  assert.ok(Date.now() - began < 10000); // a machine under load; quiet ones need a tenth
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
    await page.waitForTimeout(60);
    const {hash} = await pixels(page, '#canvas-3d');
    assert.ok(!seen.has(hash), `${mode} looks like another mode`);
    seen.add(hash);
  }
  await page.context().close();
});

test('views from devices, with keys and mouse', async () => {
  const {page} = await openPage(browser, single);
  const seen = new Set([(await pixels(page, '#canvas-3d')).hash]);
  const differs = async (what) => {
    await page.waitForTimeout(80);
    const {hash} = await pixels(page, '#canvas-3d');
    assert.ok(!seen.has(hash), what);
    seen.add(hash);
  };
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
  await page.waitForTimeout(100);
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
    await page.waitForTimeout(60);
    const {hash, colors} = await pixels(page, '#canvas-image');
    assert.ok(colors > 10, layer);
    assert.ok(!seen.has(hash), `${layer} looks like another layer`);
    seen.add(hash);
  }
  for (const act of [
    () => page.check('#show-crossings'),
    () => page.click('[data-value=holes]'),
    () => page.click('[data-value=depth]'),
    () => page.click('.camera-strip button:nth-child(2)'),
  ]) {
    await act();
    await page.waitForTimeout(150);
    const {hash} = await pixels(page, '#canvas-image');
    assert.ok(!seen.has(hash), String(act));
    seen.add(hash);
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
    await page.keyboard.press('0');
    const where = () => canvas.evaluate((c, [u, v]) => c.pencilscanToCanvas(u, v), [p.u, p.v]);
    const box = await canvas.boundingBox();
    for (let k = 0; k < 6; ++k) {
      const at = await where();
      await page.mouse.move(box.x + at.x, box.y + at.y);
      await page.mouse.wheel(0, -400);
      await page.waitForTimeout(30);
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
  await page.waitForTimeout(100);
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
  await page.waitForTimeout(100);
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
  await page.waitForTimeout(100);
  assert.notEqual((await pixels(page, '#canvas-3d')).hash, still.hash);
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

/** Texts whose contrast with their ground is below WCAG 2.1's level AA (4.5, large ones 3). */
const faintTexts = (page) => page.evaluate(() => {
  const parse = (color) => {
    const [r, g, b, a = 1] = color.match(/[\d.]+/g).map(Number);
    return color.startsWith('color(') ? [255 * r, 255 * g, 255 * b, a] : [r, g, b, a];
  };
  const over = (top, ground) => [0, 1, 2].map((k) => top[3] * top[k] + (1 - top[3]) * ground[k]);
  const groundOf = (element) => {
    if (!element) return [255, 255, 255];
    const own = parse(getComputedStyle(element).backgroundColor);
    return own[3] === 1 ? own.slice(0, 3) : over(own, groundOf(element.parentElement));
  };
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const faint = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || !element.checkVisibility() ||
        element.closest('script, option, canvas, figure[data-state=hidden]')) continue;
    const style = getComputedStyle(element);
    const ground = groundOf(element);
    const text = over(parse(element.closest('svg') ? style.fill : style.color), ground);
    const [dark, light] = [luminance(text), luminance(ground)].sort((a, b) => a - b);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    const contrast = (light + 0.05) / (dark + 0.05);
    if (contrast < (large ? 3 : 4.5)) {
      faint.push(`${contrast.toFixed(2)} ${element.tagName}.${element.className}: ${walker.currentNode.textContent.slice(0, 40)}`);
    }
  }
  return [...new Set(faint)];
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

test('a folder without anything opens with a reason', async () => {
  const empty = mkdtempSync(join(tmpdir(), 'pencilscan_empty_'));
  mkdirSync(join(empty, '000000', 'pictures'), {recursive: true});
  run('report', empty);
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.goto(pathToFileURL(join(empty, 'report.html')).href);
  assert.match(await page.locator('#nothing').innerText(), /holds no result/);
  await context.close();
  rmSync(empty, {recursive: true});
});

test('view serves the same page and stops on Ctrl-C', async () => {
  const server = spawn(process.env.PENCILSCAN_PROGRAM, ['view', scene.out], {stdio: ['ignore', 'pipe', 'ignore']});
  const ended = new Promise((done) => server.on('exit', (code, signal) => done({code, signal})));
  const address = await new Promise((done) => {
    let text = '';
    server.stdout.on('data', (data) => {
      text += data;
      const found = text.match(/http:\/\/127\.0\.0\.1:\d+\//);
      if (found) done(found[0]);
    });
  });
  const {page, complaints, requests} = await openPage(browser, address);
  assert.deepEqual(complaints, []);
  assert.ok(requests.every((url) => url.startsWith(address)));
  assert.ok((await pixels(page, '#canvas-3d')).colors > 100);
  await page.click('#play');
  await page.waitForFunction(() => Number(document.getElementById('timeline').dataset.played) >= 3);
  await page.context().close();
  server.kill('SIGINT');
  assert.deepEqual(await ended, {code: 0, signal: null});
});

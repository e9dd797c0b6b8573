// What helps to read the picture: ranges of colours, scale, box, cut, values, words. node --test web/test
import assert from 'node:assert/strict';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {pathToFileURL} from 'node:url';
import {drawn, faintTexts, looksNew, pixels, until} from './looks.mjs';
import {makeScene, openBrowser, openPage, readPoints, run} from './scene.mjs';

let scene;
let browser;
let single; // the report of one frame, with truth
let points;

before(async () => {
  scene = makeScene(1);
  const frame = join(scene.out, '000000');
  run('report', frame, '--truth', join(scene.truth, 'mesh.ply'), '--out', join(scene.folder, 'single.html'));
  single = pathToFileURL(join(scene.folder, 'single.html')).href;
  points = readPoints(join(frame, 'points.ply'));
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  scene?.dispose();
});

const ends = (page) => page.locator('.legend input').evaluateAll((all) => all.map((e) => Number(e.value)));
const sorted = (values) => [...values].sort((a, b) => a - b);

test('colours fit the data, and take the range that is typed until they are fitted again', async () => {
  const {page, complaints} = await openPage(browser, single);
  await page.click('[data-value=none]');
  const seen = new Set();
  await page.selectOption('#color-mode', 'sigma');
  await looksNew(page, '#canvas-3d', seen, 'sigma');
  const sigmas = sorted(points.map((p) => p.sigma));
  const [low, high] = await ends(page);
  // Round numbers, a twentieth of the range apart, around 5 % and 95 % of the points.
  const [p5, p95] = [0.05, 0.95].map((share) => sigmas[Math.floor(share * sigmas.length)]);
  const slack = 0.12 * (p95 - p5);
  assert.ok(low <= p5 * 1.001 && low > p5 - slack && high >= p95 * 0.999 && high < p95 + slack, `${low}..${high} for ${p5}..${p95}`);
  const type = async (end, text) => {
    await page.locator(`.legend [data-end=${end}]`).fill(text);
    await page.keyboard.press('Enter');
  };
  await type('high', String(high / 2));
  await looksNew(page, '#canvas-3d', seen, 'another range');
  assert.deepEqual(await ends(page), [low, high / 2]);
  await type('high', String(low - 1)); // no range at all
  assert.deepEqual(await ends(page), [low, high / 2]);
  await page.click('.legend button');
  await until(async () => (await ends(page))[1] === high, 'it is not fitted again');
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('reasons of holes are not covered by points', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#color-mode', 'hole');
  await drawn(page);
  const bare = await pixels(page, '#canvas-3d canvas');
  await page.selectOption('#color-mode', 'camera'); // which only points have
  assert.ok(await page.isChecked('#show-points'));
  await looksNew(page, '#canvas-3d canvas', new Set([bare.hash]), 'points');
  await page.selectOption('#color-mode', 'hole');
  await until(async () => (await pixels(page, '#canvas-3d canvas')).hash === bare.hash, 'points lie over the reasons');
  await page.context().close();
});

test('the scale bar is as long as it says', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#view-from', 'Front');
  await drawn(page);
  // The bar holds in the middle of what is shown: a surface that is closed behind is not centred at the origin.
  const vertices = readPoints(join(scene.out, '000000', 'mesh.ply'));
  const [x, y, z] = ['x', 'y', 'z'].map((k) => {
    const [low, high] = vertices.reduce(([l, h], v) => [Math.min(l, v[k]), Math.max(h, v[k])], [Infinity, -Infinity]);
    return (low + high) / 2;
  });
  const measure = () => page.evaluate(([x, y, z]) => {
    const bar = document.querySelector('.scale-bar');
    const canvas = document.querySelector('#canvas-3d canvas');
    const [a, b] = [[x, y - 10, z], [x, y + 10, z]].map((p) => canvas.pencilscanProject(p));
    return {px: bar.getBoundingClientRect().width, mm: parseFloat(bar.textContent), perMm: Math.hypot(a.x - b.x, a.y - b.y) / 20};
  }, [x, y, z]);
  const first = await measure();
  assert.ok(Math.abs(first.px / first.mm / first.perMm - 1) < 0.02, JSON.stringify(first));
  await page.locator('#canvas-3d canvas').focus();
  for (let k = 0; k < 8; ++k) await page.keyboard.press('-');
  await drawn(page);
  const far = await measure();
  assert.ok(far.mm > first.mm && Math.abs(far.px / far.mm / far.perMm - 1) < 0.02, JSON.stringify(far));
  assert.deepEqual((await page.locator('.axes text').allTextContents()).sort(), ['x', 'y', 'z']);
  await page.context().close();
});

test('box and cut: the size is that of the shape, and half of it goes', async () => {
  const {page} = await openPage(browser, single);
  const seen = new Set([(await pixels(page, '#canvas-3d canvas')).hash]);
  await page.click('.menu summary');
  await page.uncheck('#show-devices');
  await looksNew(page, '#canvas-3d canvas', seen, 'no devices');
  const menu = (open) => page.locator('.menu').evaluate((e, is) => (e.open = is), open);
  const ground = async () => { // what is neither shape nor tool
    await menu(false);
    await drawn(page);
    const share = (await pixels(page, '#canvas-3d canvas')).ground;
    await menu(true);
    return share;
  };
  const whole = await ground();
  await page.click('[data-value=none]');
  await page.uncheck('#show-points');
  await looksNew(page, '#canvas-3d canvas', seen, 'nothing');
  const shape = (await ground()) - whole;
  await page.click('[data-value=mesh]');
  await page.check('#show-box');
  await looksNew(page, '#canvas-3d canvas', seen, 'the box');
  const size = (await page.locator('.box-size').innerText()).match(/[\d.]+/g).map(Number);
  assert.equal(size.length, 3);
  for (const k of [0, 1, 2]) { // no smaller than the points are apart
    const along = points.map((p) => [p.x, p.y, p.z][k]);
    const apart = along.reduce((a, b) => Math.max(a, b)) - along.reduce((a, b) => Math.min(a, b));
    assert.ok(size[k] > apart - 2 && size[k] < 260, `${size} against ${apart}`);
  }
  await page.uncheck('#show-box');
  for (const [cut, depth] of [['z', 500], ['view', 500], ['x', 300]]) {
    await page.selectOption('#cut', cut);
    await page.locator('#cut-depth').fill(String(depth));
    await looksNew(page, '#canvas-3d canvas', seen, `cut ${cut}`);
  }
  await page.selectOption('#cut', 'z');
  await page.locator('#cut-depth').fill('500');
  await until(async () => {
    const gone = (await ground()) - whole;
    return gone > 0.2 * shape && gone < 0.8 * shape;
  }, 'half of the shape is still there, or all of it gone', 30000);
  await page.check('#cut-flip');
  await looksNew(page, '#canvas-3d canvas', seen, 'the other side');
  await page.context().close();
});

test('the value under the pointer is that of the colours, with as many digits as elsewhere', async () => {
  const {page} = await openPage(browser, single);
  await page.selectOption('#view-from', 'c0');
  await page.selectOption('#color-mode', 'distance');
  await drawn(page);
  const p = points.find((q) => q.camera === 0 && Math.hypot(q.u - 240, q.v - 180) < 15);
  const canvas = page.locator('#canvas-3d canvas');
  const at = await canvas.evaluate((c, xyz) => c.pencilscanProject(xyz), [p.x, p.y, p.z]);
  const box = await canvas.boundingBox();
  await page.mouse.move(box.x + at.x, box.y + at.y);
  await page.waitForSelector('.hover:not([hidden])');
  const [value, place] = (await page.locator('.hover').innerText()).split('\n');
  assert.match(value, /^Distance to truth: \d+(\.\d+)? mm$/);
  assert.equal(value.match(/[\d.]+/)[0].replace(/^0\.0*|\./g, '').length, 3);
  const xyz = place.match(/-?[\d.]+/g).map(Number);
  assert.ok(Math.hypot(xyz[0] - p.x, xyz[1] - p.y, xyz[2] - p.z) < 1, place);
  await page.selectOption('#color-mode', 'hole');
  await page.mouse.move(box.x + at.x + 1, box.y + at.y);
  await until(async () => /^measured/.test(await page.locator('.hover').innerText()), 'no reason');
  await page.mouse.move(5, 5);
  await until(async () => page.locator('.hover').isHidden(), 'it stays');
  await page.context().close();
});

test('a figure has the same digits everywhere, and words are explained', async () => {
  const {page} = await openPage(browser, single);
  const share = /[\d.]+\s%/;
  const chip = (await page.locator('#chips').innerText()).match(/([\d.]+\s%) measured/)[1];
  const tile = await page.locator('.tile', {hasText: 'Surface measured'}).locator('dd').first().innerText();
  assert.equal(chip, tile);
  const bar = await page.locator('.bar-row', {hasText: /^measured/}).locator('.bar-value').innerText();
  assert.match(bar, share);
  await page.click('#words summary');
  const text = await page.locator('#words').innerText();
  for (const word of ['guided matching', 'too compressed', 'no crossing', 'local ID', 'Line recall']) assert.ok(text.includes(word), word);
  assert.match(await page.locator('.bar-name', {hasText: /^guided matching$/}).getAttribute('title'), /surface lets expect/);
  await page.selectOption('#color-mode', 'hole');
  assert.match(await page.locator('.legend .key', {hasText: 'not seen'}).getAttribute('title'), /any camera/);
  await page.context().close();
});

test('all of it fits phones and stands out', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const {page} = await openPage(browser, single, {width: 390, height: 844}, {colorScheme});
    await page.selectOption('#color-mode', 'sigma');
    await page.click('.menu summary');
    await page.check('#show-box');
    await page.click('#words summary');
    await drawn(page);
    const {left, right} = await page.locator('.menu-items').evaluate((e) => e.getBoundingClientRect());
    assert.ok(left >= 0 && right <= 390, `${left} to ${right}`);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 390);
    assert.deepEqual(await faintTexts(page), []);
    await page.context().close();
  }
});

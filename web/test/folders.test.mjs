// Pages of folders that are no frames: experiments and calibrations. node --test web/test
import assert from 'node:assert/strict';
import {copyFileSync, mkdirSync, mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {dirname, join} from 'node:path';
import {after, before, test} from 'node:test';
import {fileURLToPath, pathToFileURL} from 'node:url';
import {drawn, faintTexts, looksNew, pixels} from './looks.mjs';
import {openBrowser, openPage, run, startView} from './scene.mjs';

const images = join(dirname(fileURLToPath(import.meta.url)), '../../docs/images');
let browser;
let folder; // of all
let experiment;

const table = `Two methods\n\n| method | label error | distance, mm |\n|---|---|---|\n` +
  `| linear | 0.01234567 | 0.123 (0.1 to 0.2) |\n| joint | 0.001 |  |\n`;
// A drawing that would run and load something, were it part of the page.
const drawing = `<svg xmlns="http://www.w3.org/2000/svg" width="900" height="200" viewBox="0 0 900 200">
<script>parent.ran = window.ran = true; document.title = 'ran';</script>
<image href="http://127.0.0.1:9/nothing.png" width="10" height="10"/>
<rect width="900" height="200" fill="#0a0"/></svg>`;

before(async () => {
  folder = mkdtempSync(join(tmpdir(), 'pencilscan_folders_'));
  experiment = join(folder, 'experiment');
  mkdirSync(join(experiment, 'pictures'), {recursive: true});
  mkdirSync(join(experiment, 'work', 'deep', 'calibrated'), {recursive: true});
  const write = (name, text) => writeFileSync(join(experiment, name), text);
  write('experiment.json', JSON.stringify({name: 'demo', title: 'A small <b>experiment</b>', text: 'Words.', setting: 'small'}));
  write('table.md', table);
  write('results.csv', 'method,draw,error\nlinear,1,0.5\njoint,1,0.25\n');
  write('commands.log', 'pencilscan reconstruct --one\npencilscan evaluate --two\n');
  write('plot.svg', drawing);
  write('broken.png', 'no picture');
  write('work/deep/calibrated/calibration.json', '{"verdict": "doubtful"}');
  copyFileSync(join(images, 'fig8.webp'), join(experiment, 'moving.webp'));
  copyFileSync(join(images, 'fig8_sheet.jpg'), join(experiment, 'sheet.jpg'));
  for (const frame of ['000', '001', '002']) {
    copyFileSync(join(images, 'fig8_sheet.jpg'), join(experiment, 'pictures', `${frame}_cam0.jpg`));
  }
  run('report', experiment);
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  rmSync(folder, {recursive: true, force: true});
});

const addressOf = (of) => pathToFileURL(join(of, 'report.html')).href;

/** A page whose pictures are all there. */
async function openExperiment(address, ...more) {
  const opened = await openPage(browser, address, ...more);
  await opened.page.waitForSelector('html[data-pictures]');
  return opened;
}

test('an experiment has its title, tables, pictures and runs, without a complaint or a request', async () => {
  const {page, complaints, requests} = await openExperiment(addressOf(experiment));
  assert.deepEqual(complaints, []);
  assert.deepEqual(requests, [addressOf(experiment)]);
  assert.equal(await page.locator('#experiment-title').innerText(), 'A small <b>experiment</b>');
  assert.match(await page.locator('.about').innerText(), /small setting\s*Words/);
  const cells = await page.locator('.tables tbody tr').first().locator('th, td').allInnerTexts();
  assert.deepEqual(cells, ['linear', '0.01235', '0.123 (0.1 to 0.2)']); // rounded to what is read
  assert.equal(await page.locator('.tables td[title]').first().getAttribute('title'), '0.01234567');
  const shown = await page.evaluate(() => [...document.querySelectorAll('#experiment img:not([hidden])')]
    .map((image) => image.complete && image.naturalWidth > 0));
  assert.deepEqual(shown, [true, true, true, true, true, true]); // moving, sheet, plot and three small ones
  assert.deepEqual(await page.evaluate(() => [window.ran, document.title.startsWith('experiment')]), [undefined, true]);
  assert.match(await page.locator('.notes').innerText(), /Cannot be read: broken\.png\s+broken\.png: must be/);
  assert.match(await page.locator('#experiment').innerText(), /work\/deep\/calibrated\s+calibration\s+doubtful\s+pencilscan report experiment\/work\/deep\/calibrated/);
  await page.click('text=Values of results.csv (2 rows)');
  assert.ok(await page.locator('text=0.25').isVisible());
  await page.click('text=Commands that were run (2)');
  assert.ok(await page.locator('text=pencilscan evaluate --two').isVisible());
  assert.ok(!(await page.locator('#stage').isVisible()));
  await page.context().close();
});

test('pictures open large, and what moves can be stopped', async () => {
  const {page} = await openExperiment(addressOf(experiment));
  await page.click('[aria-label="Enlarge plot"]');
  assert.match(await page.locator('.lightbox p').innerText(), /plot\.svg · \d of 5/);
  await page.keyboard.press('ArrowRight');
  assert.doesNotMatch(await page.locator('.lightbox p').innerText(), /plot\.svg/);
  await page.keyboard.press('Escape');
  assert.ok(!(await page.locator('.lightbox').isVisible()));
  const motion = page.locator('.motion');
  assert.match(await motion.innerText(), /Pause/);
  await motion.click();
  assert.match(await motion.innerText(), /Play/);
  const still = await pixels(page, '.moving canvas');
  assert.ok(still.colors > 100);
  await page.context().close();
  const calm = await openExperiment(addressOf(experiment), undefined, {reducedMotion: 'reduce'});
  assert.match(await calm.page.locator('.motion').innerText(), /Play/);
  await calm.page.context().close();
});

test('an experiment without its files says what is missing', async () => {
  const poor = join(folder, 'poor');
  mkdirSync(poor);
  writeFileSync(join(poor, 'commands.log'), '');
  run('report', poor);
  const {page, complaints} = await openExperiment(addressOf(poor));
  const text = await page.locator('#experiment').innerText();
  assert.match(text, /Missing: table\.md/);
  assert.match(text, /holds no table and no picture/);
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('view serves an experiment as well, and a drawing only as data', async () => {
  const {address, stop} = await startView(experiment);
  const {page, complaints, requests} = await openExperiment(address);
  assert.deepEqual(complaints, []);
  assert.ok(requests.every((url) => url.startsWith(address)), String(requests));
  assert.ok((await page.locator('#experiment img').count()) >= 5);
  const types = await page.evaluate(async () => [...await Promise.all([0, 1, 2].map(async (i) =>
    (await fetch(`part/experiment/${i}`)).headers.get('content-type')))]);
  assert.deepEqual(types, Array(3).fill('application/octet-stream'));
  assert.equal(await page.evaluate(async () => (await fetch('part/experiment/99')).status), 404);
  await page.context().close();
  await stop();
});

/** What calibrate writes, in short. */
function calibration(verdict) {
  const device = (name, x, y) => ({name, width: 640, height: 480, placed: true, views: 100, rms_px: 0.1, median_px: 0.05,
    p95_px: 0.2, parameters: {fx: {value: 1100, sigma: 3}, fy: {value: 1100, sigma: 3}, cx: {value: 320, sigma: 2},
      cy: {value: 240, sigma: 0}}, rotation_sigma_deg: 0.1, position_sigma: [0.1, 0.1, 0.2],
    R: [[1, 0, 0], [0, 0, -1], [0, 1, 0]], t: [-x, y, 500],
    residuals: Array.from({length: 60}, (_, i) => [10 * i, 7 * i, 0.1 * Math.sin(i), 0.1 * Math.cos(i)])});
  return {format: 'calibration/1', verdict, unit: 'unknown', rms_px: 0.1, tracks: 100,
    reasons: [{grade: 'good', what: 'the scale is not known', advice: 'give --known-distance'},
      {grade: verdict, what: 'planar scene: every rig sees a plane alike', advice: 'capture an object with depth'}],
    devices: [device('cam0', -100, 0), device('proj0', 100, 20), {name: 'cam1', width: 640, height: 480, placed: false}],
    points: Array.from({length: 300}, (_, i) => [60 * Math.sin(i), 60 * Math.cos(i), i / 5 - 30]),
    pairs: [{camera: 'cam0', projector: 'proj0', correspondences: 100, inlier_share: 0.93, planar_share: 0.21},
      {camera: 'cam1', projector: 'proj0', correspondences: 0}],
    loop: {closed_ring: true, devices: ['cam0', 'proj0'], rotation_deg: 0.01, scale: 1.002, gap: 0.3, gap_px: 0.4},
    color: {remarks: ['captures are grey: lateral colour is not known'], registration: {devices: [
      {name: 'cam0', red: {shift_px: [0.31, -0.02], shift_sigma_px: [0.01, 0.01]}, green: {}, blue: {}}]}},
    decoding: [{capture: 0, projector: 'proj0', camera: 'cam0', valid_share_of_lit: 0.97, correspondences: 88,
      pixels: {valid: 9700, unlit: 1200, saturated: 3}}]};
}

test('a calibration begins with its verdict, the gravest reason first, and shows its devices in space', async () => {
  for (const verdict of ['unusable', 'doubtful', 'good']) {
    const calibrated = join(folder, verdict);
    mkdirSync(calibrated);
    writeFileSync(join(calibrated, 'calibration.json'), JSON.stringify(calibration(verdict)));
    run('report', calibrated);
    const {page, complaints, requests} = await openPage(browser, addressOf(calibrated));
    assert.deepEqual(complaints, []);
    assert.equal(requests.length, 1);
    const top = await page.locator('#calibration > *').first().innerText();
    assert.match(top, new RegExp(`Verdict: ${verdict}`));
    assert.match(top, /What to do: give --known-distance/);
    if (verdict !== 'good') {
      const first = await page.locator('.findings li').first().innerText();
      assert.match(first, new RegExp(`${verdict}\\s+Planar scene.*\\s+What to do: capture an object`));
    }
    const seen = new Set();
    const space = await looksNew(page, '.space', seen, 'the devices');
    assert.ok(space.colors > 20 && space.ground < 0.99, JSON.stringify(space));
    await page.locator('.space canvas').focus();
    await page.keyboard.press('ArrowLeft');
    await looksNew(page, '.space', seen, 'turned');
    assert.match(await page.locator('#calibration').innerText(), /2 of 3 devices placed/);
    assert.equal(await page.locator('.residuals').count(), 2);
    const text = await page.locator('#calibration').innerText();
    for (const part of [/Once round the ring \(cam0, proj0 and back to cam0\)/, /captures are grey/, /0\.31, -0\.02 ± 0\.01/,
      /proj0 \/ cam0\s+100\s+93\.0\s%\s+21\.0\s%/, /1, proj0 \/ cam0\s+9\s700\s+3\s+1\s200\s+97\.0\s%\s+88/]) assert.match(text, part);
    await page.context().close();
  }
});

test('other versions of calibration.json and broken ones are no error', async () => {
  for (const [k, text] of ['{"devices": {"cam0": {"R": "x", "t": [1]}}, "points": 3, "reasons": [3, null, ""]}', '[]', '{"verdict"'].entries()) {
    const odd = join(folder, `odd${k}`);
    mkdirSync(odd);
    writeFileSync(join(odd, 'calibration.json'), text);
    run('report', odd);
    const {page, complaints} = await openPage(browser, addressOf(odd));
    assert.deepEqual(complaints, []);
    assert.match(await page.locator('#calibration').innerText(), /no verdict stated|cannot be read/);
    await page.context().close();
  }
});

test('both fit phones, stand out light and dark, and have names', async () => {
  for (const address of [addressOf(experiment), addressOf(join(folder, 'unusable'))]) {
    for (const colorScheme of ['light', 'dark']) {
      const size = {width: 390, height: 844};
      const open = address === addressOf(experiment) ? openExperiment : openPage.bind(null, browser);
      const {page} = await open(address, size, {colorScheme});
      await drawn(page);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(wide <= size.width, `${address} is ${wide} px wide`);
      assert.deepEqual(await faintTexts(page), []);
      const nameless = await page.evaluate(() => [...document.querySelectorAll(
        'button, a, canvas[tabindex], [role=img], [role=region], section, img:not([alt])')]
        .filter((e) => e.checkVisibility() && !(e.getAttribute('aria-label') || e.textContent.trim() || e.title))
        .map((e) => e.outerHTML.slice(0, 100)));
      assert.deepEqual(nameless, []);
      await page.context().close();
    }
  }
});

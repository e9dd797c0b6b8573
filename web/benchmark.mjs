// How soon a page can be used: node web/benchmark.mjs <report.html> [runs]
// Headless Chromium without a graphics card (software rendering), a fresh browser for each run. Times
// are from the start of the navigation: until the shape is drawn and a key turns it (interactive),
// until points and curves are there as well (whole). A sequence is played for 20 frames at 10 / s.
import {statSync} from 'node:fs';
import {availableParallelism, loadavg} from 'node:os';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {openBrowser} from './test/scene.mjs';

const [file, runs = '5'] = process.argv.slice(2);
if (!file) throw new Error('usage: node web/benchmark.mjs <report.html> [runs]');

const drawnAt = (page) => page.waitForFunction(() =>
  performance.getEntriesByName('shape-drawn')[0]?.startTime, null, {polling: 20});

async function measure() {
  const browser = await openBrowser(['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader']);
  const page = await browser.newPage({viewport: {width: 1366, height: 768}});
  await page.goto(pathToFileURL(resolve(file)).href, {waitUntil: 'commit'});
  const drawn = await (await drawnAt(page)).jsonValue();
  // A key, and the picture after it.
  const interactive = await page.evaluate(async () => {
    const canvas = document.querySelector('#canvas-3d canvas');
    canvas.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft', bubbles: true}));
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    return performance.now();
  });
  await page.waitForFunction(() => document.documentElement.dataset.loaded !== undefined);
  const whole = await page.evaluate(() => performance.now());
  const times = {drawn, interactive, whole};
  if (await page.locator('#play').count()) {
    await page.click('#play');
    const played = () => page.waitForFunction(() =>
      Number(document.getElementById('timeline').dataset.played ?? 0) >= 20, null, {polling: 20});
    const began = Date.now();
    await played();
    times.play20 = Date.now() - began;
  }
  await browser.close();
  return times;
}

const all = [];
for (let i = 0; i < Number(runs); ++i) all.push(await measure());
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
console.log(`size           ${(statSync(file).size / 1e6).toFixed(1)} MB`);
for (const key of Object.keys(all[0])) {
  const values = all.map((times) => times[key] / 1000);
  console.log(`${key.padEnd(14)} ${median(values).toFixed(2)} s (median of ${runs}; ${
    values.map((x) => x.toFixed(2)).join(' ')})`);
}
console.log(`cores          ${availableParallelism()}, load ${loadavg()[0].toFixed(1)}`);

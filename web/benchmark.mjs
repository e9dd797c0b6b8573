// How soon a page can be used, and how fast a sequence plays:
//   node web/benchmark.mjs <report.html, or the address that view prints> [runs] [thousands of faces]
// Headless Chromium without a graphics card (software rendering), a fresh browser for each run. Times
// are from the start of the navigation: until the shape is drawn and a key turns it (interactive),
// until points and curves are there as well (whole). A sequence is then played for 20 s as fast as it
// goes, up to 30 frames a second, and for 20 s more; heap: what the page's JavaScript holds then.
import {statSync} from 'node:fs';
import {availableParallelism, loadavg} from 'node:os';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {openBrowser} from './test/scene.mjs';

const [file, runs = '5', thousands] = process.argv.slice(2);
if (!file) throw new Error('usage: node web/benchmark.mjs <report.html or http://...> [runs] [thousands of faces]');
const served = /^https?:/.test(file);
const kSeconds = 20; // of playing

/** Frames a second over some seconds. */
async function rate(page) {
  const played = () => page.evaluate(() => Number(document.getElementById('timeline').dataset.played ?? 0));
  const [before, began] = [await played(), performance.now()];
  await page.waitForTimeout(1000 * kSeconds);
  return (1000 * ((await played()) - before)) / (performance.now() - began);
}

const drawnAt = (page) => page.waitForFunction(() =>
  performance.getEntriesByName('shape-drawn')[0]?.startTime, null, {polling: 20});

async function measure() {
  const browser = await openBrowser(['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader'], '/usr/bin/chromium');
  const page = await browser.newPage({viewport: {width: 1366, height: 768}});
  await page.goto(served ? file : pathToFileURL(resolve(file)).href, {waitUntil: 'commit'});
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
  const found = {'drawn, s': drawn / 1000, 'interactive, s': interactive / 1000, 'whole, s': whole / 1000};
  if (await page.locator('#play').count()) {
    await page.selectOption('#speed', '30');
    if (thousands) await page.selectOption('#play-faces', thousands);
    await page.click('#play');
    found['frames a second, first'] = await rate(page);
    found['frames a second, later'] = await rate(page);
    const session = await page.context().newCDPSession(page);
    await session.send('HeapProfiler.collectGarbage');
    await session.send('Performance.enable');
    const {metrics} = await session.send('Performance.getMetrics');
    const memory = await session.send('Runtime.getHeapUsage');
    found['heap, MB'] = (metrics.find(({name}) => name === 'JSHeapUsedSize').value + (memory.backingStorageSize ?? 0)) / 1e6;
  }
  await browser.close();
  return found;
}

const all = [];
for (let i = 0; i < Number(runs); ++i) all.push(await measure());
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
if (!served) console.log(`size  ${(statSync(file).size / 1e6).toFixed(1)} MB`);
for (const key of Object.keys(all[0])) {
  const values = all.map((found) => found[key]);
  console.log(`${key.padEnd(24)} ${median([...values]).toFixed(2)} (median of ${runs}; ${values.map((x) => x.toFixed(2)).join(' ')})`);
}
console.log(`cores  ${availableParallelism()}, load ${loadavg()[0].toFixed(1)}`);

// What the page says of frames that failed and of a truth that does not fit, and whether bars can be
// compared. node --test web/test
import assert from 'node:assert/strict';
import {mkdirSync, rmSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {after, before, test} from 'node:test';
import {pathToFileURL} from 'node:url';
import {faintTexts} from './looks.mjs';
import {makeScene, openBrowser, openPage, run, startView} from './scene.mjs';

let scene;
let browser;

/** Puts a failure in the place of a frame's result. */
function fail(out, frame, failure) {
  rmSync(join(out, frame), {recursive: true, force: true});
  mkdirSync(join(out, frame), {recursive: true});
  writeFileSync(join(out, frame, 'failure.json'), JSON.stringify({frame, ...failure}));
}

function report(name, ...args) {
  const file = join(scene.folder, name);
  run('report', ...args, '--out', file);
  return pathToFileURL(file).href;
}

before(async () => {
  scene = makeScene(4);
  fail(scene.out, '000002', {reason: 'cam1: <i>black</i>', is_passing: false});
  browser = await openBrowser();
});

after(async () => {
  await browser?.close();
  scene?.dispose();
});

test('a failed frame is a gap in the curves and is named with its reason', async () => {
  const {page, complaints} = await openPage(browser, report('gap.html', scene.out));
  await page.waitForSelector('#timeline[data-sequence]');
  const pieces = (await page.locator('.curve').first().getAttribute('d')).match(/M/g).length;
  assert.equal(pieces, 2);
  assert.match(await page.locator('.timeline-tools .failed').innerText(), /^1 without a result: 000002$/);
  assert.match(await page.locator('#failed').innerText(), /Frame 000002\s+cam1: <i>black<\/i>/);
  assert.equal(await page.locator('.mark-track .hole').count(), 1);
  await page.locator('.frame').nth(2).click(); // the third result is the fourth frame
  await page.waitForFunction(() => document.documentElement.dataset.loaded === '2');
  assert.match(await page.locator('.frame-name').innerText(), /^000003/);
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test('where no frame has a result, the page says why', async () => {
  const out = join(scene.folder, 'failed');
  mkdirSync(out);
  writeFileSync(join(out, 'inputs.json'), '{}');
  fail(out, '000000', {reason: 'no projector can be told apart', is_passing: false});
  fail(out, '000001', {reason: 'the disk is full', is_passing: true});
  for (const colorScheme of ['light', 'dark']) {
    const {page, complaints} = await openPage(browser, report(`${colorScheme}.html`, out), {width: 390, height: 844}, {colorScheme});
    const text = await page.locator('#failed-section').innerText();
    assert.match(text, /Frame 000000\s+no projector can be told apart/);
    assert.match(text, /Frame 000001\s+the disk is full\s+Another time may do better/);
    assert.equal(await page.locator('#nothing').isVisible(), false);
    assert.deepEqual(await faintTexts(page), []);
    assert.deepEqual(complaints, []);
    await page.context().close();
  }
});

test('a truth that does not fit is in doubt, and no figure is of it', async () => {
  const other = join(scene.folder, 'other.obj');
  writeFileSync(other, 'v 0 0 900\nv 9 0 900\nv 0 9 900\nv 9 9 909\nf 1 2 3\nf 2 4 3\n');
  const frame = join(scene.out, '000000');
  const served = await startView(frame, '--truth', other);
  for (const address of [report('doubt.html', frame, '--truth', other), served.address]) {
    const {page, complaints} = await openPage(browser, address);
    const warnings = await page.locator('#warnings').innerText();
    assert.match(warnings, /In doubt: \S*other\.obj\s+this is hardly the truth/);
    assert.doesNotMatch(warnings, /Cannot be read/);
    assert.equal((warnings.match(/In doubt/g)).length, 1);
    const figures = await page.locator('#figures').innerText();
    assert.match(figures, /Measured points/);
    assert.doesNotMatch(figures, /Line recall\n[\d.]|Label error\n|to the truth/i); // a table's head has the words, too
    assert.deepEqual(complaints, []);
    await page.context().close();
  }
  await served.stop();
});

test('bars of one chart are on one scale', async () => {
  const {page} = await openPage(browser, report('bars.html', join(scene.out, '000000')));
  for (const width of [1366, 390]) {
    await page.setViewportSize({width, height: 844});
    const charts = await page.evaluate(() => [...document.querySelectorAll('.bars')].map((chart) =>
      [...chart.querySelectorAll('.bar-row')].map((row) => {
        const {left, width} = row.querySelector('.bar-track').getBoundingClientRect();
        return {left, width, bar: row.querySelector('.bar-track span').getBoundingClientRect().width,
          share: parseFloat(row.querySelector('.bar-track span').style.width)};
      })));
    assert.ok(charts.length >= 2 && charts[0].length > 5, JSON.stringify(charts));
    for (const rows of charts) {
      for (const {left, width: track, bar, share} of rows) {
        assert.ok(track > 60, `${track} px`);
        assert.ok(Math.abs(left - rows[0].left) < 0.1 && Math.abs(track - rows[0].width) < 0.1, JSON.stringify(rows));
        assert.ok(Math.abs(bar - track * share / 100) < 0.5, JSON.stringify(rows));
      }
    }
  }
  await page.context().close();
});

test('the page of an artefact says what it lacks, fits phones and stands out', async () => {
  const file = join(scene.folder, 'ball.html');
  assert.throws(() => run('artefact', 'sphere', '--diameter', '180', '--report', file, scene.out), ({status}) => status === 1);
  for (const colorScheme of ['light', 'dark']) {
    const context = await browser.newContext({viewport: {width: 390, height: 844}, colorScheme});
    const page = await context.newPage();
    await page.goto(pathToFileURL(file).href);
    assert.match(await page.locator('.warnings').innerText(), /No result: \S*000002\s+cam1: <i>black<\/i>; no figure/);
    assert.match(await page.locator('body').innerText(), /3 positions, and 1 without a result; the worst counts/);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 390);
    assert.deepEqual(await faintTexts(page), []);
    await context.close();
  }
});

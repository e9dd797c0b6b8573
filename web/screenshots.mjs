// Pictures of a page: node web/screenshots.mjs <report.html or http://...> <folder>
// (Chromium as in web/test/scene.mjs.) docs/report.md shows the one named laptop of the demo.
import {mkdirSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {openBrowser, openPage} from './test/scene.mjs';

const [address, folder] = process.argv.slice(2);
if (!address || !folder) throw new Error('usage: node web/screenshots.mjs <report.html> <folder>');
const url = /^https?:/.test(address) ? address : pathToFileURL(resolve(address)).href;
mkdirSync(folder, {recursive: true});
const browser = await openBrowser();

const phone = {deviceScaleFactor: 2, isMobile: true, hasTouch: true};
const shots = [
  {name: 'laptop', size: {width: 1366, height: 768}},
  {name: 'dark', size: {width: 1920, height: 1080}, more: {colorScheme: 'dark'}, color: 'sigma'},
  {name: 'phone', size: {width: 390, height: 844}, more: phone},
  {name: 'phone_dark', size: {width: 390, height: 844}, more: {...phone, colorScheme: 'dark'}},
];

for (const {name, size, more, color} of shots) {
  const began = Date.now();
  const {page, complaints} = await openPage(browser, url, size, more);
  console.log(`${name}: loaded in ${Date.now() - began} ms`, complaints);
  await page.waitForTimeout(1200);
  const save = (what, options = {}) => page.screenshot({path: join(folder, `${what}.png`), ...options});
  const canvas = page.locator('#canvas-3d canvas');
  if (await canvas.isVisible()) {
    if (color && await page.locator(`#color-mode option[value=${color}]:enabled`).count()) {
      await page.selectOption('#color-mode', color);
    }
    const box = await canvas.boundingBox();
    await page.mouse.click(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
    await page.waitForTimeout(600);
  }
  await save(name);
  await save(`${name}_whole`, {fullPage: true});
  if (more?.isMobile && await canvas.isVisible()) {
    await page.click('#panel-tabs [data-panel=images]');
    await page.waitForTimeout(500);
    await save(`${name}_images`);
  }
  await page.context().close();
}
await browser.close();

// Pictures of a page: node web/screenshots.mjs <report.html or http://...> <folder>
// (Chromium as in web/test/scene.mjs.) docs/report.md shows the ones of the demo.
import {mkdirSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {openBrowser, openPage} from './test/scene.mjs';

const [address, folder] = process.argv.slice(2);
if (!address || !folder) throw new Error('usage: node web/screenshots.mjs <report.html> <folder>');
const url = /^https?:/.test(address) ? address : pathToFileURL(resolve(address)).href;
mkdirSync(folder, {recursive: true});
const browser = await openBrowser();

async function shoot(name, size, more, act) {
  const began = Date.now();
  const {page, complaints} = await openPage(browser, url, size, more);
  console.log(`${name}: loaded in ${Date.now() - began} ms`, complaints);
  await page.waitForTimeout(1500);
  await act?.(page);
  await page.waitForTimeout(500);
  await page.screenshot({path: join(folder, `${name}.png`)});
  return page;
}

async function selectSomething(page) {
  const box = await page.locator('#canvas-3d canvas').boundingBox();
  await page.mouse.click(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
}

const laptop = {width: 1366, height: 768};
const page = await shoot('laptop', laptop, {}, selectSomething);
await page.screenshot({path: join(folder, 'whole.png'), fullPage: true});
await page.context().close();
await (await shoot('dark', {width: 1920, height: 1080}, {colorScheme: 'dark'}, async (p) => {
  await selectSomething(p);
  await p.selectOption('#color-mode', 'sigma');
})).context().close();
const phone = {deviceScaleFactor: 2, isMobile: true, hasTouch: true};
const small = await shoot('phone', {width: 390, height: 844}, phone, selectSomething);
await small.click('#panel-tabs [data-panel=images]');
await small.waitForTimeout(500);
await small.screenshot({path: join(folder, 'phone_images.png')});
await small.screenshot({path: join(folder, 'phone_whole.png'), fullPage: true});
await browser.close();

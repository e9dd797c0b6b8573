// What a page looks like, and waiting for it to look so: no test waits for a time, since how long a
// picture takes depends on what else the machine does.
import assert from 'node:assert/strict';

/** Decoded pixels of a screenshot of one element: counts of distinct colours. */
export async function pixels(page, selector) {
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

/** Texts whose contrast with their ground is below WCAG 2.1's level AA (4.5, large ones 3). */
export const faintTexts = (page) => page.evaluate(() => {
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

/** After what was asked for has been drawn: two pictures of the browser later. */
export const drawn = (page) => page.evaluate(() =>
  new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)))));

/** Asks until the answer is true; fails with `what` after `patience` ms. */
export async function until(ask, what, patience = 120000) {
  const end = Date.now() + patience;
  while (!(await ask())) {
    assert.ok(Date.now() < end, what);
    await new Promise((done) => setTimeout(done, 50));
  }
}

/** Waits until an element looks like at no time before, and remembers how. seen: a Set. */
export async function looksNew(page, selector, seen, what) {
  let found;
  await until(async () => {
    await drawn(page);
    found = await pixels(page, selector);
    return !seen.has(found.hash);
  }, `${what} looks like another one`, 30000);
  seen.add(found.hash);
  return found;
}

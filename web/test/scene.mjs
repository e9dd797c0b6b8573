// A small scene made by the program itself, and a browser to look at it. PENCILSCAN_PROGRAM names
// the program; CHROMIUM the browser (default: Debian's headless shell, which takes half the processor
// time of the whole browser for the same pages).
import {execFileSync, spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {chromium} from 'playwright-core';

const program = process.env.PENCILSCAN_PROGRAM ?? 'build/release/pencilscan';

export function run(...args) {
  return execFileSync(program, args, {encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore']});
}

/** A server of a folder: its address, and how to end it by Ctrl-C; stop() tells how it ended. */
export async function startView(folder, ...options) {
  const server = spawn(program, ['view', folder, ...options], {stdio: ['ignore', 'pipe', 'ignore']});
  const ended = new Promise((done) => server.on('exit', (code, signal) => done({code, signal})));
  const address = await new Promise((done, failed) => {
    server.on('error', failed).on('exit', (code) => failed(new Error(`view ended with ${code}`)));
    let text = '';
    server.stdout.on('data', (data) => {
      text += data;
      const found = text.match(/http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\//);
      if (found) done(found[0]);
    });
  });
  const stop = () => {
    server.kill('SIGINT');
    return ended;
  };
  return {address, stop};
}

const sub = (a, b) => a.map((x, k) => x - b[k]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

/** A device at `eye` that looks at the origin, image rows down. */
function lookAt(eye) {
  const z = unit(sub([0, 0, 0], eye));
  const x = unit(cross(z, [0, 0, 1]));
  const R = [x, cross(z, x), z];
  return {R, t: R.map((row) => -row.reduce((sum, r, k) => sum + r * eye[k], 0))};
}

/** Two cameras and two projectors with crossing lines before the object, with small images. */
function smallRig() {
  const device = (name, width, height, f, eye) => ({
    name, width, height, K: [[f, 0, width / 2], [0, f, height / 2], [0, 0, 1]],
    distortion: [0, 0, 0, 0, 0], ...lookAt(eye)});
  const pattern = (orientation, colors) => ({orientation, colors, alphabet: 2, order: 3,
    pitch_px: 12, line_width_px: 4, offset_px: 6});
  return {
    format: 'rig/1', unit: 'mm',
    cameras: [device('cam0', 480, 360, 900, [560, -110, 80]), device('cam1', 480, 360, 900, [560, 110, 80])],
    projectors: [
      {...device('proj0', 640, 512, 1000, [450, 225, 45]), pattern: pattern('vertical', ['blue', 'cyan'])},
      {...device('proj1', 640, 512, 1000, [386, -140, 277]), pattern: pattern('horizontal', ['red', 'yellow'])}],
    volume: {center: [0, 0, 0], radius: 110},
  };
}

/** A ball of rings as OBJ. */
function ball(radius, rings) {
  const lines = [];
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j < 2 * rings; ++j) {
      const [a, b] = [(Math.PI * i) / rings, (Math.PI * j) / rings];
      lines.push(`v ${radius * Math.sin(a) * Math.cos(b)} ${radius * Math.sin(a) * Math.sin(b)} ${radius * Math.cos(a)}`);
    }
  }
  const at = (i, j) => 1 + i * 2 * rings + (j % (2 * rings));
  for (let i = 0; i < rings; ++i) {
    for (let j = 0; j < 2 * rings; ++j) {
      lines.push(`f ${at(i, j)} ${at(i + 1, j)} ${at(i + 1, j + 1)}`, `f ${at(i, j)} ${at(i + 1, j + 1)} ${at(i, j + 1)}`);
    }
  }
  return lines.join('\n');
}

/** frames: of a moving ball. Gives the folders; dispose() removes them. */
export function makeScene(frames) {
  const folder = mkdtempSync(join(tmpdir(), 'pencilscan_web_'));
  writeFileSync(join(folder, 'rig.json'), JSON.stringify(smallRig()));
  writeFileSync(join(folder, 'ball.obj'), ball(90, 32));
  run('simulate', '--rig', join(folder, 'rig.json'), '--mesh', join(folder, 'ball.obj'), '--out',
    join(folder, 'scene'), '--samples', '1', '--frame-count', String(frames),
    ...(frames > 1 ? ['--translate-mm', '0', '4', '0'] : []));
  const out = join(folder, 'out');
  run('reconstruct', '--rig', join(folder, 'scene', 'rig.json'), '--frames', join(folder, 'scene', 'frames'),
    '--out', out);
  return {folder, out, truth: join(folder, 'scene', 'truth'),
    dispose: () => rmSync(folder, {recursive: true, force: true})};
}

/** ms that anything may take before a test fails: only a stuck page takes as long, however busy the
 * machine is. */
export const patience = 180000;

// Software rendering everywhere; root in a container has no sandbox to offer. Only the 3-D picture needs
// WebGL: the rest of the page, drawn as by a graphics card, would take the tests twice the processor time.
const kFlags = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
  '--disable-gpu-compositing', '--disable-gpu-rasterization'];
// What the browser then says of its own way from one to the other, and not of the page.
const kOfTheBrowser = /GPU stall due to ReadPixels/;

export async function openBrowser(args = kFlags, program = '/usr/bin/chromium-headless-shell') {
  return chromium.launch({timeout: patience, executablePath: process.env.CHROMIUM ?? program, args});
}

/** A page that remembers every complaint of the console and every request. */
export async function openPage(browser, address, size = {width: 1366, height: 768}, more = {}) {
  const context = await browser.newContext({viewport: size, ...more});
  context.setDefaultTimeout(patience);
  const page = await context.newPage();
  const complaints = [];
  const requests = [];
  page.on('console', (message) => {
    if (!['error', 'warning'].includes(message.type()) || kOfTheBrowser.test(message.text())) return;
    complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(String(error)));
  page.on('request', (request) => {
    if (!/^(data|blob):/.test(request.url())) requests.push(request.url());
  });
  await page.goto(address);
  await page.waitForFunction(() => document.documentElement.dataset.loaded !== undefined);
  return {page, complaints, requests};
}

/** points.ply of this program: little endian, fixed properties; the header gives their order. */
export function readPoints(file) {
  const bytes = readFileSync(file);
  const end = bytes.indexOf('end_header\n') + 'end_header\n'.length;
  const header = bytes.subarray(0, end).toString('latin1').split('\n');
  const count = Number(header.find((l) => l.startsWith('element vertex')).split(' ')[2]);
  const read = {float: [4, 'readFloatLE'], uchar: [1, 'readUInt8'], ushort: [2, 'readUInt16LE'], int: [4, 'readInt32LE']};
  const properties = header.filter((l) => /^property (?!list)/.test(l)).map((l) => l.split(' ').slice(1));
  const points = [];
  let at = end;
  for (let i = 0; i < count; ++i) {
    const point = {};
    for (const [type, name] of properties) {
      const [size, method] = read[type];
      point[name] = bytes[method](at);
      at += size;
    }
    points.push(point);
  }
  return points;
}

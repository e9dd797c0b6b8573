// A long sequence to measure the page with: node web/test/long_sequence.mjs <folder> [frames] [faces]
// Every frame is a folder with the closed surface of a ball that waves (30 of them, linked to again and again)
// and figures, as `reconstruct` and `sequence finish` write them.
import {linkSync, mkdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';

const [folder, frames = '1500', faces = '100000'] = process.argv.slice(2);
if (!folder) throw new Error('usage: node web/test/long_sequence.mjs <folder> [frames] [faces]');
const kPeriod = 30; // frames

/** Rings round the z axis; two triangles a quad. */
function wavingBall(phase, faceCount) {
  const rings = Math.round(Math.sqrt(faceCount / 4));
  const around = 2 * rings;
  const vertices = Buffer.alloc((rings + 1) * around * 21);
  let at = 0;
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j < around; ++j) {
      const [a, b] = [(Math.PI * i) / rings, (2 * Math.PI * j) / around];
      const radius = 90 + 5 * Math.sin(4 * a + phase) * Math.sin(5 * b);
      for (const x of [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)]) at = vertices.writeFloatLE(radius * x, at);
      const seen = Math.cos(b) > -0.3;
      at = vertices.writeFloatLE(0.05 + 0.04 * Math.sin(a), at); // sigma
      at = vertices.writeFloatLE(seen ? 0.9 : 0, at); // confidence
      at = vertices.writeUInt8(seen ? 1 : 8, at); // hole
    }
  }
  const triangles = Buffer.alloc(rings * around * 2 * 13);
  at = 0;
  for (let i = 0; i < rings; ++i) {
    for (let j = 0; j < around; ++j) {
      const [p, q] = [i * around + j, i * around + ((j + 1) % around)];
      for (const face of [[p, p + around, q], [q, p + around, q + around]]) {
        at = triangles.writeUInt8(3, at);
        for (const vertex of face) at = triangles.writeInt32LE(vertex, at);
      }
    }
  }
  const header = ['ply', 'format binary_little_endian 1.0', `element vertex ${(rings + 1) * around}`,
    ...['x', 'y', 'z', 'sigma', 'confidence'].map((name) => `property float ${name}`), 'property uchar hole',
    `element face ${rings * around * 2}`, 'property list uchar int vertex_indices', 'end_header', ''].join('\n');
  return Buffer.concat([Buffer.from(header), vertices, triangles]);
}

const table = [];
mkdirSync(folder, {recursive: true});
writeFileSync(join(folder, 'inputs.json'), '{}');
for (let i = 0; i < Number(frames); ++i) {
  const frame = String(i).padStart(6, '0');
  const mesh = join(folder, frame, 'mesh.ply');
  mkdirSync(join(folder, frame));
  if (i < kPeriod) writeFileSync(mesh, wavingBall((2 * Math.PI * i) / kPeriod, Number(faces)));
  else linkSync(join(folder, String(i % kPeriod).padStart(6, '0'), 'mesh.ply'), mesh);
  const points = 200000 + Math.round(5000 * Math.sin(i / 40));
  writeFileSync(join(folder, frame, 'report.json'), JSON.stringify({frame, points, surface: {vertices: 1, measured_share: 0.7}, warnings: []}));
  writeFileSync(join(folder, frame, 'timing.json'), '{"seconds": {"total": 4}}');
  const row = {frame, state: 'done', points, labelled_share: 0.9 + 0.05 * Math.sin(i / 70), crossing_px: 0.05, crossing_expected_px: 0.06,
    measured_share: 0.7, line_width_px: 1.1, saturated_pixels: i % 50};
  for (let c = 0; c < 6; ++c) Object.assign(row, {[`cam${c}.labelled_share`]: 0.9, [`cam${c}.crossing_px`]: 0.05, [`cam${c}.line_width_px`]: 1.1});
  table.push(row);
}
const devices = (name) => Array.from({length: 6}, (_, k) => `${name}${k}`);
writeFileSync(join(folder, 'sequence.json'), JSON.stringify({format: 'sequence/1', frames: table.length, frames_done: table.length,
  cameras: devices('cam'), projectors: devices('proj'), holes: [], table,
  events: [{frame: '000700', text: 'from frame 000700: camera cam2 moved'}].filter(() => table.length > 700)}));

// A plane through points: least squares, with points far off left out in two further rounds.
import type {Vec3} from './device';

export interface Plane {
  center: Vec3;
  normal: Vec3; // unit
  rms: number; // distance of the points that count
  count: number;
}

/** Eigenvector of the smallest eigenvalue of a symmetric 3x3 matrix: Jacobi's rotations. */
export function smallestEigenvector(matrix: number[][]): Vec3 {
  const a = matrix.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 30; ++sweep) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-300) continue;
      const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
      const c = Math.cos(angle);
      const s = Math.sin(angle);
      for (let k = 0; k < 3; ++k) {
        [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      }
      for (let k = 0; k < 3; ++k) {
        [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
      }
    }
  }
  const least = [0, 1, 2].reduce((best, k) => (a[k][k] < a[best][best] ? k : best), 0);
  return [v[0][least], v[1][least], v[2][least]];
}

function fit(position: Float32Array, chosen: number[]): Plane {
  const center: Vec3 = [0, 0, 0];
  for (const i of chosen) for (let k = 0; k < 3; ++k) center[k] += position[3 * i + k] / chosen.length;
  const cov = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  for (const i of chosen) {
    const d = [0, 1, 2].map((k) => position[3 * i + k] - center[k]);
    for (let r = 0; r < 3; ++r) for (let c = 0; c < 3; ++c) cov[r][c] += d[r] * d[c];
  }
  const normal = smallestEigenvector(cov);
  const plane = {center, normal, rms: 0, count: chosen.length};
  let sum = 0;
  for (const i of chosen) sum += off(plane, position, i) ** 2;
  plane.rms = Math.sqrt(sum / chosen.length);
  return plane;
}

const off = (plane: Plane, position: Float32Array, i: number): number =>
  [0, 1, 2].reduce((sum, k) => sum + (position[3 * i + k] - plane.center[k]) * plane.normal[k], 0);

/** Null with fewer than ten points within `radius` of `at`. */
export function fitPlane(position: Float32Array, at: Vec3, radius: number): Plane | null {
  let chosen: number[] = [];
  for (let i = 0; i < position.length / 3; ++i) {
    const d2 = (position[3 * i] - at[0]) ** 2 + (position[3 * i + 1] - at[1]) ** 2 +
      (position[3 * i + 2] - at[2]) ** 2;
    if (d2 <= radius * radius) chosen.push(i);
  }
  const enough = 10;
  if (chosen.length < enough) return null;
  let plane = fit(position, chosen);
  for (let round = 0; round < 2; ++round) {
    const near = chosen.filter((i) => Math.abs(off(plane, position, i)) <= 2.5 * plane.rms);
    if (near.length < enough) break;
    chosen = near;
    plane = fit(position, chosen);
  }
  return plane;
}

/** Between the normals, both turned towards `eye`, in degrees. */
export function angleBetween(a: Plane, b: Plane, eye: Vec3): number {
  const towards = (p: Plane): Vec3 => {
    const side = [0, 1, 2].reduce((s, k) => s + (eye[k] - p.center[k]) * p.normal[k], 0);
    return p.normal.map((x) => (side < 0 ? -x : x)) as Vec3;
  };
  const [m, n] = [towards(a), towards(b)];
  const cosine = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
  return Math.acos(Math.min(1, Math.max(-1, cosine))) * (180 / Math.PI);
}

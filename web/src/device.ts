// Pinhole devices with OpenCV's axes and distortion (docs/conventions.md).
export type Vec3 = [number, number, number];

export interface DeviceJson {
  name: string;
  width: number;
  height: number;
  K: number[][];
  distortion: number[];
  R: number[][];
  t: number[];
}

/** OpenCV's rational model; rigs state 5 coefficients where the denominator is 1. */
function distort(coefficients: number[], x: number, y: number): [number, number] {
  const [k1, k2, p1, p2, k3, k4 = 0, k5 = 0, k6 = 0] = coefficients;
  const r2 = x * x + y * y;
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return [
    x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
  ];
}

export class Device {
  readonly name: string;
  readonly width: number;
  readonly height: number;

  constructor(readonly json: DeviceJson) {
    this.name = json.name;
    this.width = json.width;
    this.height = json.height;
  }

  /** In world, mm. */
  get center(): Vec3 {
    const {R, t} = this.json;
    return [0, 1, 2].map((k) => -(R[0][k] * t[0] + R[1][k] * t[1] + R[2][k] * t[2])) as Vec3;
  }

  axis(row: 0 | 1 | 2): Vec3 {
    return this.json.R[row].slice(0, 3) as Vec3;
  }

  /** Pixel and camera z of a world point; nothing behind the device. */
  project(x: number, y: number, z: number): {u: number; v: number; depth: number} | undefined {
    const {R, t, K, distortion} = this.json;
    const p = [0, 1, 2].map((r) => R[r][0] * x + R[r][1] * y + R[r][2] * z + t[r]);
    if (p[2] <= 0) return undefined;
    const [a, b] = distort(distortion, p[0] / p[2], p[1] / p[2]);
    return {u: K[0][0] * a + K[0][1] * b + K[0][2], v: K[1][1] * b + K[1][2], depth: p[2]};
  }

  contains(u: number, v: number): boolean {
    return u >= -0.5 && v >= -0.5 && u <= this.width - 0.5 && v <= this.height - 0.5;
  }

  /** Unit direction in world of the ray through a pixel; distortion undone by fixed-point steps. */
  direction(u: number, v: number): Vec3 {
    const {R, K, distortion} = this.json;
    const b = (v - K[1][2]) / K[1][1];
    const a = (u - K[0][2] - K[0][1] * b) / K[0][0];
    let x = a;
    let y = b;
    for (let i = 0; i < 20; ++i) {
      const [dx, dy] = distort(distortion, x, y);
      x += a - dx;
      y += b - dy;
    }
    const length = Math.hypot(x, y, 1);
    return [0, 1, 2].map((k) => (R[0][k] * x + R[1][k] * y + R[2][k]) / length) as Vec3;
  }
}

// For every point, which vertex of a mesh is nearest: vertices are sorted into cubes first.

const kCubes = 48; // along the longest side of the mesh

let last: {vertices: Float32Array; points: Float32Array; found: Int32Array} | null = null;

/** Index per point; -1 where no vertex is within about a cube's side. The last answer is kept. */
export function nearestVertices(vertices: Float32Array, points: Float32Array): Int32Array {
  if (last?.vertices === vertices && last.points === points) return last.found;
  const cubes = new Cubes(vertices);
  const found = new Int32Array(points.length / 3);
  for (let i = 0; i < found.length; ++i) {
    found[i] = cubes.nearest(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
  }
  last = {vertices, points, found};
  return found;
}

class Cubes {
  private readonly low = [Infinity, Infinity, Infinity];
  private readonly side: number;
  private readonly count = [0, 0, 0]; // of cubes along x, y, z
  private readonly begin: Int32Array; // of each cube's vertices in `order`
  private readonly order: Int32Array;

  constructor(private readonly vertices: Float32Array) {
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < vertices.length; ++i) {
      this.low[i % 3] = Math.min(this.low[i % 3], vertices[i]);
      high[i % 3] = Math.max(high[i % 3], vertices[i]);
    }
    this.side = Math.max(1e-9, ...high.map((x, k) => x - this.low[k])) / kCubes;
    this.count = high.map((x, k) => Math.max(1, Math.floor((x - this.low[k]) / this.side) + 1));
    const cubeOf = new Int32Array(vertices.length / 3);
    this.begin = new Int32Array(this.count[0] * this.count[1] * this.count[2] + 1);
    for (let i = 0; i < cubeOf.length; ++i) {
      const [x, y, z] = [0, 1, 2].map((k) => this.along(vertices[3 * i + k], k));
      cubeOf[i] = this.index(x, y, z);
      ++this.begin[cubeOf[i] + 1];
    }
    for (let c = 1; c < this.begin.length; ++c) this.begin[c] += this.begin[c - 1];
    this.order = new Int32Array(cubeOf.length);
    const next = this.begin.slice();
    cubeOf.forEach((cube, i) => (this.order[next[cube]++] = i));
  }

  private along(x: number, axis: number): number {
    return Math.floor((x - this.low[axis]) / this.side);
  }

  private index(x: number, y: number, z: number): number {
    return (z * this.count[1] + y) * this.count[0] + x;
  }

  nearest(x: number, y: number, z: number): number {
    const {vertices, count} = this;
    const [cx, cy, cz] = [this.along(x, 0), this.along(y, 1), this.along(z, 2)];
    let best = -1;
    let least = this.side * this.side;
    for (let k = Math.max(0, cz - 1); k <= Math.min(count[2] - 1, cz + 1); ++k) {
      for (let j = Math.max(0, cy - 1); j <= Math.min(count[1] - 1, cy + 1); ++j) {
        for (let i = Math.max(0, cx - 1); i <= Math.min(count[0] - 1, cx + 1); ++i) {
          const cube = this.index(i, j, k);
          for (let at = this.begin[cube]; at < this.begin[cube + 1]; ++at) {
            const v = this.order[at];
            const d = (vertices[3 * v] - x) ** 2 + (vertices[3 * v + 1] - y) ** 2 +
              (vertices[3 * v + 2] - z) ** 2;
            if (d < least) {
              least = d;
              best = v;
            }
          }
        }
      }
    }
    return best;
  }
}

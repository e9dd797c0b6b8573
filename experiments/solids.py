"""Solids of the experiments, given by a function that is negative inside, as meshes.

Lengths are mm. A solid is a function of N x 3 points; it changes by at most about 1 per mm, as a
distance does, which lets mesh_of() skip what is far from the surface.
"""

import math

import numpy as np

BLOCK = 8  # cells a side of the blocks that are looked at or left out as a whole


# ---- from a solid to its surface ------------------------------------------------------------------


def mesh_of(solid, low, high, step, steepness=1.5):
    """The surface of a solid within a box, as N x 3 vertices and M x 3 triangles turned outwards.

    Surface nets (Gibson, MICCAI 1998): one vertex per cell that the surface passes, one square per
    edge of the lattice that changes sign; then two Newton steps put every vertex onto the surface.
    `steepness` bounds how fast the solid's function changes per mm."""
    low = np.asarray(low, float)
    cells = np.ceil((np.asarray(high, float) - low) / (step * BLOCK)).astype(int) * BLOCK
    values = _values(solid, low, cells, step, steepness)
    return _nets(solid, values, low, step)


def _values(solid, low, cells, step, steepness):
    """The function at the corners of all cells; away from the surface only its sign is right."""
    blocks = cells // BLOCK
    index = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), -1).reshape(-1, 3)
    middle = solid(low + (index + 0.5) * BLOCK * step)
    values = np.ones(cells + 1, np.float32)
    reach = steepness * BLOCK * step * math.sqrt(3) / 2
    corner = np.stack(np.meshgrid(*[np.arange(BLOCK + 1)] * 3, indexing="ij"), -1)

    def put(at, block):
        x, y, z = at * BLOCK
        values[x:x + BLOCK + 1, y:y + BLOCK + 1, z:z + BLOCK + 1] = block

    for at in index[(middle < -reach)]:
        put(at, -1)
    near = index[np.abs(middle) <= reach]
    for some in np.array_split(near, max(1, len(near) // 200)):
        at = low + (some[:, None, None, None] * BLOCK + corner) * step
        found = solid(at.reshape(-1, 3)).reshape(len(some), *corner.shape[:3])
        for k, block in zip(some, found):
            put(k, block)
    return values


def _nets(solid, values, low, step):
    inside = values < 0
    count = np.zeros(np.array(values.shape) - 1, np.int8)
    total = np.zeros((*count.shape, 3), np.float32)
    edges = []
    for axis in range(3):
        head = [slice(None)] * 3
        tail = [slice(None)] * 3
        head[axis], tail[axis] = slice(1, None), slice(None, -1)
        at = np.argwhere(inside[tuple(head)] != inside[tuple(tail)])
        next_ = at + np.eye(3, dtype=int)[axis]
        a, b = values[tuple(at.T)], values[tuple(next_.T)]
        place = at.astype(np.float32)
        place[:, axis] += a / (a - b)
        others = [k for k in range(3) if k != axis]
        around = []
        for j, k in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
            cell = at.copy()
            cell[:, others[0]] += j
            cell[:, others[1]] += k
            around.append(cell)
            np.add.at(count, tuple(cell.T), 1)
            np.add.at(total, tuple(cell.T), place)
        edges.append((np.stack(around, 1), a < 0, axis))
    number = np.full(count.shape, -1)
    used = count > 0
    number[used] = np.arange(used.sum())
    vertices = low + step * total[used] / count[used][:, None]
    squares = []
    for cells, outwards, axis in edges:
        square = number[cells[..., 0], cells[..., 1], cells[..., 2]]
        turn = outwards if axis != 1 else ~outwards
        squares.append(np.where(turn[:, None], square, square[:, ::-1]))
    squares = np.concatenate(squares)
    for _ in range(2):
        vertices = _onto(solid, vertices, step)
    # The shorter diagonal of each square.
    p = vertices[squares]
    first = np.linalg.norm(p[:, 0] - p[:, 2], axis=1) <= np.linalg.norm(p[:, 1] - p[:, 3], axis=1)
    s = np.where(first[:, None], squares, np.roll(squares, -1, 1))
    return vertices, np.concatenate([s[:, [0, 1, 2]], s[:, [0, 2, 3]]])


def _onto(solid, vertices, step):
    """One Newton step along the gradient, at most half a cell long."""
    h = 0.01 * step
    value = solid(vertices)
    gradient = np.stack([(solid(vertices + h * e) - solid(vertices - h * e)) / (2 * h)
                         for e in np.eye(3)], 1)
    square = np.maximum(np.sum(gradient**2, 1), 0.05)
    move = -(value / square)[:, None] * gradient
    length = np.linalg.norm(move, axis=1, keepdims=True)
    return vertices + move * np.minimum(1, 0.5 * step / np.maximum(length, 1e-12))


# ---- parts ----------------------------------------------------------------------------------------


def ellipsoid(center, radii):
    """First-order distance; exact on the surface."""
    radii = np.asarray(radii, float)

    def solid(p):
        q = (p - center) / radii
        length = np.linalg.norm(q, axis=1)
        slope = np.linalg.norm(q / radii, axis=1)
        return (length - 1) * length / np.maximum(slope, 1e-9)
    return solid


def rod(start, end, radius, end_radius=None):
    """A round rod between two points that may taper."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    axis = end - start
    end_radius = radius if end_radius is None else end_radius

    def solid(p):
        s = np.clip((p - start) @ axis / (axis @ axis), 0, 1)
        return np.linalg.norm(p - start - s[:, None] * axis, axis=1) - (radius + s * (end_radius - radius))
    return solid


def chain(points, radii):
    """Rods one after the other."""
    return union(*[rod(a, b, r, s) for a, b, r, s in zip(points, points[1:], radii, radii[1:])])


def box(center, half, rounding=0.0):
    half = np.asarray(half, float) - rounding

    def solid(p):
        q = np.abs(p - center) - half
        return (np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)) - rounding
    return solid


def cylinder(start, end, radius):
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.linalg.norm(end - start)
    axis = (end - start) / length

    def solid(p):
        along = (p - start) @ axis
        across = np.linalg.norm(p - start - along[:, None] * axis, axis=1) - radius
        caps = np.abs(along - length / 2) - length / 2
        return np.minimum(np.maximum(across, caps), 0) + np.hypot(np.maximum(across, 0), np.maximum(caps, 0))
    return solid


def torus(center, axis, radius, thickness):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)

    def solid(p):
        q = p - center
        along = q @ axis
        across = np.linalg.norm(q - along[:, None] * axis, axis=1) - radius
        return np.hypot(along, across) - thickness
    return solid


def union(*solids, blend=0.0):
    """Of all solids, their seams rounded over `blend` mm (quadratic smooth minimum)."""
    def solid(p):
        result = solids[0](p)
        for other in solids[1:]:
            result = _smooth_min(result, other(p), blend)
        return result
    return solid


def _smooth_min(a, b, blend):
    if blend == 0:
        return np.minimum(a, b)
    h = np.maximum(blend - np.abs(a - b), 0) / blend
    return np.minimum(a, b) - h * h * blend / 4


def without(whole, *parts, blend=0.0):
    def solid(p):
        result = whole(p)
        for part in parts:
            result = -_smooth_min(-result, part(p), blend)
        return result
    return solid


def raised(base, height):
    """A solid whose surface is moved outwards by height(points)."""
    return lambda p: base(p) - height(p)


def waves(seed, wavelengths_mm, heights_mm, directions=9):
    """Smooth noise: per wavelength a sum of plane waves in random directions; `heights_mm` are root
    mean squares."""
    random = np.random.default_rng(seed)
    terms = []
    for length, height in zip(wavelengths_mm, heights_mm):
        k = random.normal(size=(directions, 3))
        k *= 2 * math.pi / length / np.linalg.norm(k, axis=1, keepdims=True)
        terms.append((k, random.uniform(0, 2 * math.pi, directions),
                      height * math.sqrt(2 / directions)))

    def height(p):
        return sum(h * np.sin(p @ k.T + phase).sum(1) for k, phase, h in terms)
    return height

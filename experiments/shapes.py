"""Objects of the experiments: read, or made from formulas."""

import math

import numpy as np

import common


def read_obj(path):
    """Vertices and triangles of an OBJ."""
    vertices, triangles = [], []
    for line in open(path):
        word = line.split()
        if word[:1] == ["v"]:
            vertices.append([float(w) for w in word[1:4]])
        elif word[:1] == ["f"]:
            corner = [int(w.split("/")[0]) - 1 for w in word[1:]]
            triangles += [(corner[0], a, b) for a, b in zip(corner[1:], corner[2:])]
    return np.array(vertices), np.array(triangles)


def bunny():
    """The Stanford bunny upright."""
    vertices, triangles = read_obj(common.BUNNY)
    return vertices[:, [0, 2, 1]] * [1, -1, 1], triangles


def cube(edge, turn_deg=45):
    """A cube with one vertical edge towards +x."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]) * edge / 2
    a = math.radians(turn_deg)
    turn = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    faces = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3),
             (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)]
    return corners @ turn.T, np.array(faces)


def capsule(start, end, radius, end_radius=None, around=24, along=24, cap=6):
    """A round rod between two points, closed by half balls; it may taper."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    end_radius = radius if end_radius is None else end_radius
    axis = end - start
    length = np.linalg.norm(axis)
    axis /= length
    side = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.8 else [0, 1, 0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    profile = [(-radius * math.cos(t), radius * math.sin(t))
               for t in np.linspace(0, math.pi / 2, cap + 1)]
    profile += [(length * s, radius + (end_radius - radius) * s)
                for s in np.linspace(0, 1, along + 1)[1:-1]]
    profile += [(length + end_radius * math.sin(t), end_radius * math.cos(t))
                for t in np.linspace(0, math.pi / 2, cap + 1)]
    vertices = [start + axis * profile[0][0]]
    for z, r in profile[1:-1]:
        for k in range(around):
            a = 2 * math.pi * k / around
            vertices.append(start + axis * z + r * (math.cos(a) * side + math.sin(a) * other))
    vertices.append(start + axis * profile[-1][0])
    rings, faces, last = len(profile) - 2, [], len(vertices) - 1
    for k in range(around):
        n = (k + 1) % around
        faces.append((0, 1 + n, 1 + k))
        for ring in range(rings - 1):
            a, b = 1 + ring * around, 1 + (ring + 1) * around
            faces += [(a + k, a + n, b + n), (a + k, b + n, b + k)]
        bottom = 1 + (rings - 1) * around
        faces.append((bottom + k, bottom + n, last))
    return np.array(vertices), np.array(faces)


def joined(parts):
    """Several meshes as one."""
    vertices = np.concatenate([v for v, _ in parts])
    offsets = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    return vertices, np.concatenate([f + o for (_, f), o in zip(parts, offsets)])


# Fingers of the hand: name, root and tip (y, z in mm, seen from +x), thickness beside the middle one.
FINGERS = [("thumb", (42, -38), (92, 8), 1.15), ("index", (27, 20), (40, 92), 1.0),
           ("middle", (9, 25), (12, 106), 1.0), ("ring", (-9, 23), (-16, 97), 0.95),
           ("little", (-26, 16), (-45, 72), 0.8)]


def hand(thickness):
    """An open hand that faces +x with fingers of this diameter, and the axes of its fingers (root,
    tip, radius). Parts overlap; the simulator shows their union from outside."""
    palm = [capsule((0, y, -52), (0, y, 12), 13, 13) for y in (-24, -12, 0, 12, 24)]
    palm += [capsule((0, 8, -95), (0, 8, -50), 21), capsule((0, 30, -55), (0, 42, -38), 13)]
    fingers = {}
    for name, root, tip, factor in FINGERS:
        radius = thickness * factor / 2
        start, end = np.array([0, *root], float), np.array([12, *tip], float)
        end -= (end - start) / np.linalg.norm(end - start) * 0.85 * radius
        fingers[name] = (start, end, radius)
    rods = [capsule(a, b, r, 0.85 * r) for a, b, r in fingers.values()]
    return (*joined(palm + rods), fingers)


def ball(center, radius, around=96):
    """A sphere."""
    vertices, triangles = capsule((0, 0, -1e-6 * radius), (0, 0, 1e-6 * radius), radius,
                                  around=around, along=1, cap=around // 4)
    return vertices + np.asarray(center), triangles


def knot(radius, thickness, around=48, along=600):
    """A trefoil tube: every view has depth steps within the object."""
    t = np.linspace(0, 2 * math.pi, along, endpoint=False)
    line = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], 1)
    line *= (radius - thickness / 2) / np.linalg.norm(line, axis=1).max()
    tangent = np.roll(line, -1, 0) - np.roll(line, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, line)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(tangent, side)
    a = np.linspace(0, 2 * math.pi, around, endpoint=False)[None, :, None]
    vertices = line[:, None] + thickness / 2 * (np.cos(a) * side[:, None] + np.sin(a) * other[:, None])
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    p, q = i * around + j, i * around + (j + 1) % around
    r, s = (i + 1) % along * around + j, (i + 1) % along * around + (j + 1) % around
    triangles = np.concatenate([np.stack([p, q, r], -1), np.stack([q, s, r], -1)]).reshape(-1, 3)
    return vertices.reshape(-1, 3), triangles

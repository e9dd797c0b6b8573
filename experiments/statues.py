"""Objects that nothing was fitted on: makers of meshes for heldout.py. Every maker takes a seed,
which chooses details where the object has any to choose."""

import math

import numpy as np

import solids
from solids import box, chain, cylinder, ellipsoid, raised, rod, torus, union, waves, without


def bust(seed=0):
    """Head, neck and shoulders on a plinth, 300 mm: smooth, with a face, ears and hair."""
    face = union(ellipsoid((0, 0, 75), (66, 54, 76)), ellipsoid((22, 0, 45), (44, 40, 52)), blend=20)
    face = union(face, rod((60, 0, 88), (76, 0, 62), 6, 10), rod((52, -26, 96), (52, 26, 96), 10),
                 rod((58, -14, 33), (58, 14, 33), 7), ellipsoid((52, 0, 8), (16, 18, 14)), blend=12)
    face = without(face, ellipsoid((68, -24, 80), (9, 13, 8)), ellipsoid((68, 24, 80), (9, 13, 8)),
                   rod((68, -13, 33), (68, 13, 33), 1.6), blend=6)
    face = union(face, ellipsoid((62, -23, 80), (7, 10, 7)), ellipsoid((62, 23, 80), (7, 10, 7)), blend=3)
    ears = [union(torus((-4, side * 55, 70), (0.3, 1, 0), 15, 5),
                  ellipsoid((-4, side * 52, 68), (12, 4, 14)), blend=5) for side in (-1, 1)]
    curls = waves(100 + seed, (34, 17), (2.4, 1.0))

    def hair(p):
        where = np.clip((p[:, 2] - 85 - 0.55 * p[:, 0]) / 22, 0, 1)
        return where * (5 + curls(p))
    head = union(raised(face, hair), *ears, blend=6)
    body = union(rod((-6, 0, 30), (-16, 0, -62), 36, 40),
                 rod((-18, -78, -92), (-18, 78, -92), 34), ellipsoid((4, 0, -104), (58, 92, 44)),
                 blend=28)
    cut = without(body, box((0, 0, -190), (200, 200, 72)), blend=6)
    foot = union(cylinder((-8, 0, -130), (-8, 0, -112), 34), cylinder((-8, 0, -158), (-8, 0, -126), 52),
                 blend=6)
    return solids.mesh_of(union(head, cut, foot, blend=14), (-110, -130, -165), (110, 130, 170), 1.6)


def vase(seed=0):
    """A fluted, twisted vase with two handles, 290 mm: solid, smooth, of one's own period."""
    phase = np.random.default_rng(200 + seed).uniform(0, 2 * math.pi)
    heights = np.array([-145, -130, -70, 0, 60, 95, 125, 145])
    radii = np.array([52, 58, 86, 92, 62, 40, 44, 58])
    profile = np.poly1d(np.polyfit(heights, radii, 6))

    def body(p):
        turn = np.arctan2(p[:, 1], p[:, 0])
        z = np.clip(p[:, 2], -145, 145)
        radius = profile(z) + 3.2 * np.cos(14 * turn + 0.022 * z + phase)
        return (np.hypot(p[:, 0], p[:, 1]) - radius) / 1.35
    closed = without(body, box((0, 0, -245), (300, 300, 100)), box((0, 0, 245), (300, 300, 100)), blend=4)
    hollow = ellipsoid((0, 0, 165), (46, 46, 55))
    handles = [torus((0, side * 74, 62), (1, 0, 0), 32, 8) for side in (-1, 1)]
    return solids.mesh_of(without(union(closed, *handles, blend=8), hollow, blend=4),
                          (-120, -130, -160), (120, 130, 160), 1.6)


def gyroid(seed=0):
    """A ball of walls 11 mm thick after Schoen's gyroid: holes, tunnels, deep shadows."""
    shift = np.random.default_rng(300 + seed).uniform(0, 2 * math.pi, 3)
    k = 2 * math.pi / 105

    def walls(p):
        x, y, z = (k * p + shift).T
        g = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        return np.abs(g) / (1.5 * k) - 5.5
    return solids.mesh_of(without(walls, lambda p: 125 - np.linalg.norm(p, axis=1), blend=6),
                          (-130, -130, -130), (130, 130, 130), 1.6)


def bent_hand(seed=0):
    """A hand whose fingers are bent by 20 to 55 degrees a joint: they shadow each other and the palm."""
    random = np.random.default_rng(400 + seed)
    palm = [rod((0, y, -48), (4, y * 1.08, 14), 14, 12) for y in (-28, -14, 0, 14, 28)]
    parts = [union(*palm, blend=14), rod((0, 4, -110), (0, 4, -52), 24, 23)]
    for y, length, radius, bend in ((30, 34, 8.6, 20), (11, 39, 9.0, 32), (-9, 36, 8.6, 44), (-28, 28, 7.4, 55)):
        at, angle = np.array([4.0, y, 14.0]), math.radians(8)
        points, radii = [at], [radius * 1.1]
        for factor in (1.15, 0.75, 0.6):
            angle += math.radians(bend + random.uniform(-4, 4))
            at = at + factor * length * np.array([math.sin(angle), 0.05 * np.sign(y), math.cos(angle)])
            points.append(at)
            radii.append(radii[-1] * 0.92)
        parts.append(chain(points, radii))
    parts.append(chain([np.array(p, float) for p in ((2, 30, -44), (20, 50, -16), (44, 52, 10), (62, 44, 26))],
                       [14, 12, 10.5, 9]))
    return solids.mesh_of(union(*parts, blend=7), (-40, -60, -140), (110, 75, 120), 1.2)


def person(seed=0):
    """A standing person of 1.7 m in clothes, arms off the body. Origin at half the height."""
    random = np.random.default_rng(500 + seed)
    swing = random.uniform(-40, 40)

    def at(x, y, z):
        return np.array([x, y, z - 850.0])
    limbs = []
    for side in (-1, 1):
        step = side * swing
        limbs.append(chain([at(0, side * 95, 880), at(step, side * 108, 480), at(1.6 * step - 15, side * 112, 90)],
                           [92, 62, 45]))
        limbs.append(rod(at(1.6 * step - 30, side * 112, 42), at(1.6 * step + 120, side * 128, 34), 42, 34))
        limbs.append(chain([at(-5, side * 185, 1390), at(-20 - step, side * 300, 1130),
                            at(90 - step, side * 330, 930), at(120 - step, side * 335, 850)],
                           [62, 48, 36, 34]))
    trunk = union(ellipsoid(at(0, 0, 930), (125, 175, 130)), ellipsoid(at(0, 0, 1130), (108, 150, 180)),
                  ellipsoid(at(0, 0, 1310), (122, 180, 150)), blend=80)
    head = union(rod(at(-5, 0, 1440), at(5, 0, 1540), 58, 55), ellipsoid(at(15, 0, 1590), (98, 76, 112)),
                 rod(at(105, 0, 1600), at(122, 0, 1565), 12, 16), blend=30)
    folds = waves(510 + seed, (210, 90), (5, 2.2))

    def cloth(p):
        height = p[:, 2] + 850
        return folds(p) * np.clip((height - 120) / 60, 0, 1) * np.clip((1420 - height) / 60, 0, 1)
    whole = union(raised(union(trunk, *limbs, blend=45), cloth), head, blend=25)
    return solids.mesh_of(whole, (-330, -460, -870), (360, 460, 880), 7)


def dragon(seed=0):
    """A scaled body that winds through itself (a torus knot), thick and thin, 290 mm across."""
    around, along = 96, 2400
    t = np.linspace(0, 2 * math.pi, along, endpoint=False)
    big = 92 + 34 * np.cos(5 * t)
    line = np.stack([big * np.cos(2 * t), big * np.sin(2 * t), 46 * np.sin(5 * t)], 1)
    tangent = np.roll(line, -1, 0) - np.roll(line, 1, 0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0, 0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    a = np.linspace(0, 2 * math.pi, around, endpoint=False)
    phase = np.random.default_rng(600 + seed).uniform(0, 2 * math.pi, 2)
    body = 13 + 4.5 * np.sin(2 * t + phase[0]) + 1.5 * np.sin(7 * t + phase[1])
    scales = np.abs(np.sin(6 * a)[None] * np.sin(90 * t)[:, None]) ** 0.7 - 0.5
    crest = np.exp(-((a - math.pi / 2) / 0.22) ** 2)[None] * (2.6 + 2.2 * np.cos(60 * t))[:, None]
    radius = body[:, None] + 0.9 * scales + crest
    vertices = (line[:, None] + (radius * np.cos(a))[..., None] * side[:, None]
                + (radius * np.sin(a))[..., None] * up[:, None])
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    p, q = i * around + j, i * around + (j + 1) % around
    r, s = (i + 1) % along * around + j, (i + 1) % along * around + (j + 1) % around
    triangles = np.concatenate([np.stack([p, r, q], -1), np.stack([q, r, s], -1)]).reshape(-1, 3)
    return vertices.reshape(-1, 3), triangles


def rock(seed=0):
    """A boulder of 250 mm: noise from 200 mm down to ripples of 9 mm, half a millimetre high."""
    relief = waves(700 + seed, (190, 90, 45, 20, 9), (13, 6.5, 3, 1.1, 0.45))
    return solids.mesh_of(raised(lambda p: np.linalg.norm(p, axis=1) - 122, relief),
                          (-190, -190, -190), (190, 190, 190), 1.6, steepness=3)


def part(seed=0):
    """A machined part: plate, bosses, bores, a rib; planes, edges and holes."""
    random = np.random.default_rng(800 + seed)
    plate = box((0, 0, -40), (105, 80, 14), 2)
    wall = box((-85, 0, 25), (14, 80, 75), 2)
    rib = rod((-70, 0, 30), (40, 0, -30), 12)
    boss = cylinder((45, 30, -40), (45, 30, 30), 32)
    pin = cylinder((50, -45, -40), (50, -45, 55), 14)
    bores = [cylinder((45, 30, -10), (45, 30, 60), 19), cylinder((-120, 35, 55), (-50, 35, 55), 22),
             cylinder((-120, -35, 60), (-50, -35, 60), 10 + random.uniform(0, 6))]
    whole = without(union(plate, wall, rib, boss, pin, blend=3), *bores, blend=1.5)
    return solids.mesh_of(whole, (-125, -95, -65), (125, 95, 115), 1.3)

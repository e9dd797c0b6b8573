"""Files that tests make and compare."""

import hashlib
import os
import struct
import zlib
from math import cos, pi, sin


def all_files(folder):
    for root, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            yield os.path.join(root, name)


def sums(folder, but=()):
    """What every file holds, but for what says how long it took, who did it, and files with these
    names."""
    found = {}
    for path in all_files(folder):
        if path.endswith("/timing.json") or ".job/" in path or os.path.basename(path) in but:
            continue
        with open(path, "rb") as f:
            data = f.read()
        found[os.path.relpath(path, folder)] = hashlib.sha256(data).hexdigest()
    return found


def write_ball(path, radius=90, rings=24, sectors=48):
    """An OBJ of a sphere about the origin."""
    points = [(radius * sin(pi * r / rings) * cos(2 * pi * s / sectors),
               radius * sin(pi * r / rings) * sin(2 * pi * s / sectors),
               radius * cos(pi * r / rings)) for r in range(rings + 1) for s in range(sectors)]
    with open(path, "w") as f:
        for p in points:
            f.write("v %f %f %f\n" % p)
        for r in range(rings):
            for s in range(sectors):
                a, b = r * sectors + s, r * sectors + (s + 1) % sectors
                c, d = a + sectors, b + sectors
                f.write(f"f {a + 1} {c + 1} {d + 1}\nf {a + 1} {d + 1} {b + 1}\n")


def read_png(path):
    """Rows of RGB bytes of a PNG as the program writes it: 8 bit, three channels."""
    with open(path, "rb") as f:
        data = f.read()
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, bits, color = struct.unpack(">IIBB", data[at + 8:at + 18])
            assert (bits, color) == (8, 2)
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    raw, stride, rows, above = zlib.decompress(packed), 3 * width, [], bytes(3 * width)
    for y in range(height):
        method, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:][:stride])
        for i in range(stride):
            a, b = row[i - 3] if i >= 3 else 0, above[i]
            c = above[i - 3] if i >= 3 else 0
            near = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            row[i] = (row[i] + (0, a, b, (a + b) // 2, near)[method]) & 255
        rows.append(bytes(row))
        above = row
    return rows


def write_png(path, rows):
    chunk = lambda kind, data: (struct.pack(">I", len(data)) + kind + data +
                                struct.pack(">I", zlib.crc32(kind + data)))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" +
                chunk(b"IHDR", struct.pack(">IIBBBBB", len(rows[0]) // 3, len(rows), 8, 2, 0, 0, 0))
                + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows)))
                + chunk(b"IEND", b""))


def write_tiff(path, rows, bytes_per_value):
    """RGB as one strip: 8 bit, or float (4) in [0, 1] and what else a float may be."""
    width, height, data = len(rows[0]) // 3, len(rows), b""
    if bytes_per_value == 1:
        data = b"".join(rows)
    else:
        data = b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows)
    fields = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 3, 8), (259, 3, 1, 1),
              (262, 3, 1, 2), (273, 4, 1, 20), (277, 3, 1, 3), (278, 4, 1, height),
              (279, 4, 1, len(data)), (339, 3, 3, 14)]
    bits, kind = 8 * bytes_per_value, 1 if bytes_per_value == 1 else 3
    with open(path, "wb") as f:
        f.write(b"II*\0" + struct.pack("<I", 20 + len(data)) + struct.pack("<6H", *[bits] * 3,
                                                                           *[kind] * 3) + data)
        f.write(struct.pack("<H", len(fields)))
        for field in fields:
            f.write(struct.pack("<HHII", *field))
        f.write(struct.pack("<I", 0))


def turn_camera(rig, name, px):
    """Turns a camera of a rig about its x axis, so that its picture moves by so many pixels."""
    camera = next(c for c in rig["cameras"] if c["name"] == name)
    angle = px / camera["K"][1][1]
    c, s = cos(angle), sin(angle)
    (_, *rows), (x, y, z) = camera["R"], camera["t"]
    camera["R"][1] = [c * a - s * b for a, b in zip(*rows)]
    camera["R"][2] = [s * a + c * b for a, b in zip(*rows)]
    camera["t"] = [x, c * y - s * z, s * y + c * z]

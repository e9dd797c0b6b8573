"""Whether files are whole: every one that a command leaves parses to its end."""

import json
import os
import re
import struct
import sys
import zlib

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from files import all_files

PLY_SIZES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4,
             "double": 8}
UNFINISHED = re.compile(r"\.part\d+_\d+$|\.partial$|^\.making")


class Broken(Exception):
    """A rule of this harness does not hold."""


def is_unfinished(path, folder):
    """Under a name that says that it is not done yet."""
    return any(UNFINISHED.search(part) for part in os.path.relpath(path, folder).split(os.sep))


def ply_is_whole(data):
    head, end, body = data.partition(b"end_header\n")
    if not end or b"binary_little_endian" not in head:
        return False
    at, elements = 0, []
    for line in head.decode().splitlines():
        words = line.split()
        if words[0] == "element":
            elements.append([int(words[2]), []])
        elif words[0] == "property":
            elements[-1][1].append(words[1:-1])
    for count, properties in elements:
        if any(p[0] == "list" for p in properties):
            for _ in range(count):
                for p in properties:
                    at += 1 + body[at] * PLY_SIZES[p[2]] if p[0] == "list" else PLY_SIZES[p[0]]
        else:
            at += count * sum(PLY_SIZES[p[0]] for p in properties)
    return at == len(body)


def png_is_whole(data):
    at, pixels = 8, b""
    while at + 12 <= len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if struct.pack(">I", zlib.crc32(kind + body)) != data[at + 8 + length:at + 12 + length]:
            return False
        if kind == b"IDAT":
            pixels += body
        at += 12 + length
        if kind == b"IEND":
            return at == len(data) and bool(zlib.decompress(pixels))
    return False


def is_whole(path):
    """Also of names without an ending that is known: there is no telling, they are."""
    with open(path, "rb") as f:
        data = f.read()
    name = os.path.basename(path)
    try:
        if name.endswith(".json") or name in (".zgroup", ".zattrs", ".zarray"):
            json.loads(data)
            return True
        if name.endswith(".ply"):
            return ply_is_whole(data)
        if name.endswith(".png"):
            return png_is_whole(data)
        if name.endswith(".jpg"):
            return data.startswith(b"\xff\xd8") and data.endswith(b"\xff\xd9")
        if name.endswith((".tiff", ".tif")):
            (directory,) = struct.unpack("<I", data[4:8])
            return data.startswith(b"II*\0") and directory < len(data)
        if name.endswith(".stl"):
            return len(data) == 84 + 50 * struct.unpack("<I", data[80:84])[0]
        if name.endswith(".glb"):
            return len(data) == struct.unpack("<I", data[8:12])[0]
        if name.endswith((".csv", ".obj", ".html", ".usda")):
            return data.endswith(b"\n")
    except (ValueError, struct.error, zlib.error, IndexError, KeyError):
        return False
    return True


def check_whole(folder, is_over):
    """Every file is whole, every frame's folder has a report or a reason. `is_over`: the command
    ended by itself, so that nothing unfinished stays either."""
    for path in all_files(folder):
        name = os.path.relpath(path, folder)
        if is_unfinished(path, folder):
            if is_over:
                raise Broken(f"{name} was left behind")
        elif not is_whole(path):
            raise Broken(f"{name} is not whole")
    for name in os.listdir(folder) if os.path.exists(os.path.join(folder, "inputs.json")) else ():
        inside = os.path.join(folder, name)
        if re.fullmatch(r"\d{6}", name) and not {"report.json", "failure.json"} & set(
                os.listdir(inside)):
            raise Broken(f"{name} has neither report nor reason")

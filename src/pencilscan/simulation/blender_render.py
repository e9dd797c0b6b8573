"""Path-traces the frames of a rig with Cycles: blender -b -P render.py [-- camera ...]

Reads scene.json and film/ beside this file, renders each of objects/*.ply into
light/<frame>/<camera>.png (linear light, 16 bit); pictures that are there stay. Edit scene.json for
more than a matt object; lengths are in the rig's unit:

  samples, bounces   paths per pixel; reflections that light may take (0: only what projectors light)
  ambient            even light from all around: image value of a white surface; what is behind the
                     object stays black
  aperture           diameter of the cameras' lenses, focused at reference_distance
  material           inputs of Blender's Principled BSDF by name ("Base Color", "Roughness",
                     "Subsurface", "Subsurface Color", "Subsurface Radius" ...), or a matt "Color"
  floor              {"radius", "albedo"}: a disc on which the object stands
  room               {"half", "albedo"}: walls around, so far from the middle; its floor is the disc's,
                     or the object's lowest point
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

FOLDER = Path(__file__).resolve().parent
SCENE = json.loads((FOLDER / "scene.json").read_text())
UNIT = 10 / SCENE["reference_distance"]  # Blender's units per unit of the rig: floats fit any rig


def settings():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = SCENE["samples"]
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"  # the lens's blur is the sensor's
    cycles.filter_width = 1
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(cycles, kind + "_bounces", SCENE["bounces"])
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    scene.view_settings.view_transform = "Raw"
    scene.render.dither_intensity = 0
    scene.render.resolution_percentage = 100
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "PNG", "RGB", "16"
    scene.world = bpy.data.worlds.new("surroundings")
    scene.world.use_nodes = True
    scene.render.film_transparent = True  # cameras see no light behind the object
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (*[SCENE["ambient"]] * 3, 1)
    return scene


def placed(scene, name, data, device):
    """An object of Blender where a device is: x right, y up, it looks along -z."""
    rotation = np.array(device["R"])
    pose = np.eye(4)
    pose[:3, :3] = rotation.T @ np.diag([1, -1, -1])
    pose[:3, 3] = -rotation.T @ np.array(device["t"]) * UNIT
    thing = bpy.data.objects.new(name, data)
    thing.matrix_world = Matrix(pose.tolist())
    scene.collection.objects.link(thing)
    return thing


def node(tree, kind, *inputs, **settings):
    """A node of a shader whose inputs are numbers or outputs of other nodes; its outputs."""
    made = tree.nodes.new("ShaderNode" + kind)
    for name, value in settings.items():
        setattr(made, name, value)
    for i, value in enumerate(inputs):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, made.inputs[i])
        else:
            made.inputs[i].default_value = value
    return made.outputs


def add_projector(scene, device):
    low, high = np.reshape(device["film"], (2, 2))
    light = bpy.data.lights.new(device["name"], "POINT")
    light.shadow_soft_size = 0
    # Radiant intensity is a point light's power over 4 pi; a matt surface shows a pi-th of it.
    light.energy = 4 * math.pi**2 * SCENE["exposure"]
    light.use_nodes = True
    tree = light.node_tree
    emission = tree.nodes["Emission"]
    if SCENE["falloff"]:
        light.energy *= (SCENE["reference_distance"] * UNIT) ** 2
    else:
        (_, _, constant) = node(tree, "LightFalloff", 1.0)
        tree.links.new(constant, emission.inputs["Strength"])
    x, y, z = node(tree, "SeparateXYZ", node(tree, "TexCoord")["Normal"])
    minus_z = node(tree, "Math", z, -1.0, operation="MULTIPLY")[0]
    share = []
    for axis, value, sign in ((0, x, 1.0), (1, y, -1.0)):  # panel rows go down
        ray = node(tree, "Math", value, minus_z, operation="DIVIDE")[0]
        scale = sign / (high[axis] - low[axis])
        share.append(node(tree, "Math", ray, scale, -low[axis] * sign * scale, operation="MULTIPLY_ADD")[0])
    place = node(tree, "CombineXYZ", share[0], node(tree, "Math", 1.0, share[1], operation="SUBTRACT")[0])[0]
    film = bpy.data.images.load(str(FOLDER / "film" / (device["name"] + ".png")))
    film.colorspace_settings.name = "Non-Color"
    color = node(tree, "TexImage", place, image=film, extension="CLIP", interpolation="Linear")[0]
    ahead = node(tree, "Math", minus_z, 0.0, operation="GREATER_THAN")[0]
    lit = node(tree, "VectorMath", color, operation="SCALE")
    tree.links.new(ahead, lit[0].node.inputs["Scale"])
    tree.links.new(lit[0], emission.inputs["Color"])
    placed(scene, device["name"], light, device)


def add_camera(scene, device):
    width, height, K = device["width"], device["height"], np.array(device["K"])
    camera = bpy.data.cameras.new(device["name"])
    camera.sensor_fit = "HORIZONTAL"
    camera.lens = camera.sensor_width * K[0, 0] / width
    camera.shift_x = ((width - 1) / 2 - K[0, 2]) / width
    camera.shift_y = (K[1, 2] - (height - 1) / 2) / width * K[0, 0] / K[1, 1]
    camera.clip_start, camera.clip_end = 0.01, 10000
    if SCENE["aperture"]:
        camera.dof.use_dof = True
        camera.dof.focus_distance = SCENE["reference_distance"] * UNIT
        camera.dof.aperture_fstop = camera.lens * 1e-3 / (SCENE["aperture"] * UNIT)
    return placed(scene, device["name"], camera, device)


def material(values):
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    tree = made.node_tree
    if "Color" in values:
        shader = node(tree, "BsdfDiffuse", values["Color"], 0.0)
        tree.links.new(shader[0], tree.nodes["Material Output"].inputs["Surface"])
        return made
    shader = tree.nodes["Principled BSDF"]
    shader.subsurface_method = "RANDOM_WALK"
    for name, value in values.items():
        if name == "Subsurface Radius":
            value = [v * UNIT for v in value]
        shader.inputs[name].default_value = value
    return made


def add_mesh(scene, name, vertices, faces, values, smooth=False):
    data = bpy.data.meshes.new(name)
    data.from_pydata((np.asarray(vertices, float) * UNIT).tolist(), [], np.asarray(faces).tolist())
    data.update()
    data.polygons.foreach_set("use_smooth", [smooth] * len(data.polygons))
    data.materials.append(material(values))
    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    return thing


def matt(albedo):
    return {"Color": [albedo] * 3 + [1]}


def add_surroundings(scene, bottom):
    things = []
    floor, room = SCENE.get("floor"), SCENE.get("room")
    if floor:
        angles = np.linspace(0, 2 * math.pi, 96, endpoint=False)
        ring = [[floor["radius"] * math.cos(a), floor["radius"] * math.sin(a), bottom] for a in angles]
        things.append(add_mesh(scene, "floor", ring, [list(range(96))], matt(floor["albedo"])))
    if room:
        half, low = room["half"], bottom - (1e-3 * room["half"] if floor else 0)
        corners = [[x, y, z] for z in (low, low + 2 * half) for y in (-half, half) for x in (-half, half)]
        walls = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        things.append(add_mesh(scene, "room", corners, walls, matt(room["albedo"])))
    return things


def read_ply(path):
    """Vertices and triangles of a binary PLY file of pencilscan's."""
    types = {"float": "<f4", "double": "<f8", "uchar": "u1"}
    data = path.read_bytes()
    start = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:start].decode().splitlines()]
    counts = {w[1]: int(w[2]) for w in words if w[0] == "element"}
    layout = [(w[2], types[w[1]]) for w in words if w[0] == "property" and w[1] != "list"]
    vertices = np.frombuffer(data, layout, counts["vertex"], start)
    faces = np.frombuffer(data, [("n", "u1"), ("at", "<i4", 3)], counts["face"], start + vertices.nbytes)
    return np.stack([vertices[a] for a in "xyz"], 1).astype(float), faces["at"]


def render(scene, camera, device, path, seed):
    scene.camera = camera
    scene.cycles.seed = seed
    scene.render.resolution_x, scene.render.resolution_y = device["width"], device["height"]
    K = device["K"]
    # Pixels are wider where fx is smaller; Blender takes only ratios of at least 1.
    ratio = K[1][1] / K[0][0]
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1, ratio), max(1, 1 / ratio)
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main():
    scene = settings()
    for device in SCENE["projectors"]:
        add_projector(scene, device)
    cameras = [add_camera(scene, device) for device in SCENE["cameras"]]
    asked = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    objects = sorted((FOLDER / "objects").glob("*.ply"))
    for frame, path in enumerate(objects):
        vertices, faces = read_ply(path)
        things = [add_mesh(scene, "object", vertices, faces, SCENE["material"], SCENE["smooth"])]
        things += add_surroundings(scene, vertices[:, 2].min())
        for c, (camera, device) in enumerate(zip(cameras, SCENE["cameras"])):
            picture = FOLDER / "light" / path.stem / (device["name"] + ".png")
            if picture.exists() or (asked and device["name"] not in asked):
                continue
            render(scene, camera, device, picture, frame * len(cameras) + c)
        for thing in things:
            bpy.data.objects.remove(thing)


main()

#!/usr/bin/python3
"""Wrong pictures: is what was done to a frame named, and is a right frame let alone?

Three objects before six cameras and six projectors, ten kinds of mistakes, each done to cameras that
are drawn. A mistake is named where the warnings name the devices that it was done to, no others, and
the fault. Right frames are those of the objects at three levels of noise and two pitches. "turned" is a
camera that stands 10 to 80 px beside where the rig has it, "out of focus" a blur of a third of the lines'
distance: both may show only on the surface, so that frames have one there.
"""

import json
import shutil

import cv2
import numpy as np

import common
import objects

WORDS = {  # kind: these stand in the warning
    "exchanged": "exchange their files", "upside down": "half a turn", "mirrored": "left for right",
    "blue and red": "red and blue", "grey": "is grey", "repeated": "is the same as", "black": "is black",
    "moved": "does not fit", "turned": "moved", "out of focus": "out of focus"}
WITH_MESH = {"turned", "out of focus"}


def spoiled(kind, pictures, random):
    """The pictures after the mistake, and the numbers of the cameras that it was done to."""
    pictures = list(pictures)
    a, b = random.choice(len(pictures), 2, replace=False)
    height, width = pictures[a].shape[:2]
    if kind == "exchanged":
        pictures[a], pictures[b] = pictures[b], pictures[a]
        return pictures, {a, b}
    if kind == "repeated":
        return [pictures[a]] * len(pictures), set(range(len(pictures))) - {a}
    if kind == "grey":
        return [cv2.cvtColor(cv2.cvtColor(p, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR) for p in pictures], \
            set(range(len(pictures)))
    if kind == "moved":
        move = cv2.getRotationMatrix2D((width / 2, height / 2), random.choice([0, 4]), 1)
        move[:, 2] += (width / 160) * np.sign(random.normal(size=2)) if move[0, 1] == 0 else 0
        pictures[a] = cv2.warpAffine(pictures[a], move, (width, height))
    elif kind == "turned":  # about an axis in the picture: it moves along x or y
        way = np.array([[1, 0, 0], [0, 1, 0]], float)
        way[random.integers(2), 2] = random.choice([-1, 1]) * 10 * 2 ** random.uniform(0, 3)
        pictures[a] = cv2.warpAffine(pictures[a], way, (width, height))
    elif kind == "out of focus":
        pictures[a] = cv2.GaussianBlur(pictures[a], (0, 0), width / 1280 * 12 / 3)
    else:
        pictures[a] = {"upside down": lambda p: p[::-1, ::-1], "mirrored": lambda p: p[:, ::-1],
                       "blue and red": lambda p: p[..., ::-1], "black": lambda p: random.integers(0, 4, p.shape).astype(p.dtype)}[kind](pictures[a])
    return pictures, {a}


def warnings_of(program, rig, frames, out, with_mesh=False):
    """Text and devices of the wrong pictures that `reconstruct` names, and its refusal if it refuses."""
    shutil.rmtree(out, ignore_errors=True)
    done = program("reconstruct", "--rig", rig, "--frames", frames, "--out", out, "--no-pictures",
                   *([] if with_mesh else ["--no-mesh"]), may_fail=True)
    if done is None:
        return program.complaint, set()
    report = json.loads((out / "000000/report.json").read_text())
    found = [f for f in report["findings"] if f["code"] in ("wrong-picture", "missing-lines", "out-of-focus")]
    return " ".join(f["text"] for f in found), {f["device"] for f in found}


def scene(args, program, name, pitch, noise):
    folder = args.out / "scenes" / f"{name}_{pitch}_{noise}"
    if not (folder / "scene/rig.json").exists():
        common.write_ply(folder / "mesh.ply", *objects.OBJECTS[name][1]())
        program("rig", "ring", "--overwrite", "--out", folder / "rig.json", "--pitch-px", pitch, json_output=False)
        program("simulate", "--rig", folder / "rig.json", "--mesh", folder / "mesh.ply", "--noise", noise, "--fit",
                "--out", folder / "scene", "--overwrite")
    return folder


def exchanged_projectors(args, program, folder, count):
    """Frames of projectors that show each other's patterns: name of the pair, what is said, whether rightly."""
    rig = json.loads((folder / "scene/rig.json").read_text())
    projectors = rig["projectors"]
    pairs = [(a, b) for b in range(len(projectors)) for a in range(b)
             if projectors[a]["pattern"] != projectors[b]["pattern"]]
    for a, b in pairs[:: max(1, len(pairs) // count)][:count]:
        shown = json.loads(json.dumps(rig))
        for one, other in ((a, b), (b, a)):
            shown["projectors"][one]["pattern"] = projectors[other]["pattern"]
        path = common.write_rig(args.out / "shown.json", shown)
        program("simulate", "--rig", path, "--mesh", folder / "mesh.ply", "--noise", "medium", "--fit", "--out",
                args.out / "shown", "--overwrite")
        text, _ = warnings_of(program, folder / "scene/rig.json", args.out / "shown/frames", args.out / "result")
        names = f"{projectors[a]['name']} and {projectors[b]['name']}"
        yield names, text, f"projectors {names} show each other's patterns" in text


def main():
    args = common.arguments("wrong_pictures", __doc__, only=("bunny,horse,hand", "bunny"), draws=(1, 1),
                            pairs=(9, 1))
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["object", "kind", "draw"], ["is_named", "text"], args.resume)
    for number, name in enumerate(args.only.split(",")):
        folder = scene(args, program, name, 12, "medium")
        right = sorted((folder / "scene/frames/000000").glob("cam*.png"))
        pictures = [cv2.imread(str(p)) for p in right]
        for kind_number, kind in enumerate(WORDS):
            for draw in range(args.draws):
                if rows.has(object=name, kind=kind, draw=draw):
                    continue
                random = np.random.default_rng([number, kind_number, draw])
                wrong, cameras = spoiled(kind, pictures, random)
                frames = args.out / "frames"
                shutil.rmtree(frames, ignore_errors=True)
                (frames / "000000").mkdir(parents=True)
                for path, picture in zip(right, wrong):
                    cv2.imwrite(str(frames / "000000" / path.name), picture)
                text, devices = warnings_of(program, folder / "scene/rig.json", frames, args.out / "result",
                                            kind in WITH_MESH)
                told = {right[c].stem for c in cameras}
                is_named = WORDS[kind] in text and \
                    (devices == told if devices else all(d in text for d in told))
                rows.add(object=name, kind=kind, draw=draw, is_named=int(is_named), text=text[:300])
                common.progress(f"wrong_pictures: {name}, {kind}, {sorted(told)}: {'named' if is_named else text}")
        for pair, text, is_named in exchanged_projectors(args, program, folder, args.pairs):
            rows.add(object=name, kind=f"projectors {pair}", draw=0, is_named=int(is_named), text=text[:300])
            common.progress(f"wrong_pictures: {name}, {pair} exchanged: {'named' if is_named else text}")
        for noise in ["medium"] if args.small else ["low", "medium", "high"]:
            for pitch in [12] if args.small else [12, 8]:
                if rows.has(object=name, kind=f"right, {noise}, {pitch}", draw=0):
                    continue
                folder = scene(args, program, name, pitch, noise)
                text, _ = warnings_of(program, folder / "scene/rig.json", folder / "scene/frames", args.out / "result",
                                      True)
                rows.add(object=name, kind=f"right, {noise}, {pitch}", draw=0, is_named=int(bool(text)), text=text[:300])
    wrong = [r for r in rows.rows if not r["kind"].startswith("right")]
    right = [r for r in rows.rows if r["kind"].startswith("right")]
    print(f"named: {sum(int(r['is_named']) for r in wrong)} of {len(wrong)}; "
          f"right frames accused: {sum(int(r['is_named']) for r in right)} of {len(right)}")
    for r in wrong + right:
        if bool(int(r["is_named"])) == r["kind"].startswith("right"):
            print(f"  {r['object']}, {r['kind']}: {r['text'] or 'no word'}")


if __name__ == "__main__":
    main()

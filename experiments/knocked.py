#!/usr/bin/python3
"""One device knocked out of its place: what `rig check --frames` says, and what `--refine-rig` makes of it.

Rendered scenes whose rig has one device elsewhere: a camera turned in any direction and shifted, so that its picture of
the volume moves by so many pixels, more than its lines are apart too; a projector turned across its lines, and up to as
far along them, and shifted, then rolled. The seed draws device and way.
"""

import json
import math
import shutil

import numpy as np

import common
import heldout

SCENES = ["bust", "dragon_p10", "bust_four"]
AMOUNTS = [0, 5, 10, 20, 40, 80]  # px; 0: a projector is rolled only
ROLLS = {"cameras": [""], "projectors": [0, 5]}  # degrees about the optical axis; "": as the turn has it
COLUMNS = ["device", "verdict", "names_it", "others_named", "left_px", "refused", "label_error", "line_recall"]


def probe_of(rig):
    points = np.random.default_rng(0).normal(size=(400, 3))
    points *= 0.7 * rig["volume"]["radius"] / np.linalg.norm(points, axis=1, keepdims=True)
    return points + rig["volume"]["center"]


def way(a, b, probe):
    """How far the picture of the volume lies apart, root mean square, px; of a projector across its lines, since
    nothing shows the rest."""
    apart = common.project(a, probe) - common.project(b, probe)
    if "pattern" in a:
        apart = apart[:, [0 if a["pattern"]["orientation"] == "vertical" else 1]]
    return math.sqrt(np.mean(np.sum(apart**2, 1)))


def knocked(rig, kind, amount, roll_deg, seed):
    """One device turned and shifted: `amount` px together, a third of it by its shift; then rolled."""
    random = np.random.default_rng([seed, amount, kind == "cameras"])
    result = json.loads(json.dumps(rig))
    d = result[kind][random.integers(len(rig[kind]))]
    before, probe = json.loads(json.dumps(d)), probe_of(rig)
    R, t = np.asarray(d["R"]), np.asarray(d["t"])
    normal, shift = random.normal(size=3), random.normal(size=3)
    turn, roll = normal, 0.0
    if roll_deg != "":
        across = 1 if d["pattern"]["orientation"] == "vertical" else 0
        turn = np.array([random.uniform(-1, 1)] * 2 + [0])
        turn[across] = math.copysign(1, normal[across])
        roll = math.radians(roll_deg) * (1 if np.random.default_rng([seed, amount, 7]).integers(2) else -1)

    def moved(a, b, roll=0.0):
        Q = common._rotation(np.array([0, 0, roll])) @ common._rotation(a * turn)
        return {**d, "R": (Q @ R).tolist(), "t": (Q @ t + b * shift).tolist()}

    a = b = 0.0
    if amount > 0:
        small = 1e-4 * rig["volume"]["radius"]
        b = small / way(moved(0, small), before, probe) * amount / 3
        a = 1e-5 / way(moved(1e-5, 0), before, probe) * amount
        a *= amount / way(moved(a, b), before, probe)
    d.update(moved(a, b, roll))
    return result, d["name"]


def measured(program, scene, work, kind, amount, roll, seed):
    true_rig = json.loads((scene / "rig.json").read_text())
    rig, name = knocked(true_rig, kind, amount, roll, seed)
    shutil.rmtree(work, ignore_errors=True)
    rig_path = common.write_rig(work / "rig.json", rig)
    row = {"device": name}
    # Exit code 1 where it does not fit; the figures are written all the same.
    program("rig", "check", "--rig", rig_path, "--frames", scene / "frames", "--put-back", work / "back.json",
            "--json", work / "fit.json", may_fail=True, json_output=False)
    fit = json.loads((work / "fit.json").read_text())
    row["verdict"] = fit["verdict"]
    row["names_it"] = int(name in fit["moved"])
    row["others_named"] = len([d for d in fit["moved"] if d != name])
    if (work / "back.json").exists():
        back = json.loads((work / "back.json").read_text())
        right, is_now = (next(d for d in r[kind] if d["name"] == name) for r in (true_rig, back))
        row["left_px"] = way(right, is_now, probe_of(true_rig))
    made = program("reconstruct", "--rig", rig_path, "--frames", scene / "frames", "--out", work / "result",
                   "--refine-rig", "--no-mesh", "--no-pictures", may_crash=True)
    row["refused"] = int(made is None)
    if (work / "result/000000/points.ply").exists():
        figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig", scene / "rig.json", "--result",
                          work / "result/000000", may_crash=True) or {}
        row.update({key: figures.get(key) for key in ("label_error", "line_recall")})
    return row


def main():
    args = common.arguments("knocked", __doc__, seed=(1, 1))
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["scene", "kind", "amount", "roll"], COLUMNS, args.resume)
    scenes = heldout.SMALL if args.small else {name: heldout.SPLITS["held"][name] for name in SCENES}
    for name, scene in scenes.items():
        folder = heldout.rendered(program, args.out / "scenes" / name, scene, args.seed)
        for kind, rolls in ROLLS.items():
            for amount in AMOUNTS[4:5] if args.small else AMOUNTS:
                for roll in rolls[-1:] if args.small or amount == 0 else rolls:
                    key = {"scene": name, "kind": kind, "amount": amount, "roll": roll}
                    if rows.has(**key):
                        continue
                    common.progress(f"knocked: {name}, {kind}, {amount} px, roll {roll or 0}")
                    rows.add(**key, **measured(program, folder, args.out / "work", kind, amount, roll, args.seed))


if __name__ == "__main__":
    main()

#!/usr/bin/python3
"""The error model: fitted on some scenes, judged on others.

sigma and confidence (src/pencilscan/uncertainty/error_model.cpp) have eight parameters. They are fitted on
scenes of heldout.py's fit split; how often sigma holds, and how many labels are wrong, is printed for
these and for scenes of its held split: other objects, pitches, noise and rigs. heldout.py renders them.
"""

import argparse
import math
import subprocess
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.stats import spearmanr

import common
import heldout

LEAST = 0.01  # footprints, as in error_model.cpp
FIT = "balls_two,bunny_four,bunny,hand_p8"
HELD = "vase_two,bust_four,bust,bent_hand_four"
ROWS = 20000  # per scene, drawn at random: scenes count alike


# ---- the model, as in error_model.cpp -------------------------------------------------------------


def surface_sigma(e, scale, one_sided, bend):
    predicted = np.maximum(e["predicted"] / np.sqrt(np.maximum(e["cameras"], 1)), LEAST)
    beyond = one_sided * e["one_sidedness"]
    level = scale * np.sqrt(predicted * np.maximum(e["scatter"], LEAST) * (1 + beyond**2))
    return np.hypot(level, bend * e["bend"])


def settled_sigma(e, on_lines, difference):
    return np.hypot(on_lines * e["surface"], difference * e["difference"])


def unsettled_sigma(e, own, difference):
    return np.hypot(own * e["own"], difference * e["difference"])


# ---- evidence -------------------------------------------------------------------------------------

COLUMNS = {
    "surface": ["error", "predicted", "scatter", "bend", "one_sidedness", "cameras", "stated"],
    "points": ["error", "own", "surface", "difference", "settled", "right", "confidence", "stated"],
}


def evidence(path, kind, chosen=None):
    names = COLUMNS[kind]
    rows = np.fromfile(path / f"{kind}.f32", "<f4").reshape(-1, len(names)).astype(float)
    # Beyond all that is near: a ray that misses the object has no true distance.
    rows[:, 0] = np.clip(rows[:, 0], 1e-3, 1e4)
    result = {name: rows[:, k] for k, name in enumerate(names)}
    if chosen is not None:
        keep = chosen(result)
        result = {name: column[keep] for name, column in result.items()}
    return result


def drawn(e):
    pick = np.random.default_rng(0).permutation(len(e["error"]))[:ROWS]
    return {name: column[pick] for name, column in e.items()}


# ---- the fit --------------------------------------------------------------------------------------


def likelihood(error, sigma):
    """Of Student's t with four degrees of freedom, negative logarithm: a few gross errors decide
    nothing."""
    return np.mean(np.log(sigma) + 2.5 * np.log1p((error / sigma) ** 2 / 4))


def fitted(model, scenes, start):
    """Parameters: their proportions by likelihood, their common scale so that as many errors as of a
    normal distribution are below sigma, in the mean over the scenes."""
    def cost(p):
        return sum(likelihood(e["error"], model(e, *np.exp(p))) for e in scenes)

    found = minimize(cost, np.log(start), method="Nelder-Mead",
                     options={"maxiter": 4000, "fatol": 1e-6, "xatol": 1e-3})
    p = np.exp(found.x)
    low, high = 0.2, 5.0
    for _ in range(40):
        scale = math.sqrt(low * high)
        share = np.mean([np.mean(e["error"] < scale * model(e, *p)) for e in scenes])
        low, high = (scale, high) if share < math.erf(math.sqrt(0.5)) else (low, scale)
    return p, scale


def shared_errors(scenes):
    """The share of labels that is wrong whatever confidence says, by maximum likelihood."""
    def cost(p):
        total = 0
        for e in scenes:
            wrong = np.clip(1 - e["confidence"] + math.exp(p[0]), 1e-9, 0.5)
            total -= np.mean(np.log(np.where(e["right"] > 0, 1 - wrong, wrong)))
        return total

    return math.exp(minimize(cost, [math.log(3e-4)], method="Nelder-Mead").x[0])


# ---- figures --------------------------------------------------------------------------------------


def coverage(e, sigma):
    if len(sigma) < 50:
        return ["-", "-", "-"]
    one, two = (np.mean(e["error"] < k * sigma) for k in (1, 2))
    rank = spearmanr(e["error"], sigma)[0]
    bad = (not 0.62 <= one <= 0.74, not 0.92 <= two <= 0.98, rank < 0.4)
    return [f"**{x:.3f}**" if b else f"{x:.3f}" for x, b in zip((one, two, rank), bad)]


def sure(e, shared):
    """Of points that say 99.9 % or more: said and true share of wrong labels, %."""
    said = 1 - e["confidence"] + shared
    said, wrong = said[said <= 1e-3], (1 - e["right"])[said <= 1e-3]
    if not len(said):
        return ["-", "-"]
    text = f"{100 * wrong.mean():.3f}"
    return [f"{100 * said.mean():.3f}", f"**{text}**" if wrong.mean() > 3 * said.mean() else text]


def options():
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--scenes", type=Path, required=True, help="as heldout.py --scenes keeps them")
    parser.add_argument("--fit", default=FIT, help=f"scenes to fit to (default {FIT})")
    parser.add_argument("--held", default=HELD, help=f"scenes to judge on (default {HELD})")
    parser.add_argument("--stated", action="store_true",
                        help="judge what the program states, not the parameters fitted here")
    return parser


def run(args):
    tool = args.program.resolve().parent / "benchmarks/error_evidence"
    fit, held = args.fit.split(","), args.held.split(",")
    for name in fit:
        if name not in heldout.SPLITS["fit"]:
            raise SystemExit(f"{name} is no scene to fit to")
    folders = {name: args.out / "evidence" / name for name in fit + held}
    for name, folder in folders.items():
        if not (args.resume and (folder / "points.f32").exists()):
            subprocess.run([tool, args.scenes / f"{name}_s1", folder], check=True)
            common.progress(f"error_model: evidence of {name}")

    surfaces = [drawn(evidence(folders[n], "surface")) for n in fit]
    (scale, one_sided, bend), m = fitted(surface_sigma, surfaces, [0.9, 1.5, 0.4])
    surface = (m * scale, one_sided, m * bend)

    def points_of(name, settled):  # the surface's sigma is the program's, with its own parameters
        return evidence(folders[name], "points", lambda e: (e["settled"] > 0) == settled)

    p, m = fitted(settled_sigma, [drawn(points_of(n, True)) for n in fit], [0.9, 0.2])
    settled = m * p
    p, m = fitted(unsettled_sigma, [drawn(points_of(n, False)) for n in fit], [1.5, 1])
    unsettled = m * p
    labels = {n: evidence(folders[n], "points") for n in fit + held}
    shared = shared_errors([labels[n] for n in fit])
    print("fitted: kScale %.3f kOneSided %.3f kBend %.3f kOnLines %.3f kDifference %.3f kOwnOff %.2f "
          "kDifferenceOff %.2f kSharedErrors %.5f" % (*surface, *settled, *unsettled, shared))

    rows = []
    for name in fit + held:
        e = evidence(folders[name], "surface")
        of_mesh = coverage(e, e["stated"] if args.stated else surface_sigma(e, *surface))
        q = evidence(folders[name], "points")
        sigma = np.where(q["settled"] > 0, settled_sigma(q, *settled), unsettled_sigma(q, *unsettled))
        of_points = coverage(q, q["stated"] if args.stated else sigma)
        rows.append(["fit" if name in fit else "held", name, *of_points, *of_mesh,
                     *sure(labels[name], shared)])
    common.print_table(args.out / "table.md", "shares of errors below one and two sigma, rank correlation "
                       "of sigma with the error; bold: beyond .62 to .74, .92 to .98, below .4",
                       ["", "scene", "points: 1 sigma", "2 sigma", "rank", "mesh: 1 sigma", "2 sigma",
                        "rank", "sure: said wrong, %", "wrong, %"], rows)


if __name__ == "__main__":
    run(common.arguments("error_model", __doc__, parents=[options()]))

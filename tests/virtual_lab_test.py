"""The virtual laboratory from nothing to a mesh, in its small setting: what comes out must be what
the simulator alone gives. Left out where screens or cameras were not built, or no network of its own
can be had."""

import json
import os
import subprocess
import sys
import tempfile

SKIPPED = 77
NOT_HERE = ("built without", "no network of its own", "without hardware did not start")


def main():
    program = os.environ["PENCILSCAN_PROGRAM"]
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "lab")
        figures = os.path.join(folder, "figures.json")
        done = subprocess.run(
            [program, "lab", "--virtual", "--small", "--out", out, "--json", figures],
            capture_output=True, text=True)
        sys.stderr.write(done.stderr)
        if done.returncode != 0 and any(words in done.stderr for words in NOT_HERE):
            return SKIPPED
        assert done.returncode == 0, done.returncode
        with open(figures) as file:
            found = json.load(file)
    lab, simulated = found["laboratory"], found["simulated"]
    print(json.dumps(found, indent=1))
    assert found["calibration"]["verdict"] == "good"
    assert lab["label_error"] <= simulated["label_error"] + 0.001
    # A calibration of two small captures adds to the errors of the measurement: less than half.
    for key in ("distance_median_mm", "mesh_distance_median_mm"):
        assert lab[key] <= 1.5 * simulated[key], key
    assert lab["completeness_1mm"] >= simulated["completeness_1mm"] - 0.02
    return 0


sys.exit(main())

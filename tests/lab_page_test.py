"""The page of a laboratory, on a virtual one: pictures, figures and buttons. Left out where screens or
cameras were not built, or no network of its own can be had."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

SKIPPED = 77
NOT_HERE = ("built without", "no network of its own", "without hardware did not start")
PATIENCE = 60


def get(link, path, post=False):
    request = urllib.request.Request(link + path, method="POST" if post else "GET")
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        return answer.read()


def wait_for(link, what):
    """The first status for which what() holds."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        status = json.loads(get(link, "status"))
        if what(status):
            return status
        time.sleep(0.2)
    raise AssertionError(status)


def look_at(link):
    assert b"<title>Laboratory" in get(link, "")
    ready = wait_for(link, lambda s: all(c["whole"] > 0 for c in s["cameras"]))
    assert [c["name"] for c in ready["cameras"]] == ["cam0", "cam1", "cam2"]
    assert get(link, "preview/2")[:2] == b"\xff\xd8"  # JPEG
    black = wait_for(link, lambda s: s["showing"] == "black" and not s["job"]["running"])
    assert all(c["figures"]["lit"] == c["figures"]["line_contrast"] == 0 for c in black["cameras"])
    get(link, "act/show?what=lines", post=True)
    lit = wait_for(link, lambda s: min(c["figures"]["brightest"] for c in s["cameras"]) > 0.4)
    assert lit["showing"] == "lines"
    assert all(1 < c["figures"]["edge_px"] < 3 for c in lit["cameras"]), lit["cameras"]
    assert all(c["advice"] == [] for c in lit["cameras"]), lit["cameras"]
    wait_for(link, lambda s: not s["job"]["running"])
    get(link, "act/set?camera=1&exposure_ms=4&gain=0", post=True)
    dim = wait_for(link, lambda s: s["cameras"][1]["figures"]["brightest"] < 0.25)
    assert "open the iris" in dim["cameras"][1]["advice"][0]
    assert abs(dim["cameras"][1]["exposure_ms"] - 4) < 0.01
    assert not dim["calibrated"]
    for nonsense in ("act/shell", "act/record", "act/show?what=%2Fetc%2Fpasswd", "act/set?camera=9&exposure_ms=1",
                     "act/set?camera=0&exposure_ms=-1",
                     "act/set?camera=1&exposure_ms=100000000"):
        try:
            get(link, nonsense, post=True)
        except urllib.error.HTTPError as error:
            assert error.code == 409, (nonsense, error.code)
        else:
            raise AssertionError(nonsense)


def come_back(lab, link):
    """Cameras that were not asked for anything for longer than they wait belong to nobody: they are
    taken up again."""
    lab.send_signal(signal.SIGSTOP)
    time.sleep(5)
    lab.send_signal(signal.SIGCONT)
    # Pictures that were on their way may still come.
    time.sleep(1)
    before = [c["whole"] for c in json.loads(get(link, "status"))["cameras"]]
    wait_for(link, lambda s: all(
        c["whole"] > b + 4 and not any("no longer answers" in line for line in c["advice"])
        for c, b in zip(s["cameras"], before)))


def own_display(screen):
    """The environment in which programs see the laboratory's outputs: its server alone knows its
    cookie."""
    for socket in os.listdir("/tmp/.X11-unix"):
        env = dict(os.environ, DISPLAY=":" + socket[1:], XAUTHORITY=os.path.join(screen, "authority"))
        listed = subprocess.run([os.environ["PENCILSCAN_PROGRAM"], "show", "--list"], env=env,
                                capture_output=True)
        if listed.returncode == 0:
            return env
    raise AssertionError("no display")


def interrupt_a_test(folder):
    """A test that is interrupted leaves no lab.json: it would lack the delays that it did not come to."""
    lab = os.path.join(folder, "lab")
    with open(os.path.join(lab, "lab.json")) as file:
        wanted = json.load(file)
    for name, camera in wanted["cameras"].items():
        shots = os.path.join(folder, name)
        os.mkdir(shots)
        wanted["cameras"][name] = {"device": "folder:" + shots}
    wanted["patience_s"] = 1
    own = os.path.join(folder, "own.json")
    with open(own, "w") as file:
        json.dump(wanted, file)
    tested = os.path.join(folder, "tested.json")
    test = subprocess.Popen(
        [os.environ["PENCILSCAN_PROGRAM"], "capture", "--rig", os.path.join(lab, "devices.json"),
         "--lab", own, "--test", tested], env=own_display(os.path.join(lab, "screen")),
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    time.sleep(2)
    test.send_signal(signal.SIGINT)
    said = test.communicate(timeout=PATIENCE)[1]
    assert test.returncode == 1, (test.returncode, said)
    assert "stopped; nothing was written" in said, said
    assert not os.path.exists(tested)


def assign_outputs(folder):
    """A wrong key is asked again: the answers before it are kept."""
    lab = os.path.join(folder, "lab")
    named = os.path.join(folder, "named.json")
    shown = subprocess.run(
        [os.environ["PENCILSCAN_PROGRAM"], "show", "--rig", os.path.join(lab, "devices.json"),
         "--what", "identify", "--assign", named], env=own_display(os.path.join(lab, "screen")),
        input="9\n2\n2\n1\n", capture_output=True, text=True, timeout=PATIENCE)
    assert shown.returncode == 0, shown.stderr
    assert "numbers from 1 to 2 are shown; once more" in shown.stderr, shown.stderr
    with open(named) as file:
        outputs = [projector["output"] for projector in json.load(file)["projectors"]]
    assert outputs == ["DUMMY1", "DUMMY0"], outputs


def main():
    with tempfile.TemporaryDirectory() as folder:
        lab = subprocess.Popen(
            [os.environ["PENCILSCAN_PROGRAM"], "lab", "--virtual", "--small", "--page", "--out",
             os.path.join(folder, "lab")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True)
        try:
            first = lab.stdout.readline()
            if not first:
                said = lab.stderr.read()
                sys.stderr.write(said)
                return SKIPPED if any(words in said for words in NOT_HERE) else 1
            look_at(first.split()[1])
            come_back(lab, first.split()[1])
            assign_outputs(folder)
            interrupt_a_test(folder)
        finally:
            os.killpg(lab.pid, signal.SIGINT)  # as a terminal's Ctrl-C
            code = lab.wait(PATIENCE)
        assert code == 0, code
    return 0


sys.exit(main())

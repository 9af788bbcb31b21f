#!/usr/bin/env python3
"""Opens every frame of an output file of demhybrid with h5py and insists that a run has computed it.

    python3 sound_frames.py FILE INTERVAL [complete]

Needs h5py and numpy. Leaves with 0 and the number of frames, or says what is wrong and leaves with 1. With
`complete` the file must say that its run came to the end.
"""

import sys

import h5py
import numpy as np

path, interval = sys.argv[1], float(sys.argv[2])


def check(claim, otherwise):
    if not claim:
        sys.exit(f"{path}: {otherwise}")


with h5py.File(path, "r") as file:
    root = file["VTKHDF"]
    times = root["Steps/Values"][:]
    frames = min(int(root["Steps"].attrs["NSteps"]), len(times))
    ids = root["PointData/id"][:]
    count = len(ids)
    check(np.array_equal(ids, np.arange(count)), "the ids are not 0, 1, 2, ...")
    due = np.arange(frames) * interval
    check(np.allclose(times[:frames], due, rtol=1e-12, atol=0), f"times {times[:frames]}")
    check(np.all(np.diff(file["run/series/steps_accepted"][:frames]) >= 0), "steps are counted backwards")
    for k in range(frames):
        block = slice(k * count, (k + 1) * count)
        x, v = root["Points"][block], root["PointData/velocity"][block]
        check(len(x) == count and np.all(np.isfinite(x)) and np.all(np.isfinite(v)), f"frame {k} is not whole")
        check(np.all(np.any(x != 0, axis=1)), f"frame {k} has spheres at 0, 0, 0")
        # Nothing is fast enough to get further within an interval.
        if k > 0:
            check(np.abs(x - before).max() < 0.5, f"frame {k} does not follow from the one before")
        before = x
    if "complete" in sys.argv:
        check(file["run"].attrs["completed"] == 1, "it is not complete")
print(f"{frames} frames")

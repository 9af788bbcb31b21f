#!/usr/bin/env python3
"""Reads an output file of demhybrid the way its users do, with h5py and with VTK, and compares the two.

    python3 read_frames.py FILE [--particles N] [--frames T] [--rotation yes|no] [--energy yes|no] [--fixed-step yes|no]

Needs h5py, numpy and vtk 9.3 or later. Works on the file of a killed run as well: `NSteps` alone says how many frames
there are. Prints one line and leaves with 0, or says what is wrong and leaves with 1.
"""

import argparse
import sys

import h5py
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

# Reals and counts of /run/series, a row a frame.
SERIES = {
    "time": "f8", "step": "f8", "kinetic_energy": "f8", "potential_energy": "f8", "largest_overlap": "f8",
    "bed_height": "f8", "wall_seconds": "f8", "steps_accepted": "i8", "steps_rejected": "i8", "steps_outrun": "i8",
    "rhs_evaluations": "i8", "pair_evaluations": "i8", "lists_built": "i8",
}
# Columns that are there together or not at all.
DISSIPATED = ["dissipated_rebound", "dissipated_friction"]
# What may decide the size of a step.
LIMITS = ["error", "growth", "stability", "travel", "contact", "maximum", "minimum", "first", "end"]
COUNTS = ["ranks", "threads", "steps_accepted", "steps_rejected", "steps_outrun", "rhs_evaluations", "pair_evaluations",
          "lists_built", "forced_accepts", "completed", *(f"limited_by_{limit}" for limit in LIMITS)]
REALS = ["tolerance", "velocity_scale", "contact_reach", "mass", "wall_seconds",
         *(f"seconds_{part}" for part in ("forces", "ghosts", "lists", "reduction", "output"))]
TEXTS = ["version", "commit", "method", "norm", "instruction_set"]


def check(claim, otherwise):
    if not claim:
        sys.exit(f"{arguments.file}: {otherwise}")  # a text makes the exit code 1


def check_array(name, dtype, rows, columns=(), exactly=False):
    """An array of at least so many rows; longer ones are what a kill in the middle of a frame leaves."""
    check(name in file, f"{name} is missing")
    array = file[name]
    check(array.dtype == np.dtype(dtype), f"{name} is of type {array.dtype}, not {dtype}")
    check(array.shape[1:] == columns, f"{name} has shape {array.shape}, not (rows, *{columns})")
    enough = array.shape[0] == rows if exactly else array.shape[0] >= rows
    check(enough, f"{name} has {array.shape[0]} rows, NSteps asks for {rows}")
    return array


def check_layout():
    """What h5py sees: groups, types, lengths, offsets. Returns (frames, particles, rotation, completed)."""
    root, run = file["VTKHDF"], file["run"]
    kind = root.attrs.get_id("Type").get_type()
    check(isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str()
          and kind.get_cset() == h5py.h5t.CSET_ASCII, "the attribute Type is not a fixed-length ASCII string")
    check(root.attrs["Type"] == b"PolyData", f"Type is {root.attrs['Type']!r}, not PolyData")
    version = root.attrs["Version"]
    check(version.dtype == np.int64 and version.tolist() == [2, 0], f"Version is {version!r}, not int64 [2, 0]")

    frames = int(root["Steps"].attrs["NSteps"])
    particles = root["PointData/id"].shape[0]
    rotation = "angular_velocity" in root["PointData"]
    ids = check_array("VTKHDF/PointData/id", "i8", particles, exactly=True)[:]
    check(np.array_equal(ids, np.arange(particles)), "PointData/id is not 0, 1, ..., N-1")
    check_array("VTKHDF/PointData/radius", "f8", particles, exactly=True)
    check_array("VTKHDF/Steps/Values", "f8", frames, exactly=True)
    vectors = ["Points", "PointData/velocity"] + (["PointData/angular_velocity"] if rotation else [])
    for name in vectors:
        check_array(f"VTKHDF/{name}", "f8", frames * particles, (3,))

    k = np.arange(frames)
    scheduled = {
        "NumberOfPoints": 0 * k + particles,
        "Steps/PartOffsets": k,
        "Steps/NumberOfParts": 0 * k + 1,
        "Steps/PointOffsets": k * particles,
    }
    for name in root["PointData"]:
        scheduled[f"Steps/PointDataOffsets/{name}"] = 0 * k if name in ("id", "radius") else k * particles
    for cells in ["Vertices", "Lines", "Polygons", "Strips"]:
        shown = particles if cells == "Vertices" else 0
        scheduled[f"{cells}/NumberOfCells"] = scheduled[f"{cells}/NumberOfConnectivityIds"] = 0 * k + shown
        for name, rows in (("Connectivity", shown), ("Offsets", shown + 1)):
            values = check_array(f"VTKHDF/{cells}/{name}", "i8", rows, exactly=True)[:]
            check(np.array_equal(values, np.arange(rows)), f"{cells}/{name} is not 0, 1, 2, ...")
    for name, values in scheduled.items():
        array = check_array(f"VTKHDF/{name}", "i8", frames)
        check(np.array_equal(array[:frames], values), f"{name} is {array[:frames]}, not {values}")
    for name in ["CellOffsets", "ConnectivityIdOffsets"]:
        check(not check_array(f"VTKHDF/Steps/{name}", "i8", frames, (4,))[:frames].any(), f"{name} is not 0")

    for name in COUNTS + REALS:
        dtype = np.int64 if name in COUNTS else np.float64
        check(name in run.attrs and run.attrs[name].dtype == dtype, f"/run has no attribute {name} of {dtype}")
    completed = bool(run.attrs["completed"])
    texts = TEXTS + (["scene"] if "scene_text" not in run else []) + (["choice"] if completed else [])
    for name in texts:
        check(isinstance(run.attrs.get(name), str), f"/run has no text attribute {name}")
    if "step" in run.attrs:
        check(run.attrs["step"].dtype == np.float64 and run.attrs["step"] > 0, "/run has a step that is none")
    check(("step" in run.attrs) != (run.attrs["tolerance"] > 0), "/run has a step and a tolerance, or neither")
    limited = sum(run.attrs[f"limited_by_{limit}"] for limit in LIMITS)
    accepted = run.attrs["steps_accepted"]
    # A kill may come between two attributes.
    check(limited == accepted or not completed, f"limits decided {limited} steps, {accepted} were accepted")
    energy = {name: "f8" for name in DISSIPATED if name in run["series"]}
    check(len(energy) in (0, len(DISSIPATED)), f"of {DISSIPATED} only {list(energy)} is there")
    for name, dtype in (SERIES | energy).items():
        check_array(f"run/series/{name}", dtype, frames)
    for name in energy:
        column = run["series"][name][:frames]
        check((column[:1] == 0).all() and (np.diff(column) >= 0).all(), f"{name} does not grow from 0")
    times = file["VTKHDF/Steps/Values"][:]
    check(np.array_equal(file["run/series/time"][:frames], times), "series/time and Steps/Values differ")
    check((np.diff(times) > 0).all(), "the times of the frames do not increase")
    return frames, particles, rotation, completed


def check_vtk(frames, particles, rotation):
    """What VTK sees, walked frame by frame through its pipeline, is what h5py sees, bit by bit."""
    if frames == 0:
        return
    reader = vtkHDFReader()
    reader.SetFileName(arguments.file)
    reader.UpdateInformation()
    times = file["VTKHDF/Steps/Values"][:]
    seen = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    if frames > 1:  # a single step is not a series to VTK, it reads it and shows no time
        check(np.array_equal(seen, times), f"VTK sees the times {seen}, not {times}")
    static = {name: file[f"VTKHDF/PointData/{name}"][:] for name in ("id", "radius")}
    moving = ["velocity"] + (["angular_velocity"] if rotation else [])
    for k, time in enumerate(times):
        check(reader.UpdateTimeStep(time), f"VTK cannot read frame {k}")
        data = reader.GetOutputDataObject(0)
        check(data is not None and data.GetClassName() == "vtkPolyData", f"VTK has no PolyData in frame {k}")
        check(data.GetNumberOfPoints() == particles, f"VTK sees {data.GetNumberOfPoints()} points in frame {k}")
        check(data.GetNumberOfVerts() == particles, f"VTK sees {data.GetNumberOfVerts()} vertices in frame {k}")
        check(data.GetNumberOfCells() == particles, f"VTK sees {data.GetNumberOfCells()} cells in frame {k}")
        rows = slice(k * particles, (k + 1) * particles)
        arrays = {f"VTKHDF/PointData/{name}": data.GetPointData().GetArray(name) for name in [*static, *moving]}
        arrays["VTKHDF/Points"] = data.GetPoints().GetData()
        for name, seen in arrays.items():
            check(seen is not None, f"VTK does not see {name} in frame {k}")
            shared = static.get(name.rsplit("/", 1)[1])
            stored = file[name][rows] if shared is None else shared
            seen = vtk_to_numpy(seen)
            same = seen.dtype == stored.dtype and seen.tobytes() == stored.tobytes()
            check(same, f"{name} differs between VTK and h5py in frame {k}")


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("file")
parser.add_argument("--particles", type=int, help="how many there must be")
parser.add_argument("--frames", type=int, help="how many there must be")
parser.add_argument("--rotation", choices=["yes", "no"], help="whether there must be angular velocities")
parser.add_argument("--energy", choices=["yes", "no"], help="whether there must be dissipated energies")
parser.add_argument("--fixed-step", choices=["yes", "no"], help="whether the method must have a step of its own")
arguments = parser.parse_args()

try:
    file = h5py.File(arguments.file, "r")
except OSError as why:
    sys.exit(f"{arguments.file}: h5py cannot open it: {why}")
with file:
    try:
        frames, particles, rotation, completed = check_layout()
        check_vtk(frames, particles, rotation)
        last = float(file["VTKHDF/Steps/Values"][-1]) if frames else None
        energy, fixed_step = DISSIPATED[0] in file["run/series"], "step" in file["run"].attrs
    except (KeyError, OSError) as why:
        sys.exit(f"{arguments.file}: {why}")
for name, found in (("particles", particles), ("frames", frames)):
    asked = getattr(arguments, name)
    check(asked is None or asked == found, f"{found} {name}, not {asked}")
check(arguments.rotation in (None, "yes" if rotation else "no"), f"rotation is {'on' if rotation else 'off'}")
for what, asked, found in (("dissipated energies", arguments.energy, energy),
                           ("attributes of a fixed step", arguments.fixed_step, fixed_step)):
    check(asked in (None, "yes" if found else "no"), f"{what} {'are there' if found else 'are missing'}")
print(f"{arguments.file}: {frames} frames of {particles} particles, last at {last} s, rotation "
      f"{'on' if rotation else 'off'}, {'completed' if completed else 'not completed'}: h5py and VTK agree")

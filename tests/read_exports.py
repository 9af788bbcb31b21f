#!/usr/bin/env python3
"""Reads what `demhybrid export` wrote with the programs that it is for, and compares with the run itself (h5py).

    python3 read_exports.py RUN FRAME vtp FILE | stl FILE SUBDIVISIONS | raw FILE | ovito FILE [FRAMES]
                            | lammps FILE PROGRAM

Prints one line and leaves with 0, or says what is wrong and leaves with 1.
"""

import json
import subprocess
import sys

import h5py
import numpy as np


def check(claim, otherwise):
    if not claim:
        sys.exit(f"{path}: {otherwise}")


def rows(name):
    """The rows of the frame."""
    return root[name][frame * count : (frame + 1) * count]


def polydata(reader):
    reader.SetFileName(path)
    reader.Update()
    check(reader.GetErrorCode() == 0, f"VTK error {reader.GetErrorCode()}")
    return reader.GetOutput()


def vtp():
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    data = polydata(vtkXMLPolyDataReader())
    check(data.GetNumberOfPoints() == count, f"{data.GetNumberOfPoints()} points")
    check(data.GetNumberOfVerts() == count, f"{data.GetNumberOfVerts()} vertices")
    check(np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), x), "other positions")
    arrays = data.GetPointData()
    names = {arrays.GetArrayName(k) for k in range(arrays.GetNumberOfArrays())}
    check(names == set(root["PointData"]), f"arrays {names}")
    for name in names:
        constant = name in ("id", "radius", "mass", "species")
        expected = root[f"PointData/{name}"][:count] if constant else rows(f"PointData/{name}")
        found = vtk_to_numpy(arrays.GetArray(name))
        check(found.dtype == expected.dtype and np.array_equal(found, expected), f"other values of {name}")
    if species is not None:
        found = data.GetFieldData().GetAbstractArray("species_names")
        found = [found.GetValue(k) for k in range(found.GetNumberOfValues())]
        check(found == species, f"species {found}")
    check(data.GetFieldData().GetArray("TimeValue").GetValue(0) == time, "another time")


def stl():
    from vtkmodules.vtkIOGeometry import vtkSTLReader

    triangles = 20 * 4 ** int(sys.argv[5])
    data = polydata(vtkSTLReader())
    check(data.GetNumberOfCells() == count * triangles, f"{data.GetNumberOfCells()} triangles")
    ends = np.array(data.GetBounds()).reshape(3, 2)
    # Corners lie a little outside of the sphere, but not at its ends.
    low, high = (x - r[:, None]).min(axis=0), (x + r[:, None]).max(axis=0)
    check(np.all(np.abs(ends[:, 0] - low) < 0.1 * r.max()), f"bounds {ends}")
    check(np.all(np.abs(ends[:, 1] - high) < 0.1 * r.max()), f"bounds {ends}")
    # Tetrahedra with one corner at the centre of their sphere. Single precision leaves 1e-7 of a coordinate.
    tolerance = 1e-4 * r.max() / r
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("flags", "<u2")])
    corners = np.fromfile(path, dtype=facet, offset=84)["corners"].astype(float).reshape(count, triangles, 3, 3)
    corners -= np.asarray(x)[:, None, None, :]
    volume = np.linalg.det(corners).sum(axis=1) / 6
    check(np.all(np.abs(volume / (4 / 3 * np.pi * r**3) - 1) < tolerance), f"volumes of spheres {volume}")


def raw():
    with open(path + ".json", encoding="utf8") as text:
        header = json.load(text)
    nx, ny, nz = header["shape"]
    image = np.fromfile(path, dtype=header["type"]).reshape(nz, ny, nx)
    check(set(np.unique(image)) <= {0, 1}, "not only 0 and 1: the box of the scene is the whole image")
    centres = [header["origin"][k] + (np.arange(n) + 0.5) * header["spacing"][k] for k, n in enumerate((nx, ny, nz))]
    solid = np.zeros(image.shape, dtype=bool)
    for (a, b, c), radius in zip(x, r):
        apart = [(centres[k] - at) ** 2 for k, at in enumerate((a, b, c))]
        solid |= apart[2][:, None, None] + apart[1][None, :, None] + apart[0][None, None, :] <= radius * radius
    expected = solid if header["one"] == "solid" else ~solid
    wrong = np.count_nonzero(image != expected)
    # Centres on a surface may fall to either side by rounding.
    check(wrong <= 2, f"{wrong} voxels of {image.size} are wrong")
    check(header["voxels_outside"] == 0, "voxels outside")
    check(header["share_of_ones"] == image.sum() / image.size, "another share of ones")
    check(header["time"] == time and header["frame"] == frame, "another time")


def ovito():
    from ovito.io import import_file

    pipeline = import_file(path)
    expected = int(sys.argv[5]) if len(sys.argv) > 5 else frames
    check(pipeline.num_frames == expected, f"{pipeline.num_frames} frames")
    data = pipeline.compute(min(frame, expected - 1))
    found = data.particles
    check(found.count == count, f"{found.count} particles")
    check(np.allclose(found.positions, x, rtol=0, atol=1e-12), "other positions")
    check(np.array_equal(found["Particle Identifier"], np.arange(count)), "other ids")
    check(np.allclose(found["Radius"], r, rtol=1e-6), "other radii")
    check(np.allclose(found["Velocity"], rows("PointData/velocity"), rtol=0, atol=1e-12), "other velocities")
    if species is not None:
        types = found.particle_types
        names = [types.type_by_id(number).name for number in types]
        expected = [species[int(k)].replace(" ", "_") for k in root["PointData/species"][:count]]
        check(names == expected, f"types {names}")
    if "mass" in root["PointData"]:
        check(np.allclose(found["Mass"], root["PointData/mass"][:count], rtol=1e-12), "other masses")
    check(data.attributes["Time"] == time, f"attributes {dict(data.attributes)}")
    check(not any(data.cell.pbc), "a periodic cell")


def lammps():
    dump = path + ".dump"
    commands = f"""units si
atom_style sphere
boundary f f f
comm_modify vel yes
read_data {path}
pair_style zero {4 * r.max()}
pair_coeff * *
dump 1 all custom 1 {dump} id x y z vx vy vz omegax omegay omegaz diameter mass type
dump_modify 1 sort id format float %.17g
run 0
"""
    with open(path + ".in", "w", encoding="utf8") as text:
        text.write(commands)
    said = subprocess.run([sys.argv[5], "-in", path + ".in", "-log", "none"], capture_output=True, text=True)
    check(said.returncode == 0, f"LAMMPS says\n{said.stdout}\n{said.stderr}")
    found = np.loadtxt(dump, skiprows=9)
    check(found.shape == (count, 13), f"shape {found.shape}")
    check(np.array_equal(found[:, 0], np.arange(1, count + 1)), "other ids")
    check(np.array_equal(found[:, 1:4], x), "other positions")
    check(np.array_equal(found[:, 4:7], rows("PointData/velocity")), "other velocities")
    if "angular_velocity" in root["PointData"]:
        check(np.array_equal(found[:, 7:10], rows("PointData/angular_velocity")), "other spins")
    mass = root["PointData/mass"][:count] if "mass" in root["PointData"] else file["run"].attrs["mass"]
    check(np.allclose(found[:, 10], 2 * r) and np.allclose(found[:, 11], mass), "other spheres")
    types = 1 if species is None else root["PointData/species"][:count] + 1
    check(np.array_equal(found[:, 12], types * np.ones(count)), "other types")


run, frame, kind, path = sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4]
file = h5py.File(run)
root = file["VTKHDF"]
frames = int(root["Steps"].attrs["NSteps"])
frame = frames - 1 if frame < 0 else frame
count = root["PointData/id"].shape[0]
time = root["Steps/Values"][frame]
r = root["PointData/radius"][:count]
species = None
if "species" in root["PointData"]:
    species = root["PointData/species"].attrs["names"]
    species = (species.decode() if isinstance(species, bytes) else species).split("\n")
x = rows("Points")
{"vtp": vtp, "stl": stl, "raw": raw, "ovito": ovito, "lammps": lammps}[kind]()
print(f"{path}: {kind} agrees with frame {frame} of {run}")

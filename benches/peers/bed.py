"""Beds between programs: frames of demhybrid as CSV, wider beds from mirrored copies, data files for LAMMPS and
LIGGGHTS, and what the measuring scripts want to know of a run. Needs h5py and numpy. `bed.py --help` lists the commands.
"""

import argparse
import hashlib
import itertools

import h5py
import numpy as np

COLUMNS = ["x", "y", "z", "vx", "vy", "vz", "avx", "avy", "avz"]
RADIUS, MASS, REACH = 0.1, 1.0, 0.3  # m, kg, m: the sphere of bed.toml, and 2r + l_max
SHIFTED = 1.0  # m, how far behind a seam spheres give way


def frame(path, number):
    """Positions, velocities and spins of a frame by id, as rows of COLUMNS; number -1 is the last one."""
    with h5py.File(path) as file:
        frames = int(file["VTKHDF/Steps"].attrs["NSteps"])
        if not -frames <= number < frames:
            raise SystemExit(f"bed.py: {path} has {frames} frames, not number {number}")
        count = int(file["VTKHDF/NumberOfPoints"][0])
        rows = slice(number % frames * count, (number % frames + 1) * count)
        data = file["VTKHDF/PointData"]
        x, v = file["VTKHDF/Points"][rows], data["velocity"][rows]
        spin = data["angular_velocity"][rows] if "angular_velocity" in data else np.zeros_like(x)
    return np.hstack([x, v, spin])


def read(path):
    """A bed from CSV or, its last frame, from the output of a run."""
    if path.endswith(".vtkhdf"):
        return frame(path, -1)
    return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)


def write(path, bed):
    """A bed as particles.file wants it, with the digits that give the same bits again."""
    with open(path, "w", encoding="ascii") as file:
        file.write(",".join(COLUMNS) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in bed.tolist())


def make_room(bed, axis, wall, inward):
    """Moves spheres from a wall (at `wall`, `inward` +1 or -1) where a seam with a mirror image takes its place: by half
    of their overlap with it, so that they overlap their image just as far. What is behind them within SHIFTED gives way:
    by half of the mean overlap at its height, less with distance."""
    gap = inward * (bed[:, axis] - wall) - RADIUS
    layer = np.floor(bed[:, 2] / (2 * RADIUS)).astype(int)
    overlaps = np.zeros(layer.max() + 1)
    touching = gap < 0
    np.add.at(overlaps, layer[touching], -gap[touching])
    overlaps /= np.maximum(1, np.bincount(layer[touching], minlength=len(overlaps)))
    share = np.clip(1 - gap / SHIFTED, 0, 1)
    bed[:, axis] += inward * np.where(touching, -gap, overlaps[layer] * share) / 2


def tile(bed, size, copies):
    """Copies side by side, every second one mirrored at its wall, so that spheres at a seam meet their own image."""
    tiles = []
    for place in itertools.product(range(copies[0]), range(copies[1])):
        one = bed.copy()
        for axis, index in enumerate(place):
            if index % 2:
                one[:, axis] = size[axis] - one[:, axis]
                one[:, 3 + axis] *= -1
                # Spin is an axial vector: a mirror keeps its component along the normal and turns the others.
                one[:, [6 + a for a in range(3) if a != axis]] *= -1
            if index > 0:
                make_room(one, axis, 0.0, 1)
            if index < copies[axis] - 1:
                make_room(one, axis, size[axis], -1)
            one[:, axis] += index * size[axis]
        tiles.append(one)
    return np.vstack(tiles)


def lammps(path, bed, size):
    """A data file for `atom_style sphere` (LAMMPS) or `granular` (LIGGGHTS), which read the same columns."""
    density = MASS / (4 / 3 * np.pi * RADIUS**3)
    with open(path, "w", encoding="ascii") as file:
        file.write(f"a bed of demhybrid\n\n{len(bed)} atoms\n1 atom types\n\n")
        file.write(f"0 {size[0]!r} xlo xhi\n0 {size[1]!r} ylo yhi\n-0.2 {float(bed[:, 2].max() + 0.5)!r} zlo zhi\n")
        file.write("\nAtoms\n\n")  # id, type, diameter, density, position
        file.writelines(
            f"{i} 1 {2 * RADIUS!r} {density!r} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in enumerate(bed[:, :3].tolist(), 1)
        )
        file.write("\nVelocities\n\n")  # id, velocity, spin
        file.writelines(f"{i} " + " ".join(map(repr, row)) + "\n" for i, row in enumerate(bed[:, 3:].tolist(), 1))


def count_pairs(x, limits):
    """How many pairs of centres are closer than each of the limits, by cells as wide as the largest one."""
    cell = np.floor((x - x.min(0)) / max(limits)).astype(np.int64) + 1
    shape = cell.max(0) + 2  # an empty cell all around: no neighbour wraps
    key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    x, key = x[order], key[order]
    first = np.searchsorted(key, np.arange(shape.prod() + 1))
    counts = np.zeros(len(limits), dtype=np.int64)
    for step in itertools.product((-1, 0, 1), repeat=3):
        other = key + (step[0] * shape[1] + step[1]) * shape[2] + step[2]
        start, length = first[other], first[other + 1] - first[other]
        for k in range(length.max(initial=0)):
            i = np.flatnonzero(length > k)
            j = start[i] + k
            i, j = i[i < j], j[i < j]
            distance = np.linalg.norm(x[i] - x[j], axis=1)
            counts += [(distance < limit).sum() for limit in limits]
    return counts


def facts(path):
    """What a finished run was: right-hand sides, accepted steps, pair evaluations, method, version, commit, the solver's
    wall time (s), particles, ranks x threads."""
    with h5py.File(path) as file:
        run = file["run"].attrs
        if not run["completed"]:
            raise SystemExit(f"bed.py: {path} was not completed")
        names = ("rhs_evaluations", "steps_accepted", "pair_evaluations", "method", "version", "commit", "wall_seconds")
        count = int(file["VTKHDF/NumberOfPoints"][0])
        return " ".join([*(str(run[name]) for name in names), str(count), f"{run['ranks']}x{run['threads']}"])


def digest(path):
    """A checksum of every bit that must not depend on ranks and threads: all frames, step counts and energies."""
    parts = hashlib.sha256()
    with h5py.File(path) as file:
        data = {f"VTKHDF/{name}": file[f"VTKHDF/{name}"] for name in ("Points", "Steps/Values")}
        data |= {f"VTKHDF/PointData/{name}": value for name, value in file["VTKHDF/PointData"].items()}
        data |= {f"run/series/{name}": value for name, value in file["run/series"].items() if "seconds" not in name}
        for name in sorted(data):
            parts.update(name.encode() + np.ascontiguousarray(data[name][()]).tobytes())
        run = file["run"].attrs
        for name in sorted(run):
            if name.startswith(("steps_", "limited_by_", "forced_")) or name in ("rhs_evaluations", "pair_evaluations"):
                parts.update(f"{name} {run[name]}".encode())
    return parts.hexdigest()[:16]


def last(path):
    """Centres by id, of a state that LAMMPS wrote."""
    with open(path, encoding="ascii") as file:
        next(line for line in file if line.startswith("ITEM: ATOMS id x y z "))
        return np.loadtxt(file, ndmin=2)[:, 1:4]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name, text, *arguments):
        one = commands.add_parser(name, help=text, description=text)
        for argument in arguments:
            one.add_argument(argument)
        return one

    one = command("csv", "a frame of a run as particles.file", "run", "csv")
    one.add_argument("--frame", type=int, default=-1, help="frame number, the last one unless given")
    one = command("tile", "mirrored copies of a bed side by side", "bed", "csv")
    one.add_argument("--size", type=float, nargs=2, required=True, help="of the box of the bed in x and y, m")
    one.add_argument("--copies", type=int, nargs=2, required=True, help="along x and y")
    one = command("lammps", "a data file for LAMMPS and LIGGGHTS", "bed", "data")
    one.add_argument("--size", type=float, nargs=2, required=True, help="of the box in x and y, m")
    command("neighbours", "particles, mean neighbours within 2r + l_max, mean touching contacts of a particle", "bed")
    command("facts", facts.__doc__, "run")
    command("digest", digest.__doc__, "run")
    command("motion", "largest speed (m/s) and highest centre (m) of a bed", "bed")

    command("apart", "largest distance of a sphere in two states that LAMMPS wrote, m", "one", "other")

    args = parser.parse_args()
    if args.command == "csv":
        write(args.csv, frame(args.run, args.frame))
    elif args.command == "tile":
        write(args.csv, tile(read(args.bed), args.size, args.copies))
    elif args.command == "lammps":
        lammps(args.data, read(args.bed), args.size)
    elif args.command == "neighbours":
        bed = read(args.bed)
        near, touching = count_pairs(bed[:, :3], [REACH, 2 * RADIUS])
        print(len(bed), f"{2 * near / len(bed):.2f} {2 * touching / len(bed):.2f}")
    elif args.command == "facts":
        print(facts(args.run))
    elif args.command == "digest":
        print(digest(args.run))
    elif args.command == "motion":
        bed = read(args.bed)
        print(f"{np.linalg.norm(bed[:, 3:6], axis=1).max():.3g} {bed[:, 2].max():.3f}")
    elif args.command == "apart":
        print(f"{np.linalg.norm(last(args.one) - last(args.other), axis=1).max():.6g}")


if __name__ == "__main__":
    main()

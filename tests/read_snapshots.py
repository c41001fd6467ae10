#!/usr/bin/env python3
"""Open the snapshots of a run directory with VTK's own HDF reader and check what it finds.

Usage: read_snapshots.py RUN_DIR          (needs the packages vtk and numpy)
Exit code 1 and one line per problem when something is wrong.
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

PARTICLE_ARRAYS = {
    "id": 1,
    "species": 1,
    "radius": 1,
    "orientation": 4,
    "velocity": 3,
    "angular_velocity": 3,
    "stress_trace": 1,
    "coordination": 1,
}
CONTACT_ARRAYS = {"low": 1, "high": 1, "shift": 3, "force": 3, "normal_force": 1, "overlap": 1}


class Checker:
    """Collects problems, so that all of them are reported and not only the first."""

    def __init__(self):
        self.problems = []
        self.moments = []

    def check(self, holds, problem):
        if not holds:
            self.problems.append(problem)
        return holds


def read(path):
    reader = vtkHDFReader()
    if not reader.CanReadFile(str(path)):
        return None
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutputDataObject(0)


def arrays_of(data):
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def check_arrays(checker, path, arrays, wanted, rows):
    for name, columns in wanted.items():
        if not checker.check(name in arrays, f"{path}: array `{name}` is missing"):
            continue
        shape = arrays[name].shape
        expected = (rows,) if columns == 1 else (rows, columns)
        checker.check(shape == expected, f"{path}: array `{name}` has shape {shape} instead of {expected}")
    for name, values in arrays.items():
        if values.dtype.kind == "f":
            checker.check(np.isfinite(values).all(), f"{path}: array `{name}` holds values that are not finite")


def check_time(checker, path, data, time):
    fields = arrays_of(data.GetFieldData())
    if checker.check("TimeValue" in fields and "step" in fields, f"{path}: no TimeValue or no step"):
        checker.moments.append((path, time, fields["TimeValue"][0], fields["step"][0]))
    checker.check("cell_sides" in fields, f"{path}: no cell_sides")
    return fields.get("cell_sides")


def check_particles(checker, path, time):
    data = read(path)
    if not checker.check(data is not None, f"{path}: VTK cannot read the file"):
        return None
    count = data.GetNumberOfPoints()
    checker.check(count > 0, f"{path}: no points")
    checker.check(data.GetNumberOfVerts() == count, f"{path}: {data.GetNumberOfVerts()} vertices on {count} points")
    arrays = arrays_of(data.GetPointData())
    check_arrays(checker, path, arrays, PARTICLE_ARRAYS, count)
    checker.check(np.array_equal(arrays.get("id"), np.arange(count)), f"{path}: ids are not 0 … {count - 1}")
    checker.check((arrays.get("radius", np.ones(1)) > 0).all(), f"{path}: a radius is not positive")
    norm = np.linalg.norm(arrays.get("orientation", np.eye(4)[:1]), axis=-1)
    checker.check(np.allclose(norm, 1, atol=1e-9), f"{path}: an orientation is not a unit quaternion")
    sides = check_time(checker, path, data, time)
    points = vtk_to_numpy(data.GetPoints().GetData())
    if sides is not None:
        # Beside walls a particle may stand out by its overlap, never by more than its radius.
        slack = arrays["radius"].max()
        inside = (points >= -slack).all() and (points <= sides + slack).all()
        checker.check(inside, f"{path}: particles lie outside the cell")
    return count


def check_contacts(checker, path, time):
    data = read(path)
    if not checker.check(data is not None, f"{path}: VTK cannot read the file"):
        return None
    count = data.GetNumberOfLines()
    points = data.GetNumberOfPoints()
    checker.check(points == 2 * count, f"{path}: {points} points for {count} lines")
    arrays = arrays_of(data.GetCellData())
    check_arrays(checker, path, arrays, CONTACT_ARRAYS, count)
    if "low" in arrays and "high" in arrays:
        keys = np.column_stack([arrays["low"], arrays["high"]])
        in_order = all(tuple(a) <= tuple(b) for a, b in zip(keys, keys[1:]))
        checker.check(in_order and (keys[:, 0] <= keys[:, 1]).all(), f"{path}: contacts are not in key order")
    check_time(checker, path, data, time)
    return count


def entries(checker, folder, kind):
    path = folder / f"{kind}.vtkhdf.series"
    if not path.exists():
        return []
    files = json.loads(path.read_text())["files"]
    times = [entry["time"] for entry in files]
    checker.check(all(a < b for a, b in zip(times, times[1:])), f"{path}: times do not ascend")
    return [(folder / entry["name"], entry["time"]) for entry in files]


def check_index(checker):
    """The index gives the times of the files, or their steps if two files share a time."""
    moments, checker.moments = checker.moments, []
    times = [time for _, _, time, _ in moments]
    distinct = all(a < b for a, b in zip(times, times[1:]))
    for path, indexed, time, step in moments:
        found = time if distinct else step
        checker.check(found == indexed, f"{path}: {found!r} where the index says {indexed!r}")


def check_xdmf(checker, folder, particles):
    path = folder / "particles.xmf"
    grids = ElementTree.parse(path).getroot().findall("./Domain/Grid/Grid")
    times = [float(grid.find("Time").get("Value")) for grid in grids]
    checker.check(times == [time for _, time in particles], f"{path}: its times are not those of the series")
    names = {item.text.split(":")[0] for grid in grids for item in grid.iter("DataItem")}
    checker.check(names == {file.name for file, _ in particles}, f"{path}: its files are not those of the series")


def main(run):
    folder = pathlib.Path(run) / "snapshots"
    checker = Checker()
    particles = entries(checker, folder, "particles")
    contacts = entries(checker, folder, "contacts")
    if checker.check(particles, f"{folder}: no snapshots"):
        counts = {check_particles(checker, *entry) for entry in particles}
        checker.check(len(counts) == 1, f"{folder}: the number of particles changes: {sorted(map(str, counts))}")
        check_index(checker)
        lines = [check_contacts(checker, *entry) for entry in contacts]
        check_index(checker)
        check_xdmf(checker, folder, particles)
        span = f"{particles[0][1]:g} to {particles[-1][1]:g}"
        print(f"{folder}: {len(particles)} snapshots of {counts.pop()} particles, {span}")
        if lines:
            print(f"{folder}: contacts in {len(lines)} snapshots, {lines[0]} in the first, {lines[-1]} in the last")
    for problem in checker.problems:
        print(problem, file=sys.stderr)
    return 1 if checker.problems else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))

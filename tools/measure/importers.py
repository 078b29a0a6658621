#!/usr/bin/env python3
"""`strivec prior` on files of other programs, against other readers.

    python3 -m venv V && V/bin/pip install numpy trimesh networkx 'laspy[lazrs]' pye57 plyfile open3d
    V/bin/python tools/measure/importers.py --strivec target/release/strivec FOLDER...

reads every file below the folders whose ending names a format, in cells of a fiftieth of its extent, and prints the
number of right, wrong and refused files by format and folder. A file is right if, for one of the readers of its
format, the number of points or triangles is the same, every point, or place on a triangle, lies in an occupied cell,
and every occupied cell holds such a place or touches it. Refused files are counted apart if the other readers refuse
them too. `--rows FILE` writes one line per file. `assimp`, `bt2vrml` and `convert_octree` are run if they are installed.
Exit code 1 if any file is wrong.
"""

import argparse
import collections
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

# Cells along the largest side of a file's bounds.
CELLS = 50
# Rounding at the border of a cell, in cells.
ROUNDING = 1e-3
SECONDS = 60
# `places` has a point or three corners each; `beside` has the points of a file of triangles.
Found = collections.namedtuple("Found", ["kind", "places", "beside"], defaults=[np.empty((0, 3))])


def points(array):
    return Found("points", np.asarray(array, float).reshape(-1, 3))


def triangles(vertices, faces):
    return Found("triangles", np.asarray(vertices, float)[np.asarray(faces, int).reshape(-1, 3)])


def by_trimesh(path):
    import trimesh

    scene = trimesh.load_scene(path, process=False, skip_materials=True)
    parts = scene.dump() if scene.geometry else []
    faces = [part for part in parts if isinstance(part, trimesh.Trimesh)]
    clouds = [part for part in parts if isinstance(part, trimesh.PointCloud)]
    beside = np.concatenate([np.empty((0, 3)), *(part.vertices for part in clouds)])
    if faces:
        return Found("triangles", np.concatenate([np.asarray(part.vertices[part.faces], float) for part in faces]), beside)
    return points(beside)


def by_assimp(path):
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.stl"
        words = ["assimp", "export", path, out, "-fstlb", "-tri", "-ptv"]
        subprocess.run(words, check=True, capture_output=True, timeout=SECONDS)
        return by_trimesh(out)


def by_plyfile(path):
    from plyfile import PlyData

    data = PlyData.read(path)
    vertices = np.stack([np.asarray(data["vertex"][axis]) for axis in "xyz"], 1)
    faces = [element for element in data.elements if element.name == "face"]
    if not faces or len(faces[0]) == 0:
        return points(vertices)
    name = next(name for name in ("vertex_indices", "vertex_index") if name in faces[0])
    fans = [(face[0], a, b) for face in faces[0][name] for a, b in zip(face[1:-1], face[2:])]
    return triangles(vertices, fans)


def by_open3d(path):
    import open3d

    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    if path.suffix in (".off", ".stl", ".obj", ".ply", ".glb", ".gltf"):
        mesh = open3d.io.read_triangle_mesh(str(path))
        if len(mesh.triangles):
            return triangles(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
    kind = {".asc": "xyz"}.get(path.suffix, "auto")
    cloud = open3d.io.read_point_cloud(str(path), format=kind, remove_nan_points=True, remove_infinite_points=True)
    return points(cloud.points)


def by_laspy(path):
    import laspy

    las = laspy.read(path)
    kept = ~(np.asarray(las.withheld, bool) | np.isin(np.asarray(las.classification), (7, 18)))
    return points(np.asarray(las.xyz)[kept])


def by_pye57(path):
    import pye57

    file = pye57.E57(str(path))
    scans = [file.read_scan(n, ignore_missing_fields=True, transform=True) for n in range(file.scan_count)]
    return points(np.concatenate([np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], 1) for scan in scans]))


def by_numpy(path):
    array = np.load(path)
    array = array["points"] if path.suffix == ".npz" else array
    return points(array[:, :3])


def by_octomap(path):
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree.bt"
        if path.suffix == ".bt":
            shutil.copy(path, tree)
        else:
            subprocess.run(["convert_octree", path, tree], check=True, capture_output=True, timeout=SECONDS)
        subprocess.run(["bt2vrml", tree], check=True, capture_output=True, timeout=SECONDS)
        text = (Path(folder) / "tree.bt.wrl").read_text()
    words = [line.split("translation")[1].split()[:3] for line in text.splitlines() if "translation" in line]
    return Found("grid_cells", np.array(words, float))


def by_splat_transform(path):
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.ply"
        subprocess.run(["splat-transform", path, out], check=True, capture_output=True, timeout=SECONDS)
        from plyfile import PlyData

        vertex = PlyData.read(out)["vertex"]
    kept = 1 / (1 + np.exp(-np.asarray(vertex["opacity"], float))) >= 0.1
    # SPZ's y and z point up and back; the converter turns them down and to the front.
    signs = [1, -1, -1] if path.suffix == ".spz" else [1, 1, 1]
    return points(signs * np.stack([np.asarray(vertex[axis]) for axis in "xyz"], 1)[kept])


MESHES = [by_trimesh, by_assimp, by_open3d]
READERS = {
    **{ending: MESHES for ending in ("obj", "stl", "off", "gltf", "glb")},
    "ply": [by_trimesh, by_plyfile, by_assimp, by_splat_transform],
    **{ending: [by_open3d] for ending in ("pcd", "xyz", "xyzn", "xyzrgb", "pts", "asc")},
    **{ending: [by_laspy] for ending in ("las", "laz")},
    "e57": [by_pye57],
    **{ending: [by_numpy] for ending in ("npy", "npz")},
    **{ending: [by_octomap] for ending in ("bt", "ot")},
    **{ending: [by_splat_transform] for ending in ("spz", "splat")},
}


def places_on(found, step):
    """Points; places on triangles, at most `step` apart along both directions, and their corners."""
    if found.kind != "triangles":
        return found.places
    corners = found.places[np.isfinite(found.places).all((1, 2))]
    a, b, c = corners.transpose(1, 0, 2)
    longest = np.maximum(np.linalg.norm(b - a, axis=1), np.linalg.norm(c - a, axis=1))
    parts = np.clip(np.ceil(longest / step), 1, 400).astype(int)
    every = []
    for count in np.unique(parts):
        u, v = (grid.ravel() / count for grid in np.meshgrid(np.arange(count + 1), np.arange(count + 1)))
        u, v = (weights[u + v <= 1 + 1e-9][:, None, None] for weights in (u, v))
        chosen = corners[parts == count]
        every.append(((1 - u - v) * chosen[:, 0] + u * chosen[:, 1] + v * chosen[:, 2]).reshape(-1, 3))
    return np.concatenate([*every, found.beside])


def numbers(cells):
    """One number for each cell of (n, 3) indices."""
    x, y, z = (np.floor(cells).astype(np.int64) + (1 << 20)).T
    return (x << 42) + (y << 21) + z


def shifts(length):
    return length * np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3)


def differences(found, said, prior):
    """The differences between another reader's geometry and what `strivec` said and wrote, as text; empty if none."""
    wrong = []
    if said[found.kind] != len(found.places):
        wrong.append(f"{said[found.kind]} {found.kind}, not {len(found.places)}")
    occupied = numbers(prior["cells"])
    # In cells.
    places = (places_on(found, prior["pitch"].min() / 3) - prior["origin"]) / prior["pitch"]
    outside = places[~np.isin(numbers(places), occupied)]
    for shift in shifts(ROUNDING):
        outside = outside[~np.isin(numbers(outside + shift), occupied)]
    if len(outside):
        wrong.append(f"{100 * len(outside) / len(places):.3g} % of the surface in no cell")
    # A triangle may pass a corner of a cell between two places.
    empty = occupied
    for shift in shifts(0.34 if found.kind == "triangles" else ROUNDING):
        empty = empty[~np.isin(empty, numbers(places + shift))] if len(empty) else empty
    if len(empty):
        wrong.append(f"{100 * len(empty) / len(occupied):.3g} % of the cells are empty")
    return "; ".join(wrong)


def judge(command, path):
    """What `strivec` makes of the file: right, wrong or refused, and why."""
    founds, reasons = [], []
    for reader in READERS[path.suffix.lower()[1:]]:
        name = reader.__name__.removeprefix("by_")
        try:
            found = reader(path)
            if np.isfinite(found.places.reshape(-1, 3)).all(1).any():
                founds.append((name, found))
            else:
                reasons.append(f"{name}: nothing")
        except BaseException as reason:
            if isinstance(reason, KeyboardInterrupt):
                raise
            reasons.append(f"{name}: {type(reason).__name__}")
    extent = 1.0
    if founds:
        places = founds[0][1].places.reshape(-1, 3)
        extent = float(np.ptp(places[np.isfinite(places).all(1)], axis=0).max()) or 1.0
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/prior.npz"
        words = [command, "--quiet", "--json", "--threads", "1", "prior", path, "-o", out, "--voxel", repr(extent / CELLS)]
        if any(name == "splat_transform" for name, _ in founds):
            words.append("--vertices")
        done = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS)
        if done.returncode not in (0, 1, 3):
            return "wrong", f"exit code {done.returncode}: {done.stderr.strip()[-200:]}"
        if done.returncode != 0:
            return ("refused" if founds else "refused by all"), done.stderr.strip().splitlines()[-1]
        if not founds:
            return "no truth", "; ".join(reasons)
        said, prior = json.loads(done.stdout), dict(np.load(out))
    all_wrong = []
    for name, found in founds:
        wrong = differences(found, said, prior)
        if not wrong:
            return "right", name
        all_wrong.append(f"{name}: {wrong}")
    return "wrong", " | ".join(all_wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", help="folders of files, searched to any depth")
    parser.add_argument("--strivec", default="target/release/strivec", help="executable [default: %(default)s]")
    parser.add_argument("--rows", type=Path, metavar="TSV", help="write the verdict of each file")
    arguments = parser.parse_args()
    rows = []
    out = arguments.rows.open("w") if arguments.rows else open(os.devnull, "w")
    for folder in arguments.folders:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix.lower()[1:] in READERS:
                row = (folder.name, path.suffix.lower()[1:], *judge(arguments.strivec, path), str(path.relative_to(folder)))
                rows.append(row)
                print(*row, sep="\t", file=out, flush=True)
    verdicts = ["right", "wrong", "refused", "refused by all", "no truth"]
    for title, column in (("format", 1), ("folder", 0)):
        print("\t".join([title, "files", *verdicts]))
        for key in [*sorted({row[column] for row in rows}), "all"]:
            chosen = [row[2] for row in rows if key in (row[column], "all")]
            print("\t".join([key, str(len(chosen)), *(str(chosen.count(verdict)) for verdict in verdicts)]))
    sys.exit(any(row[2] == "wrong" for row in rows))


if __name__ == "__main__":
    main()

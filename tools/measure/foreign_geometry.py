#!/usr/bin/env python3
"""The same cloud and the same mesh, written by widely used packages.

    python3 -m venv V && V/bin/pip install numpy plyfile trimesh 'laspy[lazrs]' pye57 open3d pypcd4 pycolmap
    V/bin/python tools/measure/foreign_geometry.py FOLDER

writes FOLDER/manifest.json: for each file its package and version, the number of points or triangles, and bounds, sum and mean
color of its points or of the mesh's vertices before a format rounds them; "tolerance" is the largest error of a coordinate.
A package that is not installed is skipped with a message; open3d needs libusb-1.0. `splat-transform`, of the package
@playcanvas/splat-transform for Node.js, is run if it is found.

    V/bin/python tools/measure/foreign_geometry.py FOLDER --check target/release/strivec

also reads each file with that command, into cells of a thousandth of the extent, and compares the number of points or
triangles, and bounds, sum and mean color of the cells. Exit code 1 if any differs.
"""

import argparse
import importlib.metadata
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

POINTS = 5000
# Installed packages by the name of their module.
DISTRIBUTIONS = importlib.metadata.packages_distributions()
# The step of LAS, in units of the cloud.
SCALE = 1e-4
ROTATION = [0.5, 0.5, -0.5, 0.5]
TRANSLATION = [1.0, -2.0, 0.5]


def cloud():
    """Positions that f32 holds, and colors: a bent sheet."""
    random = np.random.default_rng(7)
    position = random.uniform(-1, 1, (POINTS, 3))
    position[:, 2] = 0.3 * np.sin(3 * position[:, 0]) + 0.1 * position[:, 1]
    color = random.integers(0, 256, (POINTS, 3), dtype=np.uint8)
    return position.astype(np.float32).astype(np.float64), color


def mesh():
    """A closed mesh: a sphere of 16 by 12 parts, with colors at its vertices."""
    around, along = 16, 12
    vertices = [[0.0, 0.0, 0.8]]
    for ring in range(1, along):
        angle = np.pi * ring / along
        for step in range(around):
            turn = 2 * np.pi * step / around
            vertices.append([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), 0.8 * np.cos(angle)])
    vertices.append([0.0, 0.0, -0.8])
    vertices = np.array(vertices).astype(np.float32).astype(np.float64)
    last = len(vertices) - 1
    faces = []
    for step in range(around):
        after = (step + 1) % around
        faces.append([0, 1 + step, 1 + after])
        for ring in range(along - 2):
            upper, lower = 1 + ring * around, 1 + (ring + 1) * around
            faces += [[upper + step, lower + step, lower + after], [upper + step, lower + after, upper + after]]
        faces.append([last, last - around + after, last - around + step])
    color = np.random.default_rng(8).integers(0, 256, (len(vertices), 3), dtype=np.uint8)
    return vertices, np.array(faces), color


class Folder:
    """The written files and their contents."""

    def __init__(self, path):
        self.path = path
        self.files = []
        self.skipped = {}

    def add(self, name, package, kind, count, position, color, tolerance=0.0, version=None):
        self.files.append(
            {
                "file": name,
                "format": name.split(".", 1)[1],
                "package": package,
                "version": version or importlib.metadata.version(DISTRIBUTIONS[package][0]),
                "kind": kind,
                "count": count,
                "bounds": [position.min(axis=0).tolist(), position.max(axis=0).tolist()],
                "sum": position.sum(axis=0).tolist(),
                "mean_color": None if color is None else color.mean(axis=0).tolist(),
                "tolerance": tolerance,
            }
        )

    def points(self, name, package, color=True, position=None, tolerance=0.0):
        found, colors = cloud()
        position = found if position is None else position
        self.add(name, package, "points", len(position), position, colors if color else None, tolerance)

    def triangles(self, name, package, color=True, tolerance=0.0):
        vertices, faces, colors = mesh()
        self.add(name, package, "triangles", len(faces), vertices, colors if color else None, tolerance)


def write_numpy(folder):
    position, color = cloud()
    np.save(folder.path / "numpy.npy", position)
    folder.points("numpy.npy", "numpy", color=False)
    np.save(folder.path / "numpy-f32.npy", position.astype(np.float32))
    folder.points("numpy-f32.npy", "numpy", color=False)
    np.savez(folder.path / "numpy.npz", points=position, colors=color)
    folder.points("numpy.npz", "numpy")
    np.savez_compressed(folder.path / "numpy-compressed.npz", points=position, colors=color)
    folder.points("numpy-compressed.npz", "numpy")
    np.savetxt(folder.path / "numpy.txt", np.hstack([position, color]), fmt=["%.9g"] * 3 + ["%d"] * 3)
    folder.points("numpy.txt", "numpy")
    np.savetxt(
        folder.path / "numpy.csv", np.hstack([position, color]), fmt=["%.9g"] * 3 + ["%d"] * 3, delimiter=",", header="x,y,z,r,g,b"
    )
    folder.points("numpy.csv", "numpy")


def write_plyfile(folder):
    from plyfile import PlyData, PlyElement

    def table(position, color):
        kinds = [(axis, "f4") for axis in "xyz"] + [(channel, "u1") for channel in ("red", "green", "blue")]
        rows = np.empty(len(position), dtype=kinds)
        for values, names in ((position, "xyz"), (color, ("red", "green", "blue"))):
            for at, name in enumerate(names):
                rows[name] = values[:, at]
        return PlyElement.describe(rows, "vertex")

    vertices, faces, colors = mesh()
    rows = np.empty(len(faces), dtype=[("vertex_indices", "i4", (3,))])
    rows["vertex_indices"] = faces
    for name, keywords in (("ascii", {"text": True}), ("little", {"byte_order": "<"}), ("big", {"byte_order": ">"})):
        file = f"plyfile-{name}.ply"
        PlyData([table(*cloud())], **keywords).write(folder.path / file)
        folder.points(file, "plyfile")
        file = f"plyfile-mesh-{name}.ply"
        PlyData([table(vertices, colors), PlyElement.describe(rows, "face")], **keywords).write(folder.path / file)
        folder.triangles(file, "plyfile")


def write_trimesh(folder):
    import trimesh

    vertices, faces, colors = mesh()
    for ending in ("ply", "obj", "glb", "gltf", "off", "stl"):
        made = trimesh.Trimesh(vertices, faces, process=False)
        made.visual.vertex_colors = colors
        file = f"trimesh-mesh.{ending}"
        if ending == "gltf":
            for name, data in trimesh.exchange.gltf.export_gltf(made.scene()).items():
                (folder.path / (file if name == "model.gltf" else name)).write_bytes(data)
        else:
            made.export(folder.path / file)
        # trimesh puts sRGB where glTF's colors are linear.
        folder.triangles(file, "trimesh", color=ending in ("ply", "obj"))
    position, color = cloud()
    for ending in ("ply", "xyz"):
        trimesh.PointCloud(position, color).export(folder.path / f"trimesh.{ending}")
        # Its XYZ has seven columns without names.
        folder.points(f"trimesh.{ending}", "trimesh", color=ending == "ply")


def write_laspy(folder):
    import laspy

    position, color = cloud()
    for version, formats in (("1.2", (0, 1, 2, 3)), ("1.3", (5,)), ("1.4", (6, 7, 8, 2))):
        for form in formats:
            header = laspy.LasHeader(version=version, point_format=form)
            header.scales, header.offsets = [SCALE] * 3, [0.1, -0.2, 0.3]
            colored = form in (2, 3, 5, 7, 8)
            cloud_of = laspy.LasData(header)
            cloud_of.x, cloud_of.y, cloud_of.z = position.T
            if colored:
                # The upper byte is the color; the lower one repeats it, as writers do.
                cloud_of.red, cloud_of.green, cloud_of.blue = (color.astype(np.uint16) * 257).T
            for ending in ("las", "laz"):
                file = f"laspy-{version.replace('.', '')}-{form}.{ending}"
                if ending == "laz" and form == 5:
                    continue
                cloud_of.write(folder.path / file)
                folder.points(file, "laspy", color=colored, tolerance=SCALE / 2)


def write_pye57(folder):
    import pye57

    position, color = cloud()
    rows = dict(zip(["cartesianX", "cartesianY", "cartesianZ"], position.T))
    rows |= dict(zip(["colorRed", "colorGreen", "colorBlue"], color.T))
    file = "pye57.e57"
    with pye57.E57(str(folder.path / file), mode="w") as out:
        out.write_scan_raw(rows)
    folder.points(file, "pye57")
    file = "pye57-pose.e57"
    with pye57.E57(str(folder.path / file), mode="w") as out:
        out.write_scan_raw(rows, rotation=np.array(ROTATION), translation=np.array(TRANSLATION))
    w, x, y, z = ROTATION
    turned = position @ np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).T
    folder.points(file, "pye57", position=turned + TRANSLATION, tolerance=1e-9)


def write_open3d(folder):
    import open3d

    position, color = cloud()
    made = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(position))
    made.colors = open3d.utility.Vector3dVector(color / 255)
    for name, keywords in (("ascii", {"write_ascii": True}), ("binary", {}), ("compressed", {"compressed": True})):
        file = f"open3d-{name}.pcd"
        open3d.io.write_point_cloud(str(folder.path / file), made, **keywords)
        folder.points(file, "open3d", tolerance=1e-7)
    made.normals = open3d.utility.Vector3dVector(color / 255)
    for ending, colored in (("xyz", False), ("xyzn", False), ("xyzrgb", True), ("pts", True), ("ply", True)):
        open3d.io.write_point_cloud(str(folder.path / f"open3d.{ending}"), made)
        folder.points(f"open3d.{ending}", "open3d", color=colored, tolerance=1e-7)
    vertices, faces, colors = mesh()
    made = open3d.geometry.TriangleMesh(open3d.utility.Vector3dVector(vertices), open3d.utility.Vector3iVector(faces))
    made.vertex_colors = open3d.utility.Vector3dVector(colors / 255)
    made.compute_triangle_normals()
    for ending, colored in (("ply", True), ("obj", True), ("off", True), ("stl", False), ("glb", False)):
        open3d.io.write_triangle_mesh(str(folder.path / f"open3d-mesh.{ending}"), made)
        folder.triangles(f"open3d-mesh.{ending}", "open3d", color=colored, tolerance=1e-6)


def write_splat_transform(folder):
    from plyfile import PlyData, PlyElement

    position, color = cloud()
    names = ["x", "y", "z", *(f"f_dc_{n}" for n in range(3)), "opacity"]
    names += [*(f"scale_{n}" for n in range(3)), *(f"rot_{n}" for n in range(4))]
    rows = np.empty(len(position), dtype=[(name, "f4") for name in names])
    random = np.random.default_rng(9)
    for n in range(3):
        rows[names[n]] = position[:, n]
        rows[f"f_dc_{n}"] = (color[:, n] / 255 - 0.5) / 0.28209479177387814
        rows[f"scale_{n}"] = random.uniform(-7, -5, len(rows))
    for n in range(4):
        rows[f"rot_{n}"] = random.normal(size=len(rows))
    rows["opacity"] = random.uniform(-1, 4, len(rows))
    source = folder.path / "plyfile-splats.ply"
    PlyData([PlyElement.describe(rows, "vertex")]).write(source)
    folder.points(source.name, "plyfile", tolerance=1e-9)
    version = subprocess.run(["splat-transform", "--version"], capture_output=True, text=True, check=True)
    version = (version.stdout + version.stderr).split()[1].removeprefix("v")
    # Half of SPZ's step, and of 1/2047 of a packed chunk; SOG rounds 16 bits of logarithms down.
    signs = {"spz": [1, -1, -1], "glb": [-1, -1, 1]}
    for ending, tolerance in (("ply", 1e-9), ("compressed.ply", 1e-3), ("spz", 2e-4), ("sog", 1e-3), ("glb", 1e-6)):
        file = f"splat-transform.{ending}"
        subprocess.run(["splat-transform", "-w", source, folder.path / file], capture_output=True, check=True)
        # SPZ's y and z point up and back, glTF's x and y left and up, those of the PLY right, down and to the front.
        turned = position * signs.get(ending, 1)
        folder.add(file, "splat-transform", "points", len(position), turned, color, tolerance, version)


def write_pypcd4(folder):
    from pypcd4 import Encoding, PointCloud

    position, color = cloud()
    packed = PointCloud.encode_rgb(color)
    made = PointCloud.from_xyzrgb_points(np.hstack([position.astype(np.float32), packed.reshape(-1, 1)]).astype(np.float32))
    for name, encoding in (("ascii", Encoding.ASCII), ("binary", Encoding.BINARY), ("compressed", Encoding.BINARY_COMPRESSED)):
        made.save(folder.path / f"pypcd4-{name}.pcd", encoding=encoding)
        # Its text has ten digits after the point, which destroys packed colors.
        folder.points(f"pypcd4-{name}.pcd", "pypcd4", color=name != "ascii", tolerance=1e-9)


def write_pycolmap(folder):
    import pycolmap

    position, color = cloud()
    made = pycolmap.Reconstruction()
    for at, channels in zip(position, color):
        made.add_point3D(at, pycolmap.Track(), channels)
    for name, write in (("binary", made.write_binary), ("text", made.write_text)):
        inside = folder.path / f"pycolmap-{name}"
        inside.mkdir(exist_ok=True)
        write(str(inside))
        file = f"pycolmap-{name}/points3D.{'bin' if name == 'binary' else 'txt'}"
        folder.points(file, "pycolmap")


def check(command, folder, entry):
    """The differences between the file's content and what `command` reads, as text; empty if none."""
    bounds = np.array(entry["bounds"])
    voxel = float((bounds[1] - bounds[0]).max()) / 1000
    points = entry["kind"] == "points"
    with tempfile.TemporaryDirectory() as out:
        words = [command, "--quiet", "--json", "prior", folder / entry["file"], "-o", f"{out}/prior.npz", "--voxel", str(voxel)]
        # Splats fill cells beside their centers.
        plain = points and "splat" not in entry["file"]
        done = subprocess.run([*words, *([] if plain else ["--vertices"])], capture_output=True, text=True)
        if done.returncode != 0:
            return done.stderr.strip()
        said = json.loads(done.stdout)
        prior = dict(np.load(f"{out}/prior.npz"))
        if not points:
            done = subprocess.run(words + ["--force"], capture_output=True, text=True)
            said = json.loads(done.stdout)
    wrong = []
    if said[entry["kind"]] != entry["count"]:
        wrong.append(f"{said[entry['kind']]} {entry['kind']}, not {entry['count']}")
    centers = prior["origin"] + (prior["cells"] + 0.5) * prior["pitch"]
    off = np.abs([centers.min(0) - bounds[0], centers.max(0) - bounds[1]]).max()
    if off > 0.5001 * voxel + entry["tolerance"]:
        wrong.append(f"bounds off by {off}")
    if points and len(centers) > 0.99 * entry["count"]:
        # Cells with several points count once.
        off = np.abs(centers.mean(0) - np.array(entry["sum"]) / entry["count"]).max()
        if off > 0.02 * (bounds[1] - bounds[0]).max():
            wrong.append(f"mean off by {off}")
    if entry["mean_color"] is not None:
        if "colors" not in prior:
            wrong.append("no colors")
        elif np.abs(prior["colors"].mean(0) - entry["mean_color"]).max() > 2:
            wrong.append(f"mean color {prior['colors'].mean(0)}, not {entry['mean_color']}")
    return "; ".join(wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder for the files; created if absent")
    parser.add_argument("--check", metavar="STRIVEC", help="strivec executable that reads the files")
    arguments = parser.parse_args()
    folder = Folder(arguments.folder)
    folder.path.mkdir(parents=True, exist_ok=True)
    for write in (
        *(write_numpy, write_plyfile, write_trimesh, write_laspy, write_pye57),
        *(write_open3d, write_pypcd4, write_pycolmap, write_splat_transform),
    ):
        name = write.__name__.removeprefix("write_")
        try:
            write(folder)
        except Exception as reason:
            folder.skipped[name] = f"{type(reason).__name__}: {reason}"
            print(f"{name}: skipped or stopped early: {folder.skipped[name]}")
    manifest = {"files": folder.files, "skipped": folder.skipped}
    (folder.path / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
    print(f"{len(folder.files)} files in {folder.path}")
    if arguments.check:
        wrong = {entry["file"]: check(arguments.check, folder.path, entry) for entry in folder.files}
        for file, words in wrong.items():
            print(f"{file}: {words or 'right'}")
        sys.exit(any(wrong.values()))


if __name__ == "__main__":
    main()

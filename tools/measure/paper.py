#!/usr/bin/env python3
"""Trains and measures the tables of the paper (Strivec, ICCV 2023), and prints each figure beside the paper's.

    python3 tools/measure/paper.py main --data nerf_synthetic
    python3 tools/measure/paper.py rotation --data nerf_synthetic/lego --downscale 4 --steps 3000 --only 48,tensorf-vm
    python3 tools/measure/paper.py components --data lego chair --lpips alex,vgg --lpips-weights lpips.safetensors

Each row is trained on each scene by its own schedule, which takes hours at full size, or in --steps. The same command
resumes a stopped one, and tables share the trainings that they have in common: OUT/TRAINING/SCENE.json records what was
trained and measured. --views, --split and --lpips may change without another training. Needs Python 3.11; --lpips needs NumPy
and Pillow. The program is STRIVEC, `strivec` by default.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

CONFIGS = Path(__file__).resolve().parents[2] / "docs/configs"
# Models that are files of settings, not presets.
FILES = ["tensorf-vm", "tensorf-cp", "vm-cloud-6", "vm-cloud-12"]
TITLES = {"tensorf-cp": "TensoRF-CP", "tensorf-vm": "TensoRF-VM", "vm-cloud-6": "VM-Cloud (0.3), 6", "vm-cloud-12": "VM-Cloud (0.3), 12"}
# Figure, heading, decimals. Minutes and seconds of the paper are those of an RTX 3090.
COLUMNS = [
    ("psnr", "PSNR", 2), ("ssim", "SSIM", 4), ("lpips_vgg", "LPIPS vgg", 4), ("lpips_alex", "LPIPS alex", 4),
    ("millions", "parameters, M", 2), ("minutes", "minutes", 1), ("seconds", "s per view", 2),
]  # fmt: skip
MEASURES = ["psnr", "ssim", "lpips_vgg", "lpips_alex"]
# A coarse volume that is stopped early has the steps divided by this.
EARLY = 4


def figures(psnr=None, ssim=None, vgg=None, alex=None, millions=None, minutes=None, seconds=None):
    return {
        "psnr": psnr, "ssim": ssim, "lpips_vgg": vgg, "lpips_alex": alex, "millions": millions, "minutes": minutes, "seconds": seconds,
    }  # fmt: skip


# "Comparisons of our method with other radiance-based models" and "Ablation study on the number of tensor components".
MEANS = {
    "12": figures(32.94, 0.961, 0.049, 0.028, 4.87),
    "24": figures(33.24, 0.963, 0.046, 0.026, 7.07, 34.3),
    "48": figures(33.55, 0.965, 0.044, 0.025, 13.52, 35.7),
    "96": figures(33.59, 0.965, 0.043, 0.024, 21.01),
    "tensorf-cp": figures(31.56, 0.949, 0.076, 0.041, 0.98, 25.2),
    "tensorf-vm": figures(33.14, 0.963, 0.047, 0.027, 17.95, 17.4),
}
# "Detailed breakdown of quantitative metrics": [measure][scene].
SYNTHETIC_SCENES = ["chair", "drums", "lego", "mic", "materials", "ship", "hotdog", "ficus"]
SYNTHETIC = {
    "12": [
        [35.21, 25.96, 35.60, 35.29, 29.54, 30.64, 37.03, 34.21],
        [0.983, 0.937, 0.980, 0.989, 0.948, 0.888, 0.981, 0.983],
        [0.025, 0.070, 0.022, 0.015, 0.062, 0.145, 0.033, 0.022],
        [0.011, 0.051, 0.009, 0.007, 0.027, 0.092, 0.015, 0.013],
    ],
    "24": [
        [35.60, 26.16, 36.05, 35.81, 29.79, 30.89, 37.24, 34.37],
        [0.984, 0.940, 0.982, 0.990, 0.952, 0.893, 0.982, 0.984],
        [0.022, 0.067, 0.020, 0.013, 0.058, 0.141, 0.031, 0.021],
        [0.010, 0.049, 0.008, 0.006, 0.024, 0.087, 0.014, 0.012],
    ],
    "48": [
        [35.88, 26.20, 36.52, 36.65, 29.90, 31.13, 37.63, 34.47],
        [0.985, 0.940, 0.984, 0.992, 0.953, 0.899, 0.983, 0.985],
        [0.021, 0.064, 0.017, 0.011, 0.056, 0.138, 0.029, 0.018],
        [0.009, 0.048, 0.007, 0.005, 0.023, 0.086, 0.012, 0.011],
    ],
    "tensorf-cp": [
        [33.60, 25.17, 34.05, 33.77, 30.10, 28.84, 36.24, 30.72],
        [0.973, 0.921, 0.971, 0.983, 0.950, 0.857, 0.975, 0.965],
        [0.044, 0.114, 0.038, 0.035, 0.068, 0.196, 0.052, 0.058],
        [0.022, 0.069, 0.014, 0.018, 0.031, 0.130, 0.024, 0.024],
    ],
    "tensorf-vm": [
        [35.76, 26.01, 36.46, 34.61, 30.12, 30.77, 37.41, 33.99],
        [0.985, 0.937, 0.983, 0.988, 0.952, 0.895, 0.982, 0.982],
        [0.022, 0.073, 0.018, 0.015, 0.058, 0.138, 0.032, 0.022],
        [0.010, 0.051, 0.007, 0.009, 0.026, 0.085, 0.013, 0.012],
    ],
}
# "Quantity comparison on five scenes in the Tanks and Temples dataset".
TANKS_SCENES = ["Ignatius", "Truck", "Barn", "Caterpillar", "Family"]
TANKS = {
    "48": [
        [28.39, 27.32, 28.09, 26.58, 33.13],
        [0.948, 0.915, 0.884, 0.917, 0.957],
        [0.083, 0.150, 0.216, 0.154, 0.078],
        [0.083, 0.123, 0.167, 0.125, 0.065],
    ],
    "tensorf-cp": [
        [27.86, 26.25, 26.74, 24.73, 32.39],
        [0.934, 0.885, 0.839, 0.879, 0.948],
        [0.106, 0.202, 0.283, 0.227, 0.088],
        [0.089, 0.154, 0.237, 0.176, 0.063],
    ],
    "tensorf-vm": [
        [28.34, 27.14, 27.22, 26.19, 33.92],
        [0.948, 0.914, 0.864, 0.912, 0.965],
        [0.078, 0.145, 0.252, 0.159, 0.064],
        [0.081, 0.129, 0.217, 0.139, 0.057],
    ],
}
# "Quantitative comparison on scenes in the Tanks and Temples dataset"; LPIPS by VGG is the breakdown's mean.
TANKS_MEANS = {
    "tensorf-cp": figures(27.59, 0.897, 0.181, 0.144, 0.97),
    "tensorf-vm": figures(28.56, 0.920, 0.140, 0.125, 49.92),
    "48": figures(28.70, 0.922, 0.136, 0.113, 14.11),
}
# "Comparisons of our method with TensoRF when considering rotation": degrees, chair, lego.
ROTATION = {
    "tensorf-cp": [(0, 33.60, 34.50), (5, 32.90, 29.79), (45, 32.50, 28.57)],
    "tensorf-vm": [(0, 35.76, 36.46), (5, 34.91, 32.53), (45, 34.55, 32.31)],
    "48": [(0, 35.88, 36.52), (5, 35.72, 35.37), (45, 35.64, 34.97)],
}
EIGHT = "the paper: 30 000 steps on an RTX 3090; means over the eight scenes of NeRF Synthetic"
SOURCES = {
    "geometry": "the paper has no table of it: 48 components keep their quality with any prior, and pruning changes 0.03 dB",
    "rotation": "the paper: 30 000 steps on an RTX 3090; chair and lego",
    "scannet": "the paper: 100 000 steps on an RTX 3090; means over ScanNet's scenes 101 and 241",
    "tanks": "the paper: 30 000 steps on an RTX 3090; means over five scenes of Tanks and Temples",
}


@dataclass
class Row:
    """A training, and the paper's figures of it. `training` names its folder: the same in all tables that have it."""

    name: str
    model: str
    training: str
    means: dict = field(default_factory=figures)
    scenes: dict = field(default_factory=dict)
    change: dict = field(default_factory=dict)
    # The scales that are kept.
    scales: list | None = None
    early: bool = False
    steps: int | None = None
    words: list = field(default_factory=list)
    degrees: int = 0


def breakdown(scenes, measures):
    return {scene: figures(*of_scene) for scene, *of_scene in zip(scenes, *measures)}


def row(model, means, scenes=None, name=None, training=None, **more):
    return Row(name or TITLES.get(model, model), model, training or model, means, scenes or {}, **more)


def synthetic(model, **more):
    return row(model, MEANS[model], breakdown(SYNTHETIC_SCENES, SYNTHETIC.get(model, [[]] * 4)), **more)


def scale_rows():
    """"Ablation under different scale settings": edges of tensors."""
    parts = [
        ("0.6", [0], figures(32.22, 0.957, millions=1.75, minutes=18.22)),
        ("0.3", [1], figures(32.73, 0.961, millions=4.15, minutes=21.31)),
        ("0.15", [2], figures(31.96, 0.952, millions=10.20, minutes=28.55)),
        ("0.6 + 0.3", [0, 1], figures(33.11, 0.963, millions=6.20, minutes=30.12)),
    ]
    rows = [row("48", means, name=name, training=f"48, {name}", scales=scales) for name, scales, means in parts]
    return [*rows, synthetic("48", name="0.6 + 0.3 + 0.15")]


def rotation_rows():
    rows = []
    for model, angles in ROTATION.items():
        for degrees, chair, lego in angles:
            turned = {"training": f"{model}, turned {degrees}", "degrees": degrees} if degrees else {}
            scenes = {"chair": figures(chair), "lego": figures(lego)}
            rows.append(row(model, figures(), scenes, name=f"{TITLES.get(model, model)}, {degrees}°", **turned))
    return rows


def speed_row(model, seconds, picture, millions, psnr):
    return row(model, figures(psnr, millions=millions, minutes=seconds / 60, seconds=picture))


TABLES = {
    "main": lambda: [synthetic(model) for model in ("12", "24", "48", "tensorf-cp", "tensorf-vm")],
    "scales": scale_rows,
    # Appendix A, "Comparisons on our method pairing with different factorization strategies".
    "factors": lambda: [
        synthetic("24", name="three scales, 24"),
        row("96", figures(33.02, 0.963, millions=9.15), name="one scale (0.3), 96", training="96, 0.3", scales=[1]),
        row("vm-cloud-6", figures(32.59, 0.959, millions=11.36)),
        row("vm-cloud-12", figures(32.99, 0.962, millions=21.64)),
    ],
    "components": lambda: [synthetic(model) for model in ("12", "24", "48", "96")],
    # Appendix B, "Ablation Studies on Initial Geometry".
    "geometry": lambda: [
        row("48", figures(), name="coarse volume"),
        row("48", figures(), name="stopped early", training="48, stopped early", early=True),
        row("48", figures(), name="own coarse model", training="48, own coarse model", words=["--bootstrap"]),
        row("48", figures(), name="pruned", training="48, pruned", change={"schedule": {"prune": True}}),
    ],
    # "Speed v.s. Performance".
    "speed": lambda: [
        speed_row("tensorf-cp", 1914, 2.01, 0.98, 31.56),
        speed_row("tensorf-vm", 915, 1.60, 17.95, 33.14),
        speed_row("fast", 959, 1.67, 6.20, 33.09),
    ],
    "rotation": rotation_rows,
    # "Quantitative comparison on two scenes in the ScanNet dataset".
    "scannet": lambda: [
        row("tensorf-cp", figures(27.54, 0.751, alex=0.328, millions=0.97), training="tensorf-cp, 100000 steps", steps=100_000),
        row("tensorf-vm", figures(28.61, 0.787, alex=0.290, millions=49.92), training="tensorf-vm, 100000 steps", steps=100_000),
        row("scannet", figures(29.05, 0.792, alex=0.243, millions=12.82), name="48"),
    ],
    "tanks": lambda: [
        row(model, means, breakdown(TANKS_SCENES, TANKS[model])) for model, means in TANKS_MEANS.items()
    ],
}  # fmt: skip


class Stop(Exception):
    """An error with a message for the user."""


def strivec(program, *words, quiet=True):
    """The standard output of a command; its progress is shown unless `quiet`."""
    command = [program, *map(str, words)]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE if quiet else None, text=True)
    except OSError as error:
        raise Stop(f"cannot run {program}: {error}; STRIVEC or --strivec names the program") from None
    if done.returncode:
        raise Stop(f"{' '.join(command)}: exit code {done.returncode}{': ' + done.stderr.strip() if quiet else ''}")
    return done.stdout


def overlay(settings, changes):
    """`settings` with `changes`, table by table."""
    both = dict(settings)
    for key, value in changes.items():
        both[key] = overlay(both.get(key, {}), value) if isinstance(value, dict) else value
    return both


def toml_text(table, path=()):
    """Settings as TOML."""
    is_tables = lambda value: isinstance(value, list) and value and isinstance(value[0], dict)
    value_text = lambda value: repr(value) if isinstance(value, float) else json.dumps(value)
    lines, tables = [], []
    for key, value in table.items():
        if isinstance(value, dict):
            tables.append(f"\n[{'.'.join((*path, key))}]\n{toml_text(value, (*path, key))}")
        elif is_tables(value):
            tables += [f"\n[[{'.'.join((*path, key))}]]\n{toml_text(one, (*path, key))}" for one in value]
        else:
            lines.append(f"{key} = {value_text(value)}\n")
    return "".join(lines + tables)


def settings_of(row, options):
    """The settings of a row's training."""
    base = ["--config", CONFIGS / f"{row.model}.toml"] if row.model in FILES else ["--preset", row.model]
    settings = tomllib.loads(strivec(options.strivec, "train", *base, "--print-config"))
    shared = tomllib.loads(options.config.read_text()) if options.config else {}
    settings = overlay(settings, {key: value for key, value in shared.items() if key not in ("preset", "scales", "decoder")})
    settings = overlay(settings, row.change)
    if row.scales is not None:
        settings["scales"] = [settings["scales"][n] for n in row.scales]
    if row.early:
        settings["prior"]["steps"] = [max(steps // EARLY, 1) for steps in settings["prior"]["steps"]]
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
        file.write(toml_text(settings))
        file.flush()
        words = ["--config", file.name, "--seed", options.seed, *["--set", "lean.max_loss=0"] * options.full]
        steps = options.steps or row.steps
        return strivec(options.strivec, "train", *words, *(["--steps", steps] if steps else []), "--print-config")


def write(path, text):
    """Writes a file that is whole at any time."""
    path.with_suffix(path.suffix + ".new").write_text(text)
    os.replace(path.with_suffix(path.suffix + ".new"), path)


def outcome(row, settings, scene, options):
    """The record of a training on `scene` by `settings`; trains and measures what is not recorded yet."""
    folder = options.out / row.training
    folder.mkdir(parents=True, exist_ok=True)
    path, file = folder / f"{scene.name}.json", folder / f"{scene.name}.strivec"
    photographs = ["--downscale", str(options.downscale), *(["--turn", str(row.degrees)] if row.degrees else [])]
    identity = {"folder": str(scene), "photographs": photographs, "words": row.words, "settings": settings}
    record = json.loads(path.read_text()) if path.is_file() and not options.force else {"identity": identity}
    if record["identity"] != identity:
        raise Stop(f"{path}: belongs to another training; choose another folder by --out, or overwrite it by --force")
    if not (record.get("trained") and file.is_file()):
        record = {"identity": identity}
        write(path, json.dumps(record, indent=1))
        write(folder / "settings.toml", settings)
        state = file.with_name(file.name + ".state")
        if options.force:
            state.unlink(missing_ok=True)
        file.unlink(missing_ok=True)
        words = ["train", scene, "-o", file, *photographs, "--checkpoint-every", 1000, "--json"]
        words += ["--resume"] if state.is_file() else ["--config", folder / "settings.toml", *row.words]
        trained = json.loads(strivec(options.strivec, *words, quiet=options.quiet))
        record["trained"] = {key: trained[key] for key in ("bytes", "parameters", "seconds", "steps")}
        write(path, json.dumps(record, indent=1))
    how = {"split": options.split, "views": options.views, "lpips": options.lpips}
    if record.get("measured", {}).get("how") != how:
        record["measured"] = {"how": how, **measured(file, scene, photographs, options)}
        write(path, json.dumps(record, indent=1))
    trained, found = record["trained"], record["measured"]
    own = figures(millions=trained["parameters"] / 1e6, minutes=trained["seconds"] / 60, seconds=found["seconds_per_view"])
    own.update({name: found.get(name) for name in MEASURES})
    return {"file": str(file), "bytes": trained["bytes"], "steps": trained["steps"], "views": found["views"], "figures": own}


def measured(file, scene, photographs, options):
    """PSNR, SSIM, seconds, and LPIPS if it is asked for."""
    with tempfile.TemporaryDirectory() as sheets:
        every = ["--every", every_nth(scene, options)] if options.views else []
        words = ["eval", file, scene, "--split", options.split, *photographs, *every, "--json"]
        words += ["--sheets", sheets] if options.lpips else []
        report = json.loads(strivec(options.strivec, *words, quiet=options.quiet))
        found = {name: report[name] for name in ("psnr", "ssim", "seconds_per_view")}
        if options.lpips:
            means, _ = lpips().measured(sheets, options.lpips, options.lpips_weights)
            found.update({f"lpips_{network}": mean for network, mean in means.items()})
        return {"views": len(report["views"]), **found}


def lpips():
    """The module tools/lpips/measure.py."""
    folder = str(Path(__file__).resolve().parents[1] / "lpips")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    import measure

    return measure


def every_nth(scene, options):
    """The distance of the views to measure: about --views of them, evenly spaced."""
    info = json.loads(strivec(options.strivec, "dataset", "info", scene, "--json"))
    count = next(split["photographs"] for split in info["splits"] if split["name"] == options.split)
    return max(count // options.views, 1)


def mean(all_figures):
    """The mean of each figure that all have."""
    columns = {name: [one[name] for one in all_figures] for name in figures()}
    return {name: None if None in values else sum(values) / len(values) for name, values in columns.items()}


def difference(a, b):
    return None if a is None or b is None else a - b


def report(table, rows, scenes, outcomes):
    """The rows of the table: figures by scene and their means, beside the paper's, and the changes by a turn."""
    result = []
    for row, of_row in zip(rows, outcomes):
        paper = [row.scenes.get(scene.name, figures()) for scene in scenes]
        by_turn = None
        unturned = [n for n, other in enumerate(rows) if other.model == row.model and not other.degrees]
        if row.degrees and unturned:
            base = unturned[0]
            base_paper = [rows[base].scenes.get(scene.name, figures()) for scene in scenes]
            own = zip([o["figures"] for o in of_row], paper, [o["figures"] for o in outcomes[base]], base_paper)
            by_turn = [[difference(a["psnr"], c["psnr"]), difference(b["psnr"], d["psnr"])] for a, b, c, d in own]
        of_row_figures = [one["figures"] for one in of_row]
        result.append({
            "name": row.name, "model": row.model, "steps": of_row[0]["steps"], "outcomes": of_row, "paper": paper,
            "mean": mean(of_row_figures), "paper_mean": row.means, "by_turn": by_turn,
        })  # fmt: skip
    return {"table": table, "scenes": [scene.name for scene in scenes], "rows": result}


def text(report, options):
    """The table as text."""
    rows = report["rows"]
    columns = [column for column in COLUMNS if any(o["figures"][column[0]] is not None for r in rows for o in r["outcomes"])]
    turns = any(r["by_turn"] for r in rows)
    number = lambda value, decimals, sign="": "-" if value is None else f"{value:{sign}.{decimals}f}"
    pair = lambda own, paper: [number(of[name], decimals) for name, _, decimals in columns for of in (own, paper)]
    lines = [["", "scene", "MB", *["by turn", "paper"] * turns, *(word for _, heading, _ in columns for word in (heading, "paper"))]]
    for r in rows:
        for n, (scene, o, paper) in enumerate(zip(report["scenes"], r["outcomes"], r["paper"])):
            changes = r["by_turn"][n] if r["by_turn"] else [None, None]
            changes = [number(change, 2, "+") for change in changes] if turns else []
            lines.append([r["name"], scene, number(o["bytes"] / 1e6, 2), *changes, *pair(o["figures"], paper)])
        if any(value is not None for one in rows for value in one["paper_mean"].values()):
            megabytes = sum(o["bytes"] for o in r["outcomes"]) / len(r["outcomes"]) / 1e6
            lines.append([r["name"], "mean", number(megabytes, 2), *["", ""] * turns, *pair(r["mean"], r["paper_mean"])])
    widths = [max(map(len, column)) for column in zip(*lines)]
    cells = lambda line: [cell.ljust(w) if n < 2 else cell.rjust(w) for n, (cell, w) in enumerate(zip(line, widths))]
    steps = ", ".join(dict.fromkeys(f"{r['steps']} steps" for r in rows))
    head = f"1/{options.downscale} size, {steps}, seed {options.seed}, {rows[0]['outcomes'][0]['views']} views"
    return "\n".join([head, SOURCES.get(report["table"], EIGHT), *("  ".join(cells(line)).rstrip() for line in lines)])


def datasets(paths, options):
    """The datasets among `paths` and directly in them, by name."""
    is_one = lambda path: not subprocess.run([options.strivec, "dataset", "info", path], capture_output=True).returncode
    found = {}
    for path in paths:
        for scene in [path] if is_one(path) else sorted(p for p in path.iterdir() if p.is_dir() and is_one(p)):
            scene = scene.resolve()
            if found.setdefault(scene.name, scene) != scene:
                raise Stop(f"{found[scene.name]} and {scene} have one name; results are kept by name")
    if not found:
        raise Stop("no dataset in --data")
    return list(found.values())


def chosen(rows, only):
    """The rows of the models `only`, or all."""
    known = list(dict.fromkeys(row.model for row in rows))
    if unknown := [name for name in only if name not in known]:
        raise Stop(f"--only {unknown[0]}: the table has rows of {', '.join(known)}")
    return [row for row in rows if not only or row.model in only]


def main(words=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    listed = lambda text: [name for name in text.split(",") if name]
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="datasets, and folders of datasets")
    parser.add_argument("--out", type=Path, default=Path("paper"), help="folder for all trainings")
    parser.add_argument("--only", type=listed, default=[], help="train the rows of these models only, comma-separated")
    parser.add_argument("--steps", type=int, help="optimizer steps; the schedule scales with them [default: the model's]")
    parser.add_argument("--config", type=Path, help="TOML settings that all rows share, without scales and decoder")
    parser.add_argument("--full", action="store_true", help="keep all components of all tensors, as the paper does")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--downscale", type=int, default=1, help="downscale photographs N times")
    parser.add_argument("--split", default="test", help="split to measure on")
    parser.add_argument("--views", type=int, help="about N views to measure, evenly spaced [default: all]")
    parser.add_argument("--lpips", type=listed, default=[], help="also measure LPIPS with these networks: alex, vgg")
    parser.add_argument("--lpips-weights", type=Path, help="the file of tools/lpips/convert.py")
    parser.add_argument("--strivec", default=os.environ.get("STRIVEC", "strivec"), help="program [default: STRIVEC, or strivec]")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--force", action="store_true", help="train again what is recorded")
    options = parser.parse_args(words)
    if options.lpips:
        if not (options.lpips_weights and options.lpips_weights.is_file()):
            parser.error("--lpips needs the file of tools/lpips/convert.py by --lpips-weights")
        # Fails here without NumPy, not after a training.
        lpips()
    try:
        rows, scenes, outcomes = chosen(TABLES[options.table](), options.only), datasets(options.data, options), []
        for number, row in enumerate(rows, 1):
            settings = settings_of(row, options)
            for scene in scenes:
                if not options.quiet:
                    print(f"{number} of {len(rows)}: {row.name}, {scene.name}", file=sys.stderr)
                outcomes.append(outcome(row, settings, scene, options))
    except Stop as error:
        sys.exit(f"paper.py: {error}")
    except KeyboardInterrupt:
        sys.exit("paper.py: interrupted; the same command resumes")
    by_row = [outcomes[n : n + len(scenes)] for n in range(0, len(outcomes), len(scenes))]
    result = report(options.table, rows, scenes, by_row)
    print(json.dumps(result, indent=1) if options.json else text(result, options))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Write fixtures/lenses.json: points of camera models as COLMAP's and OpenCV's own code computes them.

    pip install pycolmap opencv-python-headless numpy
    python3 tools/measure/lenses.py > fixtures/lenses.json

Each entry has the model's name and its parameters in COLMAP's order, and rows of five numbers: a direction in the
camera's axes (x right, y down, z forwards) and its pixel.
"""

import json

import cv2
import numpy as np
import pycolmap

WIDTH, HEIGHT = 640, 480
FOCAL, MIDDLE = [320.5, 318.25], [321.75, 238.5]
BENT = [-0.12, 0.034, 0.0011, -0.0007]

MODELS = {
    "SIMPLE_PINHOLE": [320.5, *MIDDLE],
    "PINHOLE": [*FOCAL, *MIDDLE],
    "SIMPLE_RADIAL": [320.5, *MIDDLE, -0.08],
    "RADIAL": [320.5, *MIDDLE, -0.1, 0.02],
    "OPENCV": [*FOCAL, *MIDDLE, *BENT],
    "FULL_OPENCV": [*FOCAL, *MIDDLE, *BENT, 0.01, 0.02, -0.003, 0.0004],
    "OPENCV_FISHEYE": [*FOCAL, *MIDDLE, -0.03, 0.004, -0.0012, 0.0001],
    "SIMPLE_RADIAL_FISHEYE": [320.5, *MIDDLE, -0.02],
    "RADIAL_FISHEYE": [320.5, *MIDDLE, -0.025, 0.003],
    "THIN_PRISM_FISHEYE": [*FOCAL, *MIDDLE, -0.03, 0.004, 0.0011, -0.0007, -0.0012, 0.0001, 0.0009, -0.0006],
    "SIMPLE_FISHEYE": [320.5, *MIDDLE],
    "FISHEYE": [*FOCAL, *MIDDLE],
    "EQUIRECTANGULAR": [WIDTH, HEIGHT],
}


def directions(model: str) -> np.ndarray:
    """Unit directions: up to 45 degrees from the axis, up to 80 for fisheye lenses, all for the sphere."""
    largest = 175.0 if model == "EQUIRECTANGULAR" else 80.0 if "FISHEYE" in model else 45.0
    angles = np.radians(largest) * np.array([0.0, 0.13, 0.37, 0.61, 0.82, 1.0])
    turns = np.radians([10.0, 77.0, 145.0, 205.0, 290.0])
    away, around = np.meshgrid(angles, turns)
    away, around = away.ravel(), around.ravel()
    return np.stack([np.sin(away) * np.cos(around), np.sin(away) * np.sin(around), np.cos(away)], axis=1)


def by_colmap(model: str, parameters: list[float]) -> dict:
    camera = pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT, params=parameters)
    rays = directions(model)
    pixels = camera.img_from_cam(rays)
    rows = np.hstack([rays, pixels])
    return {"by": f"pycolmap {pycolmap.__version__}", "model": model, "parameters": parameters, "rows": rows.tolist()}


def by_opencv(model: str, parameters: list[float]) -> dict:
    rays = directions(model)
    matrix = np.array([[parameters[0], 0, parameters[2]], [0, parameters[1], parameters[3]], [0, 0, 1]])
    zero, bent = np.zeros(3), np.array(parameters[4:])
    if model == "OPENCV_FISHEYE":
        pixels = cv2.fisheye.projectPoints(rays[:, None], zero, zero, matrix, bent)[0]
    else:
        pixels = cv2.projectPoints(rays, zero, zero, matrix, bent)[0]
    rows = np.hstack([rays, pixels[:, 0]])
    return {"by": f"OpenCV {cv2.__version__}", "model": model, "parameters": parameters, "rows": rows.tolist()}


def main() -> None:
    cases = [by_colmap(model, parameters) for model, parameters in MODELS.items()]
    cases += [by_opencv(model, MODELS[model]) for model in ("PINHOLE", "OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE")]
    lines = ",\n".join(json.dumps(case) for case in cases)
    print(f"[\n{lines}\n]")


if __name__ == "__main__":
    main()

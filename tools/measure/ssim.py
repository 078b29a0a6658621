#!/usr/bin/env python3
"""Print the SSIM of two made-up pictures, those of tests/measure/pictures.rs, as the programs compute it that papers use.

    pip install numpy scipy scikit-image torch torchmetrics tensorflow-cpu
    python3 tools/measure/ssim.py

A program whose package is missing is left out. The first column is the convention of `strivec eval --ssim`.
"""

import math

import numpy as np
from scipy.signal import convolve2d

WIDTH, HEIGHT = 23, 17


def pictures():
    x, y, c = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT), np.arange(3), indexing="xy")
    base = x * 37 + y * 101 + c * 53 + x * y * 7
    offset = (x * x + 3 * y + c * 11) % 23 - 11
    return (base % 256) / 256, ((base + offset) % 256) / 256


def tensorf(a, b):
    """`rgb_ssim` of TensoRF (utils.py); mip-NeRF's `compute_ssim` in NumPy."""
    filter_size, filter_sigma, k1, k2, max_val = 11, 1.5, 0.01, 0.03, 1
    hw = filter_size // 2
    shift = (2 * hw - filter_size + 1) / 2
    f_i = ((np.arange(filter_size) - hw + shift) / filter_sigma) ** 2
    filt = np.exp(-0.5 * f_i)
    filt /= np.sum(filt)

    def filt_fn(z):
        convolved = [convolve2d(convolve2d(z[..., i], filt[:, None], "valid"), filt[None], "valid") for i in range(3)]
        return np.stack(convolved, -1)

    mu0, mu1 = filt_fn(a), filt_fn(b)
    mu00, mu11, mu01 = mu0 * mu0, mu1 * mu1, mu0 * mu1
    sigma00 = np.maximum(0.0, filt_fn(a**2) - mu00)
    sigma11 = np.maximum(0.0, filt_fn(b**2) - mu11)
    sigma01 = filt_fn(a * b) - mu01
    sigma01 = np.sign(sigma01) * np.minimum(np.sqrt(sigma00 * sigma11), np.abs(sigma01))
    c1, c2 = (k1 * max_val) ** 2, (k2 * max_val) ** 2
    ssim_map = (2 * mu01 + c1) * (2 * sigma01 + c2) / ((mu00 + mu11 + c1) * (sigma00 + sigma11 + c2))
    return np.mean(ssim_map)


def tensorflow(a, b):
    import tensorflow as tf

    return tf.image.ssim(tf.constant(a), tf.constant(b), 1.0).numpy()


def torchmetrics(a, b):
    import torch
    from torchmetrics.functional.image import structural_similarity_index_measure

    return structural_similarity_index_measure(*batches(torch, a, b), data_range=1.0).item()


def batches(torch, a, b):
    return [torch.from_numpy(picture.transpose(2, 0, 1)[None].copy()) for picture in (a, b)]


def gaussian_splatting(a, b):
    """`ssim` of 3D Gaussian splatting (utils/loss_utils.py)."""
    import torch
    from torch.nn.functional import conv2d

    size, channels = 11, 3
    gauss = torch.tensor([math.exp(-((x - size // 2) ** 2) / (2 * 1.5**2)) for x in range(size)], dtype=torch.float64)
    line = (gauss / gauss.sum())[:, None]
    window = (line @ line.T).expand(channels, 1, size, size).contiguous()
    img1, img2 = batches(torch, a, b)

    def mean(picture):
        return conv2d(picture, window, padding=size // 2, groups=channels)

    mu1, mu2 = mean(img1), mean(img2)
    sigma1_sq, sigma2_sq = mean(img1 * img1) - mu1**2, mean(img2 * img2) - mu2**2
    sigma12 = mean(img1 * img2) - mu1 * mu2
    c1, c2 = 0.01**2, 0.03**2
    return (((2 * mu1 * mu2 + c1) * (2 * sigma12 + c2)) / ((mu1**2 + mu2**2 + c1) * (sigma1_sq + sigma2_sq + c2))).mean().item()


def skimage(**options):
    def measure(a, b):
        from skimage.metrics import structural_similarity

        return structural_similarity(a, b, channel_axis=-1, data_range=1.0, **options)

    return measure


PROGRAMS = [
    ("nerf", "TensoRF, rgb_ssim", tensorf),
    ("nerf", "TensorFlow, tf.image.ssim (NeRF)", tensorflow),
    ("nerf", "torchmetrics (nerfstudio)", torchmetrics),
    ("nerf", "scikit-image, Gaussian", skimage(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)),
    ("3dgs", "3D Gaussian splatting, loss_utils.ssim", gaussian_splatting),
    ("skimage", "scikit-image, defaults", skimage()),
]


def main():
    for convention, program, measure in PROGRAMS:
        try:
            print(f"{convention:8} {program:40} {measure(*pictures()):.16f}")
        except ImportError as error:
            print(f"{convention:8} {program:40} left out: {error}")


if __name__ == "__main__":
    main()

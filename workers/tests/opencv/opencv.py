"""Writes what OpenCV makes of random points, for tests/opencv.rs.

    python opencv.py POINTS SEED FILE

One line a point: the model, its coefficients, the point in the camera frame (metres), the pixel it
is projected to, and the direction that OpenCV undistorts the pixel to (x/z, y/z). Points are drawn
evenly over the image's field of view; each model comes with four lenses.
"""

import sys

import cv2
import numpy as np

K = np.array([[1261.5, 0.0, 976.2], [0.0, 1147.0, 530.6], [0.0, 0.0, 1.0]])
STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-15)
LENSES = {
    # The first is that of the deecamp camera.
    "plumb_bob": (
        0.75,
        [
            [-0.4039346734945025, 0.1488016793983929, 0.001059521151138014, 0.0005015718248852138, 0.0],
            [-0.25, 0.08, -0.0004, 0.0007, -0.012],
            [0.11, -0.05, 0.0, 0.001, 0.01],
            [0.0, 0.0, 0.0, 0.0, 0.0],
        ],
    ),
    "rational_polynomial": (
        0.9,
        [
            [0.52, 0.11, 0.0002, -0.0003, 0.004, 0.88, 0.27, 0.021],
            [-0.31, 0.09, 0.0, 0.0, -0.002, 0.02, 0.01, 0.0],
            [8.9, 5.3, 0.00007, 0.00003, 0.35, 9.3, 8.1, 1.6],
            [0.1, 0.0, 0.001, 0.001, 0.0, 0.05, 0.0, 0.0],
        ],
    ),
    "equidistant": (
        4.0,
        [
            [-0.01, 0.003, -0.002, 0.0003],
            [0.08, -0.03, 0.01, -0.002],
            [-0.03, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0],
        ],
    ),
}


def rays(generator, count, most_tangent):
    """Points of the camera frame whose directions fill the view, out to most_tangent."""
    radius = np.tan(np.arctan(most_tangent) * np.sqrt(generator.uniform(0, 1, count)))
    around = generator.uniform(0, 2 * np.pi, count)
    depth = generator.uniform(1.0, 60.0, count)
    return np.c_[radius * np.cos(around) * depth, radius * np.sin(around) * depth, depth]


def project(model, d, points):
    zero = np.zeros(3)
    if model == "equidistant":
        pixels, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, K, d)
        back = cv2.fisheye.undistortPoints(pixels, K, d, criteria=STOP)
    else:
        pixels, _ = cv2.projectPoints(points[:, None], zero, zero, K, d)
        back = cv2.undistortPoints(pixels, K, d, criteria=STOP)
    return pixels.reshape(-1, 2), back.reshape(-1, 2)


def main(count, seed, path):
    generator = np.random.default_rng(seed)
    with open(path, "w") as out:
        out.write(f"# OpenCV {cv2.__version__}, numpy {np.__version__}, seed {seed}\n")
        for model, (most, lenses) in LENSES.items():
            for d in lenses:
                d = np.array(d)
                points = rays(generator, count // len(lenses), most)
                for point, pixel, back in zip(points, *project(model, d, points)):
                    numbers = [*d, *point, *pixel, *back]
                    out.write(model + " " + " ".join(repr(float(x)) for x in numbers) + "\n")


main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])

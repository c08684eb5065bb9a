"""Lines on real pictures that nobody marked: python real.py MODEL.onnx OUT.pickle PICTURE_OR_VIDEO...

A teacher (TwinLiteNet, MIT) marks lanes as a mask; its middle, row by row, is the line. Marking and colour
are not asked for there, nor are boxes.
"""

import pickle
import sys
from pathlib import Path

import cv2
import numpy as np
import onnxruntime

from pictures import UNKNOWN, Line, Picture

SIZE_PX = (640, 360)
EVERY = 3
LEAST_ROWS = 25
LEAST_PX = 6


def frames(path):
    if Path(path).suffix != ".mp4":
        yield cv2.imread(str(path))
        return
    video, number = cv2.VideoCapture(str(path)), 0
    while (read := video.read())[0]:
        if number % EVERY == 0:
            yield read[1]
        number += 1


def mask_of(teacher, image):
    rgb = cv2.resize(image, SIZE_PX)[:, :, ::-1].transpose(2, 0, 1)[None].astype(np.float32) / 255.0
    names = [output.name for output in teacher.get_outputs()]
    logits = dict(zip(names, teacher.run(None, {teacher.get_inputs()[0].name: rgb})))["ll"][0]
    return (logits[1] > logits[0]).astype(np.uint8)


def lines_of(mask):
    """The middles of a mask's parts, followed upwards row by row."""
    open_lines, done = [], []
    for row in range(mask.shape[0] - 1, -1, -1):
        edges = np.flatnonzero(np.diff(np.pad(mask[row], 1).astype(np.int8)))
        runs = [(a, b) for a, b in zip(edges[::2], edges[1::2]) if b - a < 60]
        going_on = []
        for a, b in runs:
            x = (a + b - 1) / 2
            near = [line for line in open_lines if abs(line[-1][0] - x) < LEAST_PX + 0.5 * (b - a) and line[-1][1] - row <= 4]
            if near:
                line = min(near, key=lambda line: abs(line[-1][0] - x))
                open_lines.remove(line)
                going_on.append(line + [(x, row)])
            else:
                going_on.append([(x, row)])
        waiting = [line for line in open_lines if line[-1][1] - row <= 4]
        done += [line for line in open_lines if line[-1][1] - row > 4]
        open_lines = going_on + waiting
    return [np.array(line, np.float32) for line in done + open_lines if len(line) >= LEAST_ROWS]


def main():
    model, out, *paths = sys.argv[1:]
    teacher = onnxruntime.InferenceSession(model)
    pictures = []
    for path in paths:
        for image in frames(path):
            image = cv2.resize(image, SIZE_PX, interpolation=cv2.INTER_AREA)
            found = lines_of(mask_of(teacher, image))
            jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
            lines = [Line(points[::4], UNKNOWN, UNKNOWN, 1.0) for points in found]
            top = min((points[:, 1].min() for points in found), default=0.0)
            pictures.append(Picture(jpeg, "real", lines, [], float(top), has_boxes=False))
    Path(out).write_bytes(pickle.dumps(pictures))
    print(f"{len(pictures)} pictures, {sum(len(p.lines) for p in pictures)} lines")


if __name__ == "__main__":
    main()

"""Lane F1 on marked pictures: python score.py MODEL.onnx FOLDER [--teacher]

FOLDER has image/, gt_instance_image/ (one grey value per lane). Two figures: CULane's (lanes drawn 30 px
wide at 1640 x 590, right from an IoU of 0.5; Pan et al., 2018), and pixels of one-pixel lines within 6 px
of each other at 1280 x 720.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from scipy.optimize import linear_sum_assignment

from decode import polylines
from real import lines_of, mask_of

CULANE_PX = (1640, 590)
WIDE_PX = 30
NEAR_PX = 6
MARKED_PX = (1280, 720)


def marked(path):
    """Lanes of an instance mask: the middle of each row of each value."""
    mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    lanes = []
    for value in np.unique(mask[mask > 0]):
        rows = np.flatnonzero((mask == value).any(1))
        lanes.append(np.array([(np.flatnonzero(mask[row] == value).mean(), row) for row in rows]))
    return [lane for lane in lanes if len(lane) > 10], mask.shape[::-1]


def drawn(lane, size_px, width):
    canvas = np.zeros(size_px[::-1], np.uint8)
    cv2.polylines(canvas, [np.round(lane).astype(np.int32)], False, 1, width)
    return canvas.astype(bool)


def scaled(lanes, from_px, to_px):
    scale = np.array(to_px) / np.array(from_px)
    return [(lane + 0.5) * scale - 0.5 for lane in lanes]


def culane(found, wanted):
    """Right, found, wanted."""
    a = [drawn(lane, CULANE_PX, WIDE_PX) for lane in found]
    b = [drawn(lane, CULANE_PX, WIDE_PX) for lane in wanted]
    overlap = np.array([[(x & y).sum() / (x | y).sum() for y in b] for x in a]).reshape(len(a), len(b))
    right = (overlap[linear_sum_assignment(-overlap)] > 0.5).sum() if overlap.size else 0
    return np.array([right, len(a), len(b)])


def near(found, wanted):
    """Pixels of found lanes near wanted ones, found pixels, wanted pixels near found ones, wanted."""
    def canvas(lanes):
        out = np.zeros(MARKED_PX[::-1], bool)
        for lane in lanes:
            out |= drawn(lane, MARKED_PX, 1)
        return out

    def off_px(there):
        return cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5) if there.any() else np.full(there.shape, 1e9)

    a, b = canvas(found), canvas(wanted)
    return np.array([(off_px(b)[a] <= NEAR_PX).sum(), a.sum(), (off_px(a)[b] <= NEAR_PX).sum(), b.sum()])


def main():
    model, folder, *rest = sys.argv[1:]
    session = onnxruntime.InferenceSession(model)
    lanes_total, pixels_total = np.zeros(3), np.zeros(4)
    for path in sorted(Path(folder, "image").iterdir()):
        image = cv2.imread(str(path))
        if "--teacher" in rest:
            found = lines_of(mask_of(session, image))
        else:
            rgb = cv2.resize(image, (640, 360), interpolation=cv2.INTER_AREA)[:, :, ::-1]
            lines, _ = session.run(None, {"image": rgb.transpose(2, 0, 1)[None].astype(np.float32) / 255.0})
            found = [points for points, _ in polylines(lines[0])]
        wanted, size_px = marked(Path(folder, "gt_instance_image", path.name))
        lanes_total += culane(scaled(found, (640, 360), CULANE_PX), scaled(wanted, size_px, CULANE_PX))
        pixels_total += near(scaled(found, (640, 360), MARKED_PX), scaled(wanted, size_px, MARKED_PX))
    right, found, wanted = lanes_total
    print(f"CULane: precision {right / max(found, 1):.3f} recall {right / wanted:.3f} F1 {2 * right / (found + wanted):.3f}")
    a, b, c, d = pixels_total
    precision, recall = a / max(b, 1), c / d
    print(f"6 px: precision {precision:.3f} recall {recall:.3f} F1 {2 * precision * recall / max(precision + recall, 1e-9):.3f}")


if __name__ == "__main__":
    main()

"""What is done to a picture before the network sees it: another view, another light, another camera.

Rendered pictures are too clean and too alike; what differs here is what must not matter.
"""

import cv2
import numpy as np

from pictures import BOXES, MARKINGS, Box, Line

MIRRORED_MARKING = {
    MARKINGS.index("solid_dashed"): MARKINGS.index("dashed_solid"),
    MARKINGS.index("dashed_solid"): MARKINGS.index("solid_dashed"),
}
MIRRORED_BOX = {
    BOXES.index(a): BOXES.index(b)
    for a, b in [
        ("left_arrow", "right_arrow"),
        ("right_arrow", "left_arrow"),
        ("straight_left_arrow", "straight_right_arrow"),
        ("straight_right_arrow", "straight_left_arrow"),
    ]
}
# Writing cannot be read in a mirror.
UNREADABLE = [BOXES.index(name) for name in ("speed_limit", "bus_lane", "cycle_lane", "slow")]


def other_view(random, size_px):
    """A 3 x 3 matrix from the picture to the new one: mirrored, zoomed, turned, shifted, slanted."""
    width, height = size_px
    mirror = np.diag([-1.0, 1.0, 1.0]) if random.random() < 0.5 else np.eye(3)
    zoom = np.exp(random.uniform(np.log(0.75), np.log(1.6)))
    stretch = np.exp(random.normal(0.0, 0.06))
    turn = random.normal(0.0, 0.025)
    cos, sin = np.cos(turn), np.sin(turn)
    slant = np.array([[1, random.normal(0.0, 0.06), 0], [0, 1, 0], [0, 0, 1]])
    scale = np.diag([zoom * stretch, zoom / stretch, 1.0])
    rotate = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    spare = max(zoom - 1.0, 0.0) / 2.0
    shift_x = random.uniform(-1, 1) * width * (0.08 + spare)
    shift_y = random.uniform(-1, 1) * height * (0.1 + 0.7 * spare)
    centre = np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, 1.0]])
    back = np.array([[1, 0, (width - 1) / 2 + shift_x], [0, 1, (height - 1) / 2 + shift_y], [0, 0, 1.0]])
    return back @ rotate @ slant @ scale @ mirror @ centre


def moved(points_px, view):
    return (points_px @ view[:2, :2].T + view[:2, 2]).astype(np.float32)


def moved_line(line, view):
    is_mirrored = np.linalg.det(view[:2, :2]) < 0
    marking = MIRRORED_MARKING.get(line.marking, line.marking) if is_mirrored else line.marking
    return Line(moved(line.points_px, view), marking, line.color, line.weight)


def moved_box(box, view, size_px):
    left, top, right, bottom = box.ltrb_px
    corners = moved(np.array([[left, top], [right, top], [right, bottom], [left, bottom]]), view)
    limit = np.array(size_px, np.float32) - 0.5
    low, high = np.clip(corners.min(0), -0.5, limit), np.clip(corners.max(0), -0.5, limit)
    is_mirrored = np.linalg.det(view[:2, :2]) < 0
    kind = MIRRORED_BOX.get(box.kind, box.kind) if is_mirrored else box.kind
    weight = 0.0 if is_mirrored and box.kind in UNREADABLE else box.weight
    whole = np.prod(corners.max(0) - corners.min(0))
    inside = np.prod(high - low)
    weight = weight if inside > 0.4 * whole and (high - low).min() >= 4 else 0.0
    return Box(np.concatenate([low, high]).astype(np.float32), kind, weight)


def other_light(random, image):
    """Exposure, contrast, colour, veil, shadows, blur, noise and compression of another camera."""
    image = image.astype(np.float32) / 255.0
    if random.random() < 0.4:
        image = shadowed(random, image)
    gamma = np.exp(random.normal(0.0, 0.3))
    image = np.clip(image, 0, 1) ** gamma
    mean = image.mean()
    image = (image - mean) * np.exp(random.normal(0.0, 0.25)) + mean * np.exp(random.normal(0.0, 0.25))
    image *= np.exp(random.normal(0.0, 0.08, 3)).astype(np.float32)
    grey = image.mean(2, keepdims=True)
    image = grey + (image - grey) * random.uniform(0.2, 1.6)
    if random.random() < 0.3:
        image = image * (1 - (veil := random.uniform(0, 0.35))) + veil * random.uniform(0.4, 1.0)
    if random.random() < 0.35:
        image = cv2.GaussianBlur(image, (0, 0), random.uniform(0.4, 1.4))
    elif random.random() < 0.3:
        image = image + (image - cv2.GaussianBlur(image, (0, 0), 1.2)) * random.uniform(0.3, 1.5)
    if random.random() < 0.5:
        grain = random.normal(0.0, 1.0, image.shape[:2]).astype(np.float32)[..., None]
        image = image + grain * random.uniform(0.0, 0.05)
    image = (np.clip(image, 0, 1) * 255).astype(np.uint8)
    if random.random() < 0.3:
        quality = int(random.integers(25, 80))
        image = cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], 1)
    return image


def shadowed(random, image):
    """Dark or bright shapes with hard or soft rims, as of bridges, trees and repaired asphalt."""
    height, width = image.shape[:2]
    mask = np.zeros((height, width), np.float32)
    for _ in range(int(random.integers(1, 5))):
        centre = random.uniform([0, 0.3 * height], [width, height])
        reach = random.uniform(0.05, 0.4) * np.array([width, height])
        corners = centre + random.uniform(-1, 1, (int(random.integers(3, 9)), 2)) * reach
        cv2.fillPoly(mask, [corners.astype(np.int32)], 1.0)
    if random.random() < 0.7:
        mask = cv2.GaussianBlur(mask, (0, 0), random.uniform(0.8, 6.0))
    strength = random.uniform(0.35, 0.9) if random.random() < 0.75 else random.uniform(1.1, 1.5)
    return image * (1 + mask[..., None] * (strength - 1))


def augmented(random, picture, size_px):
    """The picture seen otherwise: BGR image, lines, boxes, row above which nothing is learnt."""
    image = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
    height, width = image.shape[:2]
    fit = np.diag([size_px[0] / width, size_px[1] / height, 1.0])
    view = other_view(random, size_px) @ fit
    border = cv2.BORDER_REFLECT_101 if random.random() < 0.3 else cv2.BORDER_CONSTANT
    fill = tuple(random.integers(0, 255, 3).tolist())
    image = cv2.warpPerspective(image, view, size_px, flags=cv2.INTER_LINEAR, borderMode=border, borderValue=fill)
    inside = cv2.warpPerspective(np.ones((height, width), np.uint8), view, size_px, flags=cv2.INTER_NEAREST)
    lines = [moved_line(line, view) for line in picture.lines]
    boxes = [moved_box(box, view, size_px) for box in picture.boxes]
    top = moved(np.array([[0.0, picture.top_px], [width, picture.top_px]]), view)[:, 1].max()
    return other_light(random, image), inside, lines, boxes, top


def plain(picture, size_px):
    """The picture as it is, fitted to the network's input."""
    image = cv2.imdecode(np.frombuffer(picture.jpeg, np.uint8), cv2.IMREAD_COLOR)
    height, width = image.shape[:2]
    fit = np.diag([size_px[0] / width, size_px[1] / height, 1.0])
    image = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA)
    inside = np.ones(size_px[::-1], np.uint8)
    lines = [moved_line(line, fit) for line in picture.lines]
    boxes = [moved_box(box, fit, size_px) for box in picture.boxes]
    return image, inside, lines, boxes, picture.top_px * fit[1, 1]

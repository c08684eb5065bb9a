"""What is minimised: focal losses for presence, L1 for places, cross entropy for kinds, and a contrast
that makes an embedding recognise the same thing in two views of a picture.
"""

import torch
from torch.nn import functional as F

from pictures import BOXES, COLORS, MARKINGS


def focal(logits, target, weight):
    """CornerNet's focal loss (Law and Deng, 2018) on blobs; 1 marks what is there."""
    is_there = (target == 1.0).float() * weight
    probability = logits.sigmoid().clamp(1e-5, 1 - 1e-5)
    there = -torch.log(probability) * (1 - probability) ** 2 * is_there
    not_there = -torch.log(1 - probability) * probability**2 * (1 - target) ** 4 * weight * (target < 1.0)
    return (there.sum() + not_there.sum()) / is_there.sum().clamp(min=1.0)


def line_loss(out, target):
    score, weight, place, marking, color, instance = target
    there = instance >= 0
    terms = {"line": focal(out[:, 0], score, weight)}
    flat = out.permute(0, 2, 3, 1)[there]
    wanted = place.permute(0, 2, 3, 1)[there]
    # Steep steps matter less: a row is crossed in one cell.
    scale = torch.stack([torch.ones_like(wanted[:, 0])] + [1 + wanted[:, k].abs() for k in (1, 2)], 1)
    terms["place"] = ((flat[:, 1:4] - wanted).abs() / scale).mean() if len(flat) else out.sum() * 0
    m = len(MARKINGS)
    terms["marking"] = kinds(flat[:, 4 : 4 + m], marking[there])
    terms["color"] = kinds(flat[:, 4 + m : 4 + m + len(COLORS)], color[there])
    return terms


def kinds(logits, wanted):
    known = wanted >= 0
    if not known.any():
        return logits.sum() * 0
    return F.cross_entropy(logits[known], wanted[known], label_smoothing=0.02)


def box_loss(out, target, is_known):
    heat, weight, sides, near, _ = target
    count = len(BOXES)
    weight = weight * is_known.view(-1, 1, 1, 1)
    terms = {"box": focal(out[:, :count], heat, weight)}
    near = near * is_known.view(-1, 1, 1)
    off = (out[:, count : count + 4].clamp(-6, 6) - sides.clamp(min=0.05).log()).abs().mean(1)
    terms["sides"] = (off * near).sum() / near.sum().clamp(min=1.0)
    return terms


def means(embedding, instance):
    """Mean direction of each instance of a picture: {number: vector}."""
    found = {}
    for number in torch.unique(instance[instance >= 0]).tolist():
        found[number] = F.normalize(embedding[:, instance == number].mean(1), dim=0)
    return found


def contrast(embedding, instance, temperature=0.2):
    """Views 2k and 2k + 1 are of one picture: what is in both is to be found again among the rest."""
    total, count = embedding.sum() * 0, 0
    for k in range(0, len(embedding) - 1, 2):
        first, second = means(embedding[k], instance[k]), means(embedding[k + 1], instance[k + 1])
        both = sorted(set(first) & set(second))
        if len(both) > 1:
            a, b = torch.stack([first[n] for n in both]), torch.stack([second[n] for n in both])
            same = torch.arange(len(both))
            likeness = a @ b.T / temperature
            total = total + F.cross_entropy(likeness, same) + F.cross_entropy(likeness.T, same)
            count += 2
    return total / max(count, 1)


WEIGHTS = {
    "line": 1.0, "place": 1.0, "marking": 0.3, "color": 0.15, "line_again": 0.1,
    "box": 0.7, "sides": 0.7, "box_again": 0.1,
}


def loss(out_lines, out_boxes, lines, boxes, has_boxes):
    terms = line_loss(out_lines, lines) | box_loss(out_boxes, boxes, has_boxes)
    terms["line_again"] = contrast(out_lines[:, -8:], lines[-1])
    terms["box_again"] = contrast(out_boxes[:, -8:], boxes[-1])
    return sum(WEIGHTS[name] * value for name, value in terms.items()), terms

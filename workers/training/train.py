"""Trains the network: python train.py OUT --cities FOLDER... [--real FILE] [--hours H]

Pictures of the cities whose number ends in 9 are held back; the curve on them and the terms of the loss
go to OUT/curve.csv, the weights to OUT/last.pt. Stopped runs go on from there.
"""

import argparse
import csv
import pickle
import time
from pathlib import Path

import numpy as np
import torch

from augment import augmented
from losses import loss
from network import Network
from pictures import BOXES, UNKNOWN, read_city
from targets import STRIDE, box_targets, line_targets

SIZE_PX = (640, 360)
NO_SIGNS = {UNKNOWN, BOXES.index("vehicle")}
GRID = (SIZE_PX[1] // STRIDE, SIZE_PX[0] // STRIDE)


def is_held_back(folder):
    return folder.name.endswith("9")


def sample(random, picture):
    image, inside, lines, boxes, top_px = augmented(random, picture, SIZE_PX)
    tensor = np.ascontiguousarray(image[:, :, ::-1].transpose(2, 0, 1)).astype(np.float32) / 255.0
    of_lines = line_targets(lines, inside, boxes, top_px, GRID)
    return tensor, of_lines, box_targets(boxes, inside, GRID), np.float32(picture.has_boxes)


def with_signs(pictures):
    """Pictures by the class of paint that is asked for in them as a box: most have none."""
    pools = {}
    for picture in pictures:
        for kind in {box.kind for box in picture.boxes if box.weight > 0.0} - NO_SIGNS:
            pools.setdefault(kind, []).append(picture)
    return [pools[kind] for kind in sorted(pools)]


class Views(torch.utils.data.IterableDataset):
    """Pairs of views of pictures drawn at random; a share of them of real pictures, and a share from
    those with signs, each class as often."""

    def __init__(self, pictures, real, real_share, sign_share, seed):
        self.pictures, self.real, self.seed = pictures, real, seed
        self.real_share, self.sign_share, self.signs = real_share, sign_share, with_signs(pictures)

    def pool(self, random):
        lot = random.random()
        if self.real and lot < self.real_share:
            return self.real
        if self.signs and lot > 1.0 - self.sign_share:
            return self.signs[random.integers(len(self.signs))]
        return self.pictures

    def __iter__(self):
        worker = torch.utils.data.get_worker_info()
        random = np.random.default_rng([self.seed, worker.id if worker else 0])
        while True:
            pool = self.pool(random)
            picture = pool[random.integers(len(pool))]
            yield sample(random, picture)
            yield sample(random, picture)


def batches(views, size, workers):
    return iter(torch.utils.data.DataLoader(views, batch_size=size, num_workers=workers, prefetch_factor=4 if workers else None))


def step_loss(network, batch, half):
    image, lines, boxes, has_boxes = batch
    image = image.contiguous(memory_format=torch.channels_last)
    with torch.autocast("cpu", torch.bfloat16, enabled=half):
        out_lines, out_boxes = network(image)
    return loss(out_lines.float(), out_boxes.float(), lines, boxes, has_boxes)


def held_back_loss(network, pictures, count=96):
    """Mean loss on views that are the same every time."""
    network.eval()
    views = batches(Views(pictures, [], 0.0, 0.0, 1), 8, 0)
    with torch.no_grad():
        values = [float(step_loss(network, next(views), False)[0]) for _ in range(count // 8)]
    network.train()
    return sum(values) / len(values)


def learning_rate(done, peak=2e-3):
    """A short rise, then a cosine to nothing; `done` from 0 to 1."""
    return float(peak * min(done / 0.03 + 0.02, 1.0) * (0.5 + 0.5 * np.cos(np.pi * min(done, 1.0)) + 0.005))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--cities", nargs="+", type=Path, required=True)
    arguments.add_argument("--real", type=Path)
    arguments.add_argument("--real-share", type=float, default=0.12)
    arguments.add_argument("--sign-share", type=float, default=0.4)
    arguments.add_argument("--batch", type=int, default=16)
    arguments.add_argument("--steps", type=int, default=6000)
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--workers", type=int, default=1)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--from", dest="start", type=Path, help="weights to begin with")
    given = arguments.parse_args()
    torch.set_num_threads(given.threads)
    torch.manual_seed(given.seed)
    given.out.mkdir(parents=True, exist_ok=True)

    known = [p for city in given.cities if not is_held_back(city) for p in read_city(city)]
    held_back = [p for city in given.cities if is_held_back(city) for p in read_city(city)]
    real = pickle.loads(given.real.read_bytes()) if given.real else []
    print(f"{len(known)} pictures, {len(held_back)} held back, {len(real)} real", flush=True)

    network = Network().to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=0.02)
    step = 0
    last = given.out / "last.pt"
    if last.exists():
        kept = torch.load(last, weights_only=False)
        network.load_state_dict(kept["network"])
        optimizer.load_state_dict(kept["optimizer"])
        step = kept["step"]
    elif given.start:
        network.load_state_dict(torch.load(given.start, weights_only=True)["network"])
    views = batches(Views(known, real, given.real_share, given.sign_share, given.seed + 1000 * step), given.batch, given.workers)
    curve = (given.out / "curve.csv").open("a")
    writer, began, sums = csv.writer(curve), time.time(), {}
    network.train()
    while step < given.steps:
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(step / given.steps)
        value, terms = step_loss(network, next(views), True)
        optimizer.zero_grad(set_to_none=True)
        value.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 10.0)
        optimizer.step()
        step += 1
        for name, term in terms.items():
            sums[name] = sums.get(name, 0.0) + float(term)
        if step % 100 == 0:
            held = held_back_loss(network, held_back) if held_back and step % 500 == 0 else ""
            said = {name: round(total / 100, 4) for name, total in sums.items()}
            writer.writerow([step, round(time.time() - began), held, *said.values()])
            curve.flush()
            print(step, round(time.time() - began), held, said, flush=True)
            sums = {}
            state = {"network": network.state_dict(), "optimizer": optimizer.state_dict(), "step": step}
            torch.save(state, last.with_suffix(".new"))
            last.with_suffix(".new").rename(last)


if __name__ == "__main__":
    main()

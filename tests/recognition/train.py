#!/usr/bin/python3
"""Trains the recognition's network on simulated presses and writes it as ONNX.

Needs Debian's python3-torch. One thread: on busy processors two are slower. The same seed, data and
version of torch give the same weights.

    recognition_presses data/a --seed 1 --sensors 400
    train.py data/a data/b --samples 800000 -o model.onnx

The network is ResNet-18's topology at `width` channels instead of 64, with a stem of 3x3/2 without
pooling. Its output is one row: the scores of the twelve classes and of "another shape", then the
features (the last means over the map). Two heads learn on the features: that one, and one that tells every
single object from every other, which spreads unlike shapes apart; it is not exported.
"""
import argparse
import csv
import hashlib
import pathlib
import time

import numpy as np
import torch
from torch import nn

CLASSES = 12
SIDE = 96


def block(inside, outside, stride):
    return nn.Sequential(
        nn.Conv2d(inside, outside, 3, stride, 1, bias=False), nn.BatchNorm2d(outside), nn.ReLU(inplace=True),
        nn.Conv2d(outside, outside, 3, 1, 1, bias=False), nn.BatchNorm2d(outside))


class Residual(nn.Module):
    def __init__(self, inside, outside, stride):
        super().__init__()
        self.main = block(inside, outside, stride)
        self.side = nn.Sequential() if inside == outside and stride == 1 else nn.Sequential(
            nn.Conv2d(inside, outside, 1, stride, bias=False), nn.BatchNorm2d(outside))

    def forward(self, x):
        return torch.relu(self.main(x) + self.side(x))


class Network(nn.Module):
    def __init__(self, width):
        super().__init__()
        stages = [nn.Conv2d(1, width, 3, 2, 1, bias=False), nn.BatchNorm2d(width), nn.ReLU(inplace=True)]
        inside = width
        for level in range(4):
            for i in range(2):
                stages.append(Residual(inside, width << level, 2 if level and i == 0 else 1))
                inside = width << level
        self.body = nn.Sequential(*stages, nn.AdaptiveAvgPool2d(1), nn.Flatten())
        self.head = nn.Linear(inside, CLASSES + 1)

    def forward(self, x):
        features = self.body(x)
        return torch.cat([self.head(features), features], 1)


def load(folders):
    """Maps (int16, micrometres), labels, objects; and the hash of it all."""
    maps, kinds, variants, digest = [], [], [], hashlib.sha256()
    for folder in map(pathlib.Path, folders):
        values = np.fromfile(folder / "maps.i16", "<i2")
        with open(folder / "truth.csv") as file:
            rows = list(csv.DictReader(file))
        count = min(len(rows), len(values) // SIDE**2)
        maps.append(values[:count * SIDE**2].reshape(count, SIDE, SIDE))
        kinds += [int(row["kind"]) for row in rows[:count]]
        variants += [int(row["variant"]) for row in rows[:count]]
        digest.update(maps[-1].tobytes())
        digest.update(repr((kinds, variants)).encode())
    kinds, variants = np.array(kinds), np.array(variants)
    return np.concatenate(maps), kinds, kinds * 1000 + variants, digest.hexdigest()


def disturbed(maps, random, lopsided):
    """A batch in millimetres, moved, turned and mirrored, with faults of a calibration: gain, a tilted
    zero, noise; `lopsided`: a gain that changes across the map, and shoulders of the gel that are not
    seen, too."""
    out = np.zeros(maps.shape, np.float32)
    for i, one in enumerate(maps):
        one = np.rot90(one, random.integers(4))
        if random.random() < 0.5:
            one = one[:, ::-1]
        down, right = random.integers(-10, 11, 2)
        moved = one[max(0, -down):SIDE - max(0, down), max(0, -right):SIDE - max(0, right)] * np.float32(1e-3)
        inside = moved != 0
        tilt = random.normal(0, 0.015, 3)
        rows, columns = np.mgrid[-1:1:moved.shape[0] * 1j, -1:1:moved.shape[1] * 1j]
        slope = np.clip(random.normal(0, 0.12, 2), -0.4, 0.4) if lopsided and random.random() < 0.5 else (0, 0)
        gain = random.uniform(0.85, 1.2) * (1 + slope[0] * rows + slope[1] * columns)
        moved = moved * gain + inside * (tilt[0] + tilt[1] * rows + tilt[2] * columns)
        if lopsided and random.random() < 0.3:
            moved = np.maximum(moved - random.uniform(0, 0.06), 0)
        if random.random() < 0.5:
            moved += inside * random.normal(0, random.uniform(0, 0.02), moved.shape)
        out[i, max(0, down):SIDE + min(0, down), max(0, right):SIDE + min(0, right)] = moved
    return torch.from_numpy(np.clip(out, -1, 3))[:, None]


def mixed(maps, labels, instances, random, share):
    """Makes some of the batch a press of two unlike objects at once: another shape, of no instance."""
    maps, labels, instances = maps.copy(), labels.copy(), instances.copy()
    for i in np.flatnonzero(random.random(len(maps)) < share):
        j = random.integers(len(maps))
        if instances[i] == instances[j] or instances[j] < 0:
            continue
        maps[i] = np.maximum(maps[i], np.rot90(maps[j], random.integers(4)))
        labels[i], instances[i] = CLASSES, -100
    return maps, labels, instances


def calibrate(network, folders):
    """Divides the scores by a temperature and moves that of "another shape", so that probabilities
    hold on presses that training did not have, where three of four objects are of the twelve classes."""
    maps, kinds, _, digest = load(folders)
    labels = torch.from_numpy(np.minimum(kinds, CLASSES))
    network.eval()
    with torch.no_grad():
        scores = torch.cat([network(torch.from_numpy(part * np.float32(1e-3))[:, None])[:, :CLASSES + 1]
                            for part in np.array_split(maps, len(maps) // 64 + 1)])
    known = labels < CLASSES
    weights = torch.where(known, 0.75 / known.sum(), 0.25 / (~known).sum())

    def loss(temperature, move):
        moved = scores / temperature
        moved[:, CLASSES] += move
        return float((weights * nn.functional.cross_entropy(moved, labels, reduction="none")).sum())
    temperature, move = min(((t, m) for t in np.arange(0.4, 2.5, 0.05) for m in np.arange(-4, 4, 0.1)),
                            key=lambda pair: loss(*pair))
    print(f"calibrated on {len(maps)} presses, sha256 {digest}: temperature {temperature:.2f}, another shape {move:+.1f}")
    with torch.no_grad():
        network.head.weight /= temperature
        network.head.bias /= temperature
        network.head.bias[CLASSES] += move


def export(network, file):
    network.eval()
    torch.onnx.export(network, torch.zeros(1, 1, SIDE, SIDE), file, opset_version=11,
                      input_names=["depth_mm"], output_names=["scores_features"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+", help="folders of recognition_presses")
    parser.add_argument("--width", type=int, default=16)
    parser.add_argument("--samples", type=int, default=880000, help="presses shown in all, repeats included")
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--mixed", type=float, default=0.1, help="share of presses that are of two objects at once")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--crop", type=int, default=SIDE,
                        help="cells along each side that the first four fifths see: 64 is twice as fast")
    parser.add_argument("--held", nargs="*", default=[], help="folders, not of `data`, for calibrated probabilities")
    parser.add_argument("--lopsided", action="store_true", help="disturb by gains that change across the map, too")
    parser.add_argument("--start", nargs="+", help="weights (.pt) to go on from, or their mean, instead of random ones")
    parser.add_argument("-o", "--output", default="model.onnx")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(arguments.seed)
    random = np.random.default_rng(arguments.seed)
    maps, kinds, objects, digest = load(arguments.data)
    print(f"{len(maps)} presses, sha256 {digest}, torch {torch.__version__}, {vars(arguments)}", flush=True)

    labels = np.minimum(kinds, CLASSES)
    names, instances = np.unique(objects, return_inverse=True)
    counts = np.bincount(labels, minlength=CLASSES + 1)
    weights = torch.tensor(counts.sum() / (CLASSES + 1) / np.maximum(counts, 1), dtype=torch.float32)
    weights[CLASSES] *= 3
    network = Network(arguments.width)
    if arguments.start:
        found = [torch.load(file) for file in arguments.start]
        network.load_state_dict({key: sum(one[key] for one in found) / len(found) for key in found[0]})
    which = nn.Linear(arguments.width * 8, len(names))
    steps = arguments.samples // arguments.batch  # 0: export `start` only
    optimiser = torch.optim.AdamW([*network.parameters(), *which.parameters()], arguments.rate, weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, arguments.rate, total_steps=max(steps, 2), pct_start=0.1)
    order, begin, start, seen = np.array([], int), 0, time.process_time(), []
    network.train()
    for step in range(steps):
        if begin + arguments.batch > len(order):
            order, begin = random.permutation(len(maps)), 0
        chosen = order[begin:begin + arguments.batch]
        begin += arguments.batch
        edge = (SIDE - arguments.crop) // 2 if step < 0.8 * steps else 0
        batch, label, instance = mixed(maps[chosen], labels[chosen], instances[chosen], random, arguments.mixed)
        out = network(disturbed(batch, random, arguments.lopsided)[:, :, edge:SIDE - edge, edge:SIDE - edge].contiguous())
        scores, features = out[:, :CLASSES + 1], out[:, CLASSES + 1:]
        label = torch.from_numpy(label)
        loss = nn.functional.cross_entropy(scores, label, weights) \
            + 0.3 * nn.functional.cross_entropy(which(features), torch.from_numpy(instance))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        seen.append((float(loss), float((scores.argmax(1) == label).float().mean())))
        if (step + 1) % 500 == 0 or step + 1 == steps:
            mean = np.mean(seen[-500:], 0)
            print(f"{(step + 1) * arguments.batch} shown, loss {mean[0]:.3f}, right {mean[1]:.3f}, "
                  f"{time.process_time() - start:.0f} s of processor", flush=True)
            torch.save(network.state_dict(), arguments.output + ".pt")
    if arguments.held:
        calibrate(network, arguments.held)
    export(network, arguments.output)


if __name__ == "__main__":
    main()

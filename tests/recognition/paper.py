#!/usr/bin/python3
"""The paper's recognition beside this one: on one folder of recognition_presses with --images.

    recognition_presses set --seed 21 --sensors 1 --presses 1050 --frames 5 --lights 1 --last-kind 11 --images
    paper.py set image map                     # each of them with each split: frame, press, variant

`image`: the paper's recipe. ResNet-18 on camera images, random crop, flip and rotation, cross-entropy, Adam with
a rate of 1e-3 that falls to 0.3 of it every 5 epochs, 15 epochs, 70 % of the images for training. The paper
leaves open the batch (32 here), the start (random weights here), the crop (224 of 256 pixels here) and the angles
(quarter turns here). Products are in bfloat16, which is two to three times as fast on processors that have it.
`map`: the network of train.py on depth maps, as small as the shipped one, with the same images, split and epochs.

A split by frame puts frames of one press on both sides, as the paper's does; by press, no press is on both; by
variant, no object is. Needs Debian's python3-torch and python3-torchvision.
"""
import argparse
import csv
import hashlib
import pathlib
import time

import numpy as np
import torch
import torchvision
from torch import nn
from torchvision import transforms

import train

IMAGES = 4320  # of the paper
EPOCHS = 15
BATCH = 32
SIDE = 256
CROP = 224


def load(folder):
    """The first 4,320 presses: images (SIDE x SIDE), depth maps (um), kinds, and the groups of each split."""
    folder = pathlib.Path(folder)
    with open(folder / "truth.csv") as file:
        rows = list(csv.DictReader(file))
    if len(rows) < IMAGES:
        raise SystemExit(f"paper.py: {folder} has {len(rows)} presses and {IMAGES} are needed: make more")
    maps = np.fromfile(folder / "maps.i16", "<i2").reshape(-1, train.SIDE, train.SIDE)[:IMAGES]
    images = np.fromfile(folder / "images.u8", np.uint8).reshape(len(rows), -1)[:IMAGES]
    side = int(images.shape[1] ** 0.5)
    rows = rows[:IMAGES]
    images = torch.from_numpy(images.reshape(-1, 1, side, side).copy())
    images = torch.cat([transforms.functional.resize(part, SIDE, antialias=True) for part in images.split(100)])
    kinds = np.array([int(row["kind"]) for row in rows])
    groups = {
        "frame": np.arange(IMAGES),
        "press": np.unique([f"{row['sensor']}.{row['press']}" for row in rows], return_inverse=True)[1],
        "variant": kinds * 1000 + np.array([int(row["variant"]) for row in rows]),
    }
    return images, maps, kinds, groups, hashlib.sha256(images.numpy().tobytes() + maps.tobytes()).hexdigest()


def split_by(group, kinds, random):
    """Indices for training and test: whole groups, drawn for each class, until 30 % are for the test."""
    test = np.zeros(len(group), bool)
    for kind in range(train.CLASSES):
        of_kind = kinds == kind
        for one in random.permutation(np.unique(group[of_kind])):
            if test[of_kind].mean() >= 0.295:
                break
            test |= of_kind & (group == one)
    return np.flatnonzero(~test), np.flatnonzero(test)


class ImageInput:
    """ResNet-18 and the paper's augmentation."""
    def __init__(self, images, training):
        self.images = images
        # The mean is many times the contrast: as it is, batch norm's running means come too late.
        levels = images[training].float()
        self.mean, self.deviation = levels.mean(), levels.std()
        self.network = torchvision.models.resnet18(num_classes=train.CLASSES).to(memory_format=torch.channels_last)
        # Quarter turns: others leave black corners, which the images of the test do not have.
        self.augment = transforms.Compose([
            transforms.RandomCrop(CROP), transforms.RandomHorizontalFlip(),
            transforms.RandomChoice([lambda image, k=k: torch.rot90(image, k, (1, 2)) for k in range(4)])])
        self.optimiser = torch.optim.Adam(self.network.parameters(), 1e-3)
        self.schedule = torch.optim.lr_scheduler.StepLR(self.optimiser, 5, 0.3)
        self.each_step = False

    def batch(self, chosen, training):
        change = self.augment if training else transforms.CenterCrop(CROP)
        pixels = torch.stack([change(self.images[i]) for i in chosen]).float()
        pixels = (pixels - self.mean) / self.deviation
        return pixels.expand(-1, 3, -1, -1).contiguous(memory_format=torch.channels_last)

    def scores(self, pixels):
        with torch.autocast("cpu", dtype=torch.bfloat16):
            return self.network(pixels).float()


class MapInput:
    """The small network on depth maps, with the disturbances and the schedule of train.py."""
    def __init__(self, maps, steps, random):
        self.maps, self.random = maps, random
        self.network = train.Network(16)
        self.optimiser = torch.optim.AdamW(self.network.parameters(), 2e-3, weight_decay=0.02)
        self.schedule = torch.optim.lr_scheduler.OneCycleLR(self.optimiser, 2e-3, total_steps=steps, pct_start=0.1)
        self.each_step = True

    def batch(self, chosen, training):
        if training:
            return train.disturbed(self.maps[chosen], self.random, False)
        return torch.from_numpy(self.maps[chosen] * np.float32(1e-3))[:, None]

    def scores(self, maps):
        return self.network(maps)[:, :train.CLASSES]


def run(what, images, maps, kinds, training, test, seed):
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    steps = len(training) // BATCH
    learner = ImageInput(images, training) if what == "image" else MapInput(maps, EPOCHS * steps, random)
    labels = torch.from_numpy(kinds)
    start = time.process_time()
    for epoch in range(EPOCHS):
        learner.network.train()
        losses, order = [], random.permutation(training)
        for step in range(steps):
            chosen = order[step * BATCH:(step + 1) * BATCH]
            loss = nn.functional.cross_entropy(learner.scores(learner.batch(chosen, True)), labels[chosen])
            learner.optimiser.zero_grad()
            loss.backward()
            learner.optimiser.step()
            if learner.each_step:
                learner.schedule.step()
            losses.append(float(loss))
        if not learner.each_step:
            learner.schedule.step()
        print(f"  epoch {epoch + 1}: loss {np.mean(losses):.3f}, {time.process_time() - start:.0f} s of processor", flush=True)
        if (epoch + 1) % 5:
            continue
        learner.network.eval()
        with torch.no_grad():
            right = [(learner.scores(learner.batch(part, False)).argmax(1) == labels[part]).float().sum()
                     for part in np.array_split(test, len(test) // BATCH + 1)]
        print(f"  {float(sum(right)) / len(test):.3f} of {len(test)} named rightly", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("inputs", nargs="+", choices=["image", "map"])
    parser.add_argument("--splits", nargs="+", choices=["frame", "press", "variant"],
                        default=["frame", "press", "variant"])
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    images, maps, kinds, groups, digest = load(arguments.folder)
    print(f"{IMAGES} images, sha256 {digest}, torch {torch.__version__}, {vars(arguments)}", flush=True)
    for what in arguments.inputs:
        for by in arguments.splits:
            training, test = split_by(groups[by], kinds, np.random.default_rng(arguments.seed))
            print(f"{what}, split by {by}: {len(training)} for training, {len(test)} for the test", flush=True)
            run(what, images, maps, kinds, training, test, arguments.seed)


if __name__ == "__main__":
    main()

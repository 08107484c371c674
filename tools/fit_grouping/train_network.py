"""Trains the network on simulated maps and, with a share, on real ones of the folds that are not left out.

    python tools/fit_grouping/train_network.py OUT --simulated DIR [--start CHECKPOINT]
        [--cases CASES --leave-out FOLD --real-share 0.5] --seconds 3600

OUT.pt is the checkpoint (weights, their running mean, the optimizer's state, steps and seconds done), written
every few minutes; a run whose OUT.pt exists goes on from it until it has trained for that long all told.
OUT.onnx answers with the running mean of the weights. The learning rate falls to nothing over that time.

With `--processes 2` two processes, each on one core, change the same weights without waiting for each other
(Recht et al., Hogwild!, NIPS 2011). With `--bfloat16` convolutions count in 16 bits, which takes two thirds
of the time on processors that have instructions for it (AVX512_BF16, AMX), and longer on others.
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np
import torch
from torch import Tensor, nn

sys.path.insert(0, str(Path(__file__).parents[1]))

from fit_grouping.buildings.make_buildings import read_maps
from fit_grouping.buildings.raster import CELL_M
from fit_grouping.keeping import kept
from fit_grouping.maps_with_truth import TruthMap, load_benchmark
from fit_grouping.network import RoomNetwork, export_onnx
from fit_grouping.truth_rasters import TruthRaster, random_crop
from rose2_logs.config.parameters import SpectrumParameters
from rose2_logs.model.occupancy import BoolArray
from rose2_logs.segmentation.regions.plan_frame import PLAN_CELL_M, PlanFrame
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.system.files import replacing

CROP_CELLS = 160
BATCH = 6
LEARNING_RATE = 2e-3
WEIGHT_DECAY = 1e-3
WARM_UP_STEPS = 200
MEAN_DECAY = 0.998
"""Decay of the running mean of the weights, which is what is shipped."""
GRADIENT_MAX = 1.0
CHECKPOINT_EVERY_S = 240.0
HELD_OUT_MAX, HELD_OUT_SHARE = 40, 0.1
"""So many of the simulated maps, but no more than this share, are not trained on but watched."""
WATCHED_BATCHES = 24
"""Batches of watched maps of which the loss is told."""
VARIANTS = 3
"""Each real map is sampled so many times, at other scales and slightly other directions."""


def varied_frame(
    rng: np.random.Generator, known: BoolArray, direction_rad: float, resolution_m: float
) -> PlanFrame:
    """Plan frame with a slightly wrong direction and cells that are smaller or larger than they say."""
    scale = rng.uniform(0.85, 1.2)
    return PlanFrame.of(known, direction_rad + rng.normal(0, 0.012), resolution_m, PLAN_CELL_M * scale)


def simulated_rasters(folder: Path, seed: int) -> tuple[list[TruthRaster], list[TruthRaster]]:
    """Simulated maps of all files of a folder for training, and the last ones for watching it."""
    rng = np.random.default_rng(seed)
    rasters = []
    for path in sorted(folder.glob("*.npz")):
        for made in read_maps(path):
            free, occupied = made.gray > 229, made.gray < 90
            frame = varied_frame(rng, free | occupied, 0.0, CELL_M)
            rasters.append(TruthRaster.of(free, occupied, frame, made.truths))
    rasters = [r for r in rasters if r.truths[0].any()]
    held_out = max(1, min(HELD_OUT_MAX, int(HELD_OUT_SHARE * len(rasters))))
    return rasters[:-held_out], rasters[-held_out:]


def real_rasters(maps: Iterable[TruthMap], seed: int, variants: int) -> dict[str, list[TruthRaster]]:
    """Rasters of real maps by building."""
    rng = np.random.default_rng(seed)
    rasters: dict[str, list[TruthRaster]] = {}
    for one in maps:
        found = find_structure(one.occupied, one.resolution_m, SpectrumParameters()).directions_rad
        direction = float(found[0]) if len(found) else 0.0
        known = one.free | one.occupied
        for variant in range(variants):
            frame = PlanFrame.of(known, direction, one.resolution_m)
            if variant:
                frame = varied_frame(rng, known, direction, one.resolution_m)
            raster = TruthRaster.of(one.free, one.occupied, frame, one.truths)
            rasters.setdefault(one.building, []).append(raster)
    return rasters


def _real_maps(cases: Path, seed: int) -> tuple[dict[str, list[TruthRaster]], dict[str, list[TruthRaster]]]:
    """Varied and exact rasters of all buildings."""
    maps = load_benchmark(cases)
    return real_rasters(maps, seed, VARIANTS), real_rasters(maps, seed, 1)


class Batches:
    """Random crops: of simulated maps, and with a share of real ones, each building as often."""

    def __init__(
        self, simulated: list[TruthRaster], real: dict[str, list[TruthRaster]], real_share: float, seed: int
    ) -> None:
        self.simulated, self.real, self.real_share = simulated, real, real_share if real else 0.0
        self.rng = np.random.default_rng(seed)

    def next(self) -> tuple[Tensor, Tensor, Tensor]:
        """Inputs, targets and weights of a batch."""
        rng, crops = self.rng, []
        for _ in range(BATCH):
            pool = self.simulated
            if rng.random() < self.real_share:
                pool = self.real[list(self.real)[rng.integers(len(self.real))]]
            crops.append(random_crop(rng, pool[rng.integers(len(pool))], CROP_CELLS))
        inputs, targets, weights = (torch.from_numpy(np.stack(parts)) for parts in zip(*crops, strict=True))
        return inputs, targets, weights


def loss_of(network: nn.Module, batch: tuple[Tensor, Tensor, Tensor], *, bfloat16: bool = False) -> Tensor:
    """Sum over the outputs of the weighted mean cross-entropy."""
    device = next(network.parameters()).device
    inputs, targets, weights = (part.to(device) for part in batch)
    inputs = inputs.contiguous(memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16, enabled=bfloat16):
        odds = network(inputs)
    loss = nn.functional.binary_cross_entropy_with_logits(odds.float(), targets, reduction="none")
    per_output = (loss * weights).sum((0, 2, 3)) / (weights.sum((0, 2, 3)) + 1)
    return per_output.sum()


@dataclass(frozen=True)
class Trainer:
    """Changes a network, batch by batch, at a rate that falls to nothing over a time.

    Attributes
    ----------
    network : RoomNetwork
    batches : Batches
    learning_rate : float
        At the beginning.
    seconds, begun : float
        Training time in all, and when it would have begun had it not been interrupted (monotonic clock).
    optimizer : torch.optim.Optimizer
    bfloat16 : bool
        Whether convolutions count in 16 bits.
    """

    network: RoomNetwork
    batches: Batches
    learning_rate: float
    seconds: float
    begun: float
    optimizer: torch.optim.Optimizer
    bfloat16: bool = False

    def left(self) -> float:
        """Share of the time that is left, 0 at its end."""
        return max(0.0, 1 - (time.monotonic() - self.begun) / self.seconds)

    def step(self, number: int) -> float:
        """Go one step; the loss before it."""
        rate = self.learning_rate * min(1.0, (number + 1) / WARM_UP_STEPS) * self.left()
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.network.train()
        self.optimizer.zero_grad()
        loss = loss_of(self.network, self.batches.next(), bfloat16=self.bfloat16)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_MAX)
        self.optimizer.step()
        return float(loss.item())


def _step_until_done(trainer: Trainer) -> None:
    """Train in a process of its own on weights that are shared."""
    torch.set_num_threads(1)
    number = 0
    while trainer.left() > 0:
        trainer.step(number)
        number += 1


@contextmanager
def helped(trainers: list[Trainer]) -> Iterator[None]:
    """Let processes of their own train the same weights meanwhile."""
    context = torch.multiprocessing.get_context("fork")
    processes = [context.Process(target=_step_until_done, args=(t,), daemon=True) for t in trainers]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _optimizer_of(network: RoomNetwork) -> torch.optim.Optimizer:
    """A new optimizer; the rate is set at each step."""
    return torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)


def main() -> None:
    """Train for a time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--simulated", type=Path, required=True, help="folder with files of make_buildings")
    parser.add_argument("--cases", type=Path)
    parser.add_argument("--leave-out", type=int, help="fold whose maps are not seen")
    parser.add_argument("--real-share", type=float, default=0.0)
    parser.add_argument("--start", type=Path, help="checkpoint whose weights are begun with")
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder in which sampled maps are kept for the next run")
    parser.add_argument("--learning-rate", type=float, default=LEARNING_RATE)
    parser.add_argument("--processes", type=int, default=1, help="processes that train together, on CPUs")
    parser.add_argument("--bfloat16", action="store_true", help="count in 16 bits")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    torch.manual_seed(arguments.seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = RoomNetwork().to(device, memory_format=torch.channels_last)
    optimizer = _optimizer_of(network)
    steps, before = 0, 0.0
    checkpoint = arguments.out.with_suffix(".pt")
    mean = copy.deepcopy(network).eval()
    if checkpoint.exists():
        state = torch.load(checkpoint, map_location=device)
        network.load_state_dict(state["network"])
        mean.load_state_dict(state["mean"])
        optimizer.load_state_dict(state["optimizer"])
        steps, before = state["steps"], state.get("seconds", 0.0)
        if before >= arguments.seconds:
            return
    elif arguments.start:
        begun_with = torch.load(arguments.start, map_location=device)["mean"]
        network.load_state_dict(begun_with)
        mean.load_state_dict(begun_with)
    network.share_memory()
    keep: Path | None = arguments.keep
    simulated, held_out = kept(
        keep and keep / "simulated.pkl", lambda: simulated_rasters(arguments.simulated, arguments.seed)
    )
    real: dict[str, list[TruthRaster]] = {}
    watched = {"simulated": held_out}
    if arguments.cases:
        maps, exact = kept(keep and keep / "real.pkl", lambda: _real_maps(arguments.cases, arguments.seed))
        folds = {one.building: one.fold for one in load_benchmark(arguments.cases)}
        real = {b: rasters for b, rasters in maps.items() if folds[b] != arguments.leave_out}
        watched["left out"] = [
            r for b, rs in exact.items() if folds[b] == arguments.leave_out for r in rs[:3]
        ]
    fixed = {
        name: [b.next() for b in [Batches(rasters, {}, 0.0, 7)] for _ in range(WATCHED_BATCHES)]
        for name, rasters in watched.items()
        if rasters
    }
    print(f"{len(simulated)} simulated maps, {len(real)} real buildings, from step {steps}", flush=True)
    now = last = time.monotonic()
    start, losses = now - before, []
    trainers = [
        Trainer(
            network,
            Batches(simulated, real, arguments.real_share, arguments.seed + steps + 1 + 1_000_000 * number),
            arguments.learning_rate,
            arguments.seconds,
            start,
            _optimizer_of(network) if number else optimizer,
            arguments.bfloat16,
        )
        for number in range(arguments.processes)
    ]
    with helped(trainers[1:]):
        while now - start < arguments.seconds:
            losses.append(trainers[0].step(steps))
            steps += 1
            decay = min(MEAN_DECAY, 1 - 10 / (steps + 10))
            with torch.no_grad():
                for slow, new in zip(mean.state_dict().values(), network.state_dict().values(), strict=True):
                    if slow.dtype.is_floating_point:
                        slow.lerp_(new, 1 - decay)
            now = time.monotonic()
            if now - last > CHECKPOINT_EVERY_S or now - start >= arguments.seconds:
                last = now
                told = _watched(mean, fixed)
                print(
                    f"{now - start:6.0f} s {steps:6d} steps: loss {np.mean(losses):.3f}, {told}", flush=True
                )
                losses.clear()
                # The network first: where there is a checkpoint, there is its network or a later one.
                with replacing(checkpoint.with_suffix(".onnx")) as part:
                    export_onnx(copy.deepcopy(mean).cpu(), part)
                _save(checkpoint, network, mean, optimizer, steps, now - start)


def _watched(mean: RoomNetwork, fixed: dict[str, list[tuple[Tensor, Tensor, Tensor]]]) -> str:
    """The loss of the running mean on maps that are not trained on, as text."""
    mean.eval()
    with torch.no_grad():
        seen = {name: np.mean([loss_of(mean, b).item() for b in bs]) for name, bs in fixed.items()}
    return ", ".join(f"{name} {value:.3f}" for name, value in seen.items())


def _save(
    path: Path,
    network: RoomNetwork,
    mean: RoomNetwork,
    optimizer: torch.optim.Optimizer,
    steps: int,
    seconds: float,
) -> None:
    state = {
        "network": network.state_dict(),
        "mean": mean.state_dict(),
        "optimizer": optimizer.state_dict(),
        "steps": steps,
        "seconds": seconds,
    }
    with replacing(path) as part:
        torch.save(state, part)


if __name__ == "__main__":
    main()

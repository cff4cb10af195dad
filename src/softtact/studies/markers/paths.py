"""The paper's presses: poses of the sensor over an object, sequences of frames, the printed split, and a share of it.

A pose is where the sensor's middle is over the object and how it is turned: nine places {-4, 0, 4}^2 mm, seven angles -90 to 90
degrees by 30. From a pose the sensor goes down by steps of 0.1 mm to a depth of 0.1 to 1.5 mm, then aside along x or y by steps of
0.1 mm to 1 mm: a sequence of 1 + depth/0.1 + 10 frames, the first at rest. The paper counts each depth once and ten frames aside
in two directions: 15 (1 + 20) = 315 pairs of images a pose, 63 poses, 16 objects, 317,520 pairs.

Frames: in the sensor frame (z out of the surface, towards the object) a mesh with y up lies with y against z; x of the mesh is x
of the sensor at angle 0 and z of the mesh is y. The paper states neither the signs of places and angles nor the camera's axes;
all signs of both are among its poses.
"""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.geometry.pose import Pose

PAIRS_PRINTED, PAIRS_OF_OBJECT = 317_520, 19_845
TRAIN, HELD_OUT, UNSEEN = "train", "held_out", "unseen"
SPLITS = (TRAIN, HELD_OUT, UNSEEN)


@dataclass(frozen=True)
class Path:
    """The grid of poses, and steps of a press."""

    places_mm: Sequence[float]
    """Of the sensor's middle along x, and along y."""
    angles_deg: Sequence[float]
    """Of the sensor about its normal."""
    step_mm: float
    """Between two frames."""
    depth_mm: float
    """The largest."""
    aside_mm: float
    """At the end of each sequence."""

    @property
    def poses(self) -> list[tuple[float, float, float]]:
        """(x, y, angle) of all poses."""
        return [(x, y, angle) for x in self.places_mm for y in self.places_mm for angle in self.angles_deg]

    @property
    def frames(self) -> int:
        """Of the longest sequence; 26 of the paper's."""
        return 1 + self.steps(self.depth_mm) + self.steps(self.aside_mm)

    def steps(self, length_mm: float) -> int:
        """How many steps a length takes."""
        return max(1, round(length_mm / self.step_mm))

    def pairs(self) -> int:
        """Pairs of images of one object, as the paper counts them."""
        depths = self.steps(self.depth_mm)
        return len(self.poses) * depths * (1 + 2 * self.steps(self.aside_mm))


@dataclass(frozen=True)
class SequencePlan:
    """One sequence of an object."""

    object: str
    """Its name."""
    split: str
    """train, held_out (another pose of an object that is trained on) or unseen (object)."""
    x_mm: float
    """Where the sensor's middle is."""
    y_mm: float
    angle_deg: float
    depth_mm: float
    """After the press down."""
    aside: str
    """x or y: axis of the sensor along which it moves then."""

    def motion(self, path: Path) -> Motion:
        """The object's motion on the sensor, which is the reverse of the sensor's on the object."""
        down, across = path.steps(self.depth_mm), path.steps(path.aside_mm)
        ways = {"x_mm" if self.aside == "x" else "y_mm": -path.aside_mm}
        return Motion().press(depth_mm=list(self.depth_mm * (1 + np.arange(down)) / down)).slide(**ways, steps=across)

    def moved_mm(self, path: Path) -> np.ndarray:
        """(frame, 2) depth and displacement aside of each frame, the first at rest."""
        down, across = path.steps(self.depth_mm), path.steps(path.aside_mm)
        depth = self.depth_mm * np.minimum(np.arange(1 + down + across), down) / down
        return np.column_stack([depth, path.aside_mm * np.maximum(np.arange(1 + down + across) - down, 0) / across])


def pose_on_sensor(x_mm: float, y_mm: float, angle_deg: float) -> Pose:
    """Pose in the sensor frame of a mesh with y up, for a sensor whose middle is at (x, y) over it, turned by an angle.

    Its height is that at which the uppermost plane of a mesh of 10 mm touches; a press starts at first touch whatever it is.
    """
    turned = Rotation.from_euler("z", -angle_deg, degrees=True)
    facing = Rotation.from_euler("x", -90, degrees=True)  # (x, y, z) -> (x, z, -y)
    return Pose(turned.apply([-x_mm, -y_mm, 10.0]), turned * facing)


@dataclass(frozen=True)
class Share:
    """How many of the printed poses and depths are pressed."""

    train_poses: int
    """Of each object that is trained on, of those that are not held out."""
    held_out_poses: int
    """Of the same objects, for tests."""
    unseen_poses: int
    """Of each object of the tests."""
    train_depths_mm: Sequence[float]
    """Of the sequences that are trained on."""
    test_depths_mm: Sequence[float]
    """Of the sequences of the tests."""
    held_out: int
    """Poses that are held out of each object that is trained on; 15 in the paper."""


def plans(path: Path, share: Share, *, train: Sequence[str], test: Sequence[str], seed: int) -> list[SequencePlan]:
    """All sequences of a study, object by object; the same seed draws the same poses.

    The paper's numbers give its whole split: 48 and 15 poses of each object that is trained on, 63 of each other one.
    """
    found = []
    for name in (*train, *test):
        for split, pose in _drawn(path, share, name, seen=name in train, seed=seed):
            depths = share.train_depths_mm if split == TRAIN else share.test_depths_mm
            found += [SequencePlan(name, split, *pose, depth, aside) for depth in depths for aside in ("x", "y")]
    return found


def _drawn(path: Path, share: Share, name: str, *, seen: bool, seed: int) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """(split, pose) of an object."""
    poses = path.poses
    order = np.random.default_rng([seed, zlib.crc32(name.encode())]).permutation(len(poses))
    if not seen:
        yield from ((UNSEEN, poses[k]) for k in order[: share.unseen_poses])
        return
    held = min(share.held_out, len(poses) - 1)
    yield from ((HELD_OUT, poses[k]) for k in order[:held][: share.held_out_poses])
    yield from ((TRAIN, poses[k]) for k in order[held:][: share.train_poses])


def check_motion(path: Path, depths_mm: Sequence[float]) -> None:
    """Refuse depths that are no whole numbers of steps, or beyond the path's depth."""
    for depth in depths_mm:
        if abs(depth / path.step_mm - round(depth / path.step_mm)) > 1e-6 or not 0 < depth <= path.depth_mm + 1e-9:
            raise InputError(
                f"share: a depth of {depth:g} mm is not among steps of {path.step_mm:g} mm to {path.depth_mm:g} mm; "
                "give a multiple of path.step_mm up to path.depth_mm."
            )

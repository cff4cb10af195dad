"""The configuration of the study of marker images."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt, model_validator

from softtact.errors import InputError
from softtact.learning.image_settings import NETWORKS, ImageTraining
from softtact.readout.camera import camera_of
from softtact.sensors.fields import plain_value
from softtact.sensors.specification import AnySpec, read_spec
from softtact.studies.configuration import found_sensor, read_mapping, read_over, validated
from softtact.studies.hybrid.keys import Name, NotNegative
from softtact.studies.markers import paths
from softtact.studies.markers.pressing import deepest_mm
from softtact.studies.markers.shapes import OBJECTS
from softtact.unknown_names import Section

DEFAULT = "config/markers.yaml"
_Numbers = Annotated[list[float], Field(min_length=1)]
_Depths = Annotated[list[PositiveFloat], Field(min_length=1)]
_Count = Annotated[int, Field(ge=0)]
_Names = Annotated[list[Literal[OBJECTS]], Field(min_length=1)]  # type: ignore[valid-type]


class Objects(Section):
    """Which objects are trained on, and which only tested."""

    train: _Names
    test: _Names

    @model_validator(mode="after")
    def _apart(self):
        if twice := [name for name in [*self.train, *self.test] if max(self.train.count(name), self.test.count(name)) > 1]:
            raise ValueError(f"it names {twice[0]!r} twice; remove one of the two")
        if both := sorted(set(self.train) & set(self.test)):
            raise ValueError(f"{both[0]!r} is in both train and test; leave it in one of them")
        return self


class PathKeys(Section):
    """The grid of poses, and the steps of a press."""

    places_mm: _Numbers = Field(description="of the sensor's middle over the object, along x and along y")
    angles_deg: _Numbers = Field(description="of the sensor about its normal")
    step_mm: PositiveFloat = Field(description="between two frames")
    depth_mm: PositiveFloat
    aside_mm: PositiveFloat


class ShareKeys(Section):
    """How much of the printed data set is pressed."""

    train_poses: PositiveInt = Field(description="of each object of objects.train, of those not held out; 48 in the paper")
    held_out_poses: _Count = Field(description="of the same objects, for tests; 15 in the paper")
    unseen_poses: PositiveInt = Field(description="of each object of objects.test; 63 in the paper")
    train_depths_mm: _Depths = Field(description="of the sequences that are trained on")
    test_depths_mm: _Depths = Field(description="of the sequences of the tests")
    held_out: _Count = Field(15, description="poses that are drawn for tests, of each object of objects.train")


def _numbered(value: Any) -> Any:
    """A number of seeds as the seeds from 0 on; all else as it is."""
    return list(range(value)) if isinstance(value, int) and not isinstance(value, bool) else value


class NetworkKeys(Section):
    """The networks that are compared."""

    size: Literal["reduced", "printed"] = Field(description="reduced: 64 pixels, 2.1 million weights; printed: 256, 58.6 million")
    names: Annotated[list[Literal[tuple(NETWORKS)]], Field(min_length=1)]  # type: ignore[valid-type]
    seeds: Annotated[list[_Count], BeforeValidator(_numbered), Field(min_length=1)] = Field(
        description="of the trainings of each network, or how many from 0 on; 5 in the paper")
    training: ImageTraining = ImageTraining()
    device: str = Field("auto", description="cpu, cuda, cuda:1 or auto")

    @model_validator(mode="after")
    def _seeds_differ(self):
        if len(set(self.seeds)) < len(self.seeds):
            raise ValueError(f"seeds is {self.seeds}, which names a seed twice; name each once")
        return self


class SlidingKeys(Section):
    """The test that tells fixed objects from free ones."""

    depth_mm: PositiveFloat
    aside_mm: PositiveFloat


class MarkerValues(Section):
    """The keys of config/markers.yaml."""

    study: Name = Field(description="its name, and its folder below results/")
    kind: Literal["markers"] = Field(exclude=True, description="of study")
    seed: _Count = Field(description="of drawn poses and of the networks")
    sensor: str = Field(description="name or YAML file of a sensor with the readouts camera, markers and depth")
    friction: Annotated[NotNegative, BeforeValidator(plain_value)] | None = Field(
        None, description="of the object on the gel; null: the sensor's"
    )
    meshes: str | None = Field(
        None,
        description="folder with a file OBJECT.STL (mm, y up) for each object; environment variables "
        "are replaced; an object without a file is generated",
    )
    objects: Objects
    path: PathKeys
    share: ShareKeys
    poses_per_file: PositiveInt = Field(9, description="of an object; a job presses one file")
    surface_maps: bool = Field(False, description="whether files also hold displacement and traction of the surface")
    networks: NetworkKeys
    baselines: list[Literal["full_stick", "linear_frictionless"]] = Field([], description="other physics, pressed for the tests")
    scored_every: PositiveInt = Field(description="frames, from each test sequence's last one back")
    sliding: SlidingKeys
    shown: _Count = Field(3, description="sequences on the page that one drags through")

    @model_validator(mode="after")
    def _agrees(self):
        for name in ("train_depths_mm", "test_depths_mm"):
            try:
                paths.check_motion(self.grid, getattr(self.share, name))
            except InputError as error:
                raise ValueError(str(error)) from None
        return self

    @property
    def grid(self) -> paths.Path:
        """The path as a record."""
        return paths.Path(**self.path.model_dump())


@dataclass(frozen=True)
class MarkerStudy:
    """A checked configuration with what it presses."""

    values: MarkerValues
    """The configuration."""
    spec: AnySpec
    """The sensor."""

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.values.study

    @property
    def objects(self) -> list[str]:
        """Names of all objects, those that are trained on first."""
        return [*self.values.objects.train, *self.values.objects.test]

    @cached_property
    def plans(self) -> list[paths.SequencePlan]:
        """All sequences, object by object."""
        objects = self.values.objects
        return paths.plans(
            self.values.grid,
            paths.Share(**self.values.share.model_dump()),
            train=objects.train,
            test=objects.test,
            seed=self.values.seed,
        )

    @property
    def pixels(self) -> int:
        """Side in px of the images that networks take."""
        return 256 if self.values.networks.size == "printed" else 64

    @property
    def marker_radius_px(self) -> float:
        """Of the sensor's camera, in px of its image."""
        camera = camera_of(self.spec, "camera")
        return camera.markers.radius_mm / camera.pinhole.mm_per_px  # type: ignore[union-attr]

    @property
    def deepest_mm(self) -> float:
        """Depth that grey 255 stands for: the depth readout's largest."""
        return deepest_mm(self.spec)

    def mesh_file(self, name: str) -> Path | None:
        """The file of an object, or None where it is generated."""
        if not self.values.meshes:
            return None
        folder = Path(os.path.expandvars(self.values.meshes))
        return next((folder / f"{name}{end}" for end in (".STL", ".stl") if (folder / f"{name}{end}").is_file()), None)


def read_values(path: str | Path) -> dict[str, Any]:
    """The configuration mapping of a file; what it does not state is as in config/markers.yaml."""
    return read_over(DEFAULT, path)


def load_study(values: Mapping[str, Any], path: str | Path | None = None) -> MarkerStudy:
    """The `MarkerStudy` of a configuration mapping; keys that it leaves out are as in config/markers.yaml.

    Raises InputError that names file, field and remedy.
    """
    where = str(path or "the configuration")
    checked = validated(MarkerValues, read_mapping(DEFAULT) | dict(values), where=where)
    spec = read_spec(found_sensor(checked.sensor))
    missing = [name for name in ("camera", "markers", "depth") if name not in spec.stated_readouts]
    if missing:
        raise InputError(
            f"{where}, at 'sensor': {spec.name} has no readout {missing[0]!r}; name a sensor with the readouts camera, "
            "markers and depth, for example gelsight_wonkdim."
        )
    if camera_of(spec, "camera").markers == "none":
        raise InputError(f"{where}, at 'sensor': the camera of {spec.name} sees no markers; add them to its readout camera.")
    return MarkerStudy(checked, spec)


"""Settings of a study's networks, each with its type and description; a wrong value is refused in one sentence.

Defaults are those of the paper; a description says if the paper does not state the value.
"""

from typing import Annotated, Any, Literal, Self

import pydantic
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from softtact.errors import InputError
from softtact.unknown_names import Section


def _rising(bounds):
    if bounds[0] > bounds[1]:
        raise ValueError("a range is [smallest, largest]; swap the two")
    return bounds


Widths = Annotated[tuple[PositiveInt, PositiveInt], pydantic.AfterValidator(_rising)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Rates = Annotated[tuple[PositiveFloat, PositiveFloat], pydantic.AfterValidator(_rising)]


class Settings(Section):
    """A section that stages read without the rest of the configuration."""

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str) -> Self:
        """The section from plain values; raises an InputError with key and value for the first fault."""
        try:
            return cls.model_validate(values)
        except pydantic.ValidationError as error:
            fault = error.errors()[0]
            key = ".".join([where, *map(str, fault["loc"])])
            if fault["type"] == "extra_forbidden":
                raise InputError(f"{key}: there is no such key; use one of {', '.join(cls.model_fields)}.") from None
            reason = fault["msg"].removeprefix("Value error, ")
            raise InputError(f"{key}: {reason} (it is {fault['input']!r:.60}).") from None


class Compact(Settings):
    """The small network structured like the sensor; it has no hidden layer and is not part of the search."""

    filters: tuple[PositiveInt, PositiveInt, PositiveInt] = Field((16, 32, 64), description="full grid, halving, half grid")
    learning_rate: PositiveFloat = Field(3e-3, description="of the first epoch, in place of `training.learning_rate`")
    epochs: PositiveInt | None = Field(None, description="at most; by default as many as in `training`")


class Network(Settings):
    """The network of a study's results: the printed one, the best of the search, or the compact one.

    For comparison a network of the other kind is trained on the same split: compact, or printed if compact is chosen.
    """

    architecture: Literal["printed", "searched", "compact"] = "printed"
    filters: tuple[PositiveInt, ...] = Field((80, 95, 120), min_length=1, description="of each 2 x 2 convolution")
    dense: PositiveInt = Field(570, description="neurons of the hidden layer")
    activation: Literal["relu", "linear"] = Field("relu", description="after a convolution; the paper does not state it")
    compact: Compact = Compact()


class SearchSpace(Settings):
    """Ranges [smallest, largest] of the search; equal ends fix a value."""

    layers: Widths | None = Field(None, description="convolutions, the first of `filters`; by default 2 up to as many as it has")
    filters: tuple[Widths, ...] = Field(((16, 128), (16, 128), (16, 160), (16, 160)), min_length=1, description="per convolution")
    dense: Widths = Field((64, 768), description="drawn on a logarithmic scale")
    learning_rate: Rates = Field((1e-4, 2e-3), description="drawn on a logarithmic scale")

    @pydantic.model_validator(mode="after")
    def _has_filters_for_each_layer(self):
        if self.depth[1] > len(self.filters):
            raise ValueError(f"layers goes to {self.depth[1]}, and filters has ranges for {len(self.filters)}; give as many")
        return self

    @property
    def depth(self) -> tuple[int, int]:
        """Least and greatest number of convolutions."""
        return self.layers or (min(2, len(self.filters)), len(self.filters))


class Search(Settings):
    """Hyperparameter search with Optuna's sampler and Hyperband pruner. The paper prints only its result."""

    trials: PositiveInt = 30
    max_epochs: PositiveInt = Field(27, description="of a trial that is never pruned")
    batch: PositiveInt = 16
    maps: PositiveInt | None = Field(None, description="training maps of a trial, drawn with the seed; all by default")
    reduction_factor: int = Field(3, ge=2, description="of Hyperband: one of this many trials continues")
    space: SearchSpace = SearchSpace()


class Training(Settings):
    """The training of one network. The paper states only the loss."""

    epochs: PositiveInt = 60
    batch: PositiveInt = Field(16, description="maps per step")
    patience: PositiveInt = Field(10, description="epochs without a better validation loss before training ends")
    learning_rate: PositiveFloat | Literal["found"] = Field(
        "found", description="of the first epoch; found: for the printed network among `rates`, for the searched one by its search")
    rates: tuple[PositiveFloat, ...] = Field((3e-5, 1e-4, 3e-4, 1e-3), min_length=1,
                                             description="tried on the printed network itself")
    rate_epochs: PositiveInt = Field(4, description="of each of these trials")
    schedule: Literal["cosine", "constant"] = Field("cosine", description="of the learning rate over the epochs")
    checkpoint_every_s: NonNegativeFloat = Field(120.0, description="least time between two checkpoints")
    device: Literal["auto", "cpu", "cuda"] = Field("auto", description="auto: a GPU if there is one")
    threads: PositiveInt = Field(2, description="of a training, also on fewer cores, because the weights depend on their number")


class LearningCurve(Settings):
    """SSIM against the number of training maps: the same training on increasing shares of them."""

    shares: tuple[Share, ...] = Field((), description="of the training maps, rising; empty: no learning curve")
    steps: PositiveInt = Field(300, description="of the optimiser at each share, so that all shares are trained equally long")
    networks: tuple[Literal["printed", "searched", "compact"], ...] = Field(("compact",), min_length=1)

    @pydantic.field_validator("shares")
    @classmethod
    def _rise(cls, shares):
        if list(shares) != sorted(set(shares)):
            raise ValueError("shares rise from one to the next; sort them and leave out doubles")
        return shares


class Repeats(Settings):
    """The same training from several seeds, with the same presses and split, for the scatter of a score."""

    seeds: PositiveInt = Field(1,
                               description="trainings of each network, from the study's seed and those after it; 1: no repetition")
    networks: tuple[Literal["printed", "searched", "compact"], ...] = Field(("compact",), min_length=1)


class Ssim(Settings):
    """Structural similarity of tactile maps."""

    window: int = Field(3, ge=3, description="side of the window in taxels, odd")
    data_range: PositiveFloat = Field(2400.0, description="counts from the least to the greatest possible reading")

    @pydantic.field_validator("window")
    @classmethod
    def _odd(cls, window):
        if window % 2 == 0:
            raise ValueError("a window has a taxel at its centre; give an odd side")
        return window


def chosen_network(network: Network, best: dict[str, Any] | None) -> dict[str, Any]:
    """Architecture and its options: as printed, from the search (`best`), or those of the compact network."""
    if network.architecture == "compact":
        return {"architecture": "compact", "filters": network.compact.filters}
    searched = {name: best[name] for name in ("filters", "dense")} if network.architecture == "searched" and best else {}
    return {**network.model_dump(include={"filters", "dense", "activation"}), **searched}


def chosen_training(options: Training, network: Network, found: dict[str, Any] | None) -> Training:
    """`options` with the learning rate as a number: found for this network, stated, or that of the compact network.

    found: result of the search or, for the printed network, of the trial of rates
    """
    if network.architecture == "compact":
        compact = {"learning_rate": network.compact.learning_rate, "epochs": network.compact.epochs or options.epochs}
        return options.model_copy(update=compact)
    if options.learning_rate != "found":
        return options
    if found is None:
        raise InputError(f"training.learning_rate is 'found', but no rate of the {network.architecture} network is given; "
                         "give the result of find_learning_rate or of the search, or state a number.")
    return options.model_copy(update={"learning_rate": found["learning_rate"]})


def found_for(network: Network, *, search: dict[str, Any] | None, trial: dict[str, Any] | None) -> dict[str, Any] | None:
    """The best of the search or of the trial of rates for this network; the rate of another architecture does not apply."""
    return {"printed": trial, "searched": search, "compact": None}[network.architecture]

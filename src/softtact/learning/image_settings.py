"""Which networks of marker images there are, and how they are trained; read without torch."""

from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from softtact.learning.settings import Settings

Momentum = Annotated[float, Field(ge=0.0, lt=1.0)]

NETWORKS: dict[str, dict[str, int]] = {
    "proposed": {"lstm_layers": 2, "temporal": 1},
    "no_lstm": {"lstm_layers": 0, "temporal": 1},
    "pix2pix": {"lstm_layers": 0, "temporal": 1},
    "temporal": {"lstm_layers": 0, "temporal": 3},
}
"""Options of the compared networks. Pix2Pix is trained on frames in random order, the others on sequences."""


class ImageTraining(Settings):
    """How a generator is trained; the defaults are printed ones."""

    epochs: PositiveInt = 20
    constant_epochs: PositiveInt = Field(10, description="with the first rate; then it falls linearly to 0")
    learning_rate: PositiveFloat = 2e-4
    momenta: tuple[Momentum, Momentum] = Field((0.5, 0.999), description="of Adam")
    l1_weight: NonNegativeFloat = Field(100.0, description="of the mean absolute error of pixels beside the adversarial loss")
    shuffle_frames: bool = Field(False, description="steps take frames of all sequences in random order: Pix2Pix")
    frames: PositiveInt = Field(26, description="of a step with shuffled frames")
    checkpoint_every_s: PositiveFloat = 300.0

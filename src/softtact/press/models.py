"""The models that a press can take, by name: each a function from a placed object and forces to a `PressResult`."""

from softtact.press.fast import press_elastic, press_elastic_motion, press_on_foundation
from softtact.press.hyperelastic import press_hyperelastic

# Those that take a `Motion` in place of forces.
MOTIONS = {"elastic": press_elastic_motion, "hyperelastic": press_hyperelastic}
PRESSES = {"elastic": press_elastic, "foundation": press_on_foundation, "hyperelastic": press_hyperelastic}

"""The nonlinear law of one frustum, from its hyperelastic unit cell, for the foundation model.

inputs: card_dielectric;  outputs: law;  settings: sensor, law, mesh (of the cell, as for the hyperelastic model)
"""

from typing import Any

from softtact.files import atomic_path
from softtact.materials.cards import law_from_card, load_card
from softtact.models.foundation.frustum_spring import frustum_law
from softtact.models.hyperelastic.mesh_settings import mesh_settings
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press the cell as far as it converges, and write force against compression."""
    spec = SensorSpec.from_dict(settings["sensor"])
    law = law_from_card(load_card(inputs["card_dielectric"]), settings["law"])
    found = frustum_law(spec, law, mesh=mesh_settings(settings["mesh"]))
    with atomic_path(outputs["law"]) as temporary:
        found.save(temporary)

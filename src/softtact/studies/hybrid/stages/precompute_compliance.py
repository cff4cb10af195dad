"""The compliance for a fast model's presses, once per sensor: of the elastic layer, or of the slab on its frusta.

inputs: for a foundation frustum_law, card_dielectric, card_cover;  outputs: compliance;  settings: sensor, kind, laws {layer: law}
"""

from typing import Any

from softtact.files import atomic_path
from softtact.materials.cards import law_from_card, load_card
from softtact.models.elastic.compliance import Compliance, elastic_compliance
from softtact.models.foundation.compliance import FoundationCompliance, foundation_compliance
from softtact.models.foundation.frustum_spring import FrustumLaw
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Condense a quarter of the layers four times, and write the compliance."""
    spec = SensorSpec.from_dict(settings["sensor"])
    compliance: Compliance | FoundationCompliance
    if settings["kind"] == "elastic":
        compliance = elastic_compliance(spec, threads=threads)
    else:
        laws = {layer: law_from_card(load_card(inputs[f"card_{layer}"]), law) for layer, law in settings["laws"].items()}
        compliance = foundation_compliance(spec, dielectric_law=laws["dielectric"], cover_law=laws["cover"],
                                            frustum=FrustumLaw.load(inputs["frustum_law"]), threads=threads)
    with atomic_path(outputs["compliance"]) as temporary:
        compliance.save(temporary)

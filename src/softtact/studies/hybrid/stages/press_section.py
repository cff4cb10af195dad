"""One object pressed with a large force, with the deformed body kept: for the section through the sensor and the view that turns.

inputs, settings: as for `simulate_press`, with forces_n [one force]
outputs: body (VTU as of `softtact press --vtu`), summary (JSON: what the press says of itself)
"""

from typing import Any

from softtact.files import write_json
from softtact.studies.hybrid.stages.simulate_press import press_item


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press, and write the body at the force."""
    result = press_item(inputs, settings, threads=threads, keep_body=True)
    result.write_vtu(outputs["body"])
    names = ("normal_force_n", "indentation_mm", "contact_area_mm2", "frustum_compression_mm", "penetration_mm", "residual_n")
    summary = {name: float(getattr(result, name)[-1]) for name in names}
    summary["force_n"] = summary.pop("normal_force_n")
    write_json(outputs["summary"], summary | {"item": settings["item"]["name"], "model": settings["model"]})

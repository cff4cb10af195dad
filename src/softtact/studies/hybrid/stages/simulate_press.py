"""One item pressed with one model through all forces.

inputs: object (STL), and of mesh, compliance, card_dielectric, card_cover what the model needs
outputs: press;  settings: item {name, set, unit, pose}, sensor, model, kind, laws {layer: law}, mesh, friction, device, forces_n
"""

from typing import TYPE_CHECKING, Any

from softtact.errors import ConvergenceError
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose
from softtact.materials.cards import law_from_card, load_card
from softtact.models.elastic.compliance import Compliance
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.hyperelastic.mesh_settings import frustum_scatter, mesh_settings, newton_settings, specimen_of
from softtact.press.sensor import Sensor
from softtact.sensors.specification import SensorSpec

if TYPE_CHECKING:
    from softtact.press.result import PressResult

COMPLIANCES: dict[str, type[Compliance] | type[FoundationCompliance]] = {"elastic": Compliance, "foundation": FoundationCompliance}


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press, and write the maps; a press that does not converge fails with its name."""
    press_item(inputs, settings, threads=threads).write(outputs["press"], settings=settings)


def press_item(inputs: dict[str, Any], settings: dict[str, Any], *, threads: int, keep_body: bool = False) -> "PressResult":
    """The `PressResult` of the item of the settings."""
    item, label = settings["item"], press_label(settings)
    sensor = make_sensor(inputs, settings)
    try:
        return sensor.press(read_mesh(inputs["object"], unit=item["unit"]), pose=pose_of(item), force_n=settings["forces_n"],
                            model=settings["kind"], label=label, threads=threads, keep_body=keep_body)
    except ConvergenceError as error:
        raise ConvergenceError(f"{label}: {error}", result=error.result) from None


def make_sensor(inputs: dict[str, Any], settings: dict[str, Any]) -> Sensor:
    """The `Sensor` that is pressed, with what its model prepared."""
    kind, mesh, names = settings["kind"], settings["mesh"], names_of(settings)
    spec = SensorSpec.from_dict(settings["sensor"])
    if kind in COMPLIANCES:     # a press needs no laws then: the compliance knows them
        return Sensor(spec, laws={}, prepared_models={kind: COMPLIANCES[kind].load(inputs["compliance"])}, attributes=names)
    if settings["friction"] is not None:
        spec = SensorSpec.from_dict({**settings["sensor"], "friction": settings["friction"]})
    spec = specimen_of(spec, mesh)
    return Sensor(spec, laws=_laws(inputs, settings["laws"]), mesh=mesh_settings(mesh), solver=newton_settings(mesh),
                  scatter=frustum_scatter(spec, mesh), attributes=names, device=settings["device"])


def names_of(settings: dict[str, Any]) -> dict[str, str]:
    """What a press' file says of itself."""
    item = settings["item"]
    return {"model": settings["model"], "set": item["set"], "item": item["name"]}


def press_label(settings: dict[str, Any]) -> str:
    """A press in words: where its file lies."""
    return "{set}/{item}/{model}".format_map(names_of(settings))


def pose_of(item: dict[str, Any]) -> Pose | None:
    """The `Pose` of an item, or None for the centred one."""
    return None if item["pose"] is None else Pose.from_values(item["pose"])


def _laws(inputs, laws):
    """One law per layer from the fitted cards."""
    return {layer: law_from_card(load_card(inputs[f"card_{layer}"]), law) for layer, law in laws.items()}

"""Presses of items: one item, one object in several places, and one whose deformed body is kept."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.files import write_json
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


def simulate_press(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press one item with one model at all forces, and write the maps. Raises an error with its name if it does not converge.

    inputs: object (STL), and those of mesh, compliance, card_dielectric, card_cover that the model needs
    outputs: press
    settings: item {name, set, unit, pose}, sensor, model, kind, laws {layer: law}, mesh, friction, device, forces_n
    """
    press_item(inputs, settings, threads=threads).write(outputs["press"], settings=settings)


def simulate_presses(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press one object in several places with a fast model, and write each press as `simulate_press` does.

    Files are loaded once for all presses. If one fails, nothing is written, and the error names it.

    inputs: object (STL), compliance;  outputs: press, a list
    settings: as for `simulate_press`, with `items`, one for each output, in place of `item`
    """
    each = [{**_shared(settings), "item": item} for item in settings["items"]]
    if len(outputs["press"]) != len(each):
        raise InputError(f"{len(outputs['press'])} outputs 'press' for {len(each)} items; give one for each.")
    results = press_items(inputs, each, threads=threads)
    _refuse_failed(results, each)
    for path, result, one in zip(outputs["press"], results, each, strict=True):
        replace(result, attributes=result.attributes | names_of(one)).write(path, settings=one)


def press_section(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press one object with a large force, and write the deformed body for the section and the interactive view.

    inputs, settings: as for `simulate_press`, with forces_n [one force]
    outputs: body (VTU as of `softtact press --vtu`), summary (JSON: numbers of the press)
    """
    result = press_item(inputs, settings, threads=threads, keep_body=True)
    result.write_vtu(outputs["body"])
    names = ("normal_force_n", "indentation_mm", "contact_area_mm2", "frustum_compression_mm", "penetration_mm", "residual_n")
    summary = {name: float(getattr(result, name)[-1]) for name in names}
    summary["force_n"] = summary.pop("normal_force_n")
    write_json(outputs["summary"], summary | {"item": settings["item"]["name"], "model": settings["model"]})


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
    """The pressed `Sensor`, with the prepared compliance of its model."""
    kind, mesh, names = settings["kind"], settings["mesh"], names_of(settings)
    spec = SensorSpec.from_dict(settings["sensor"])
    if kind in COMPLIANCES:     # the compliance includes the laws
        return Sensor(spec, laws={}, prepared_models={kind: COMPLIANCES[kind].load(inputs["compliance"])}, attributes=names)
    if settings["friction"] is not None:
        spec = SensorSpec.from_dict({**settings["sensor"], "friction": settings["friction"]})
    spec = specimen_of(spec, mesh)
    return Sensor(spec, laws=_laws(inputs, settings["laws"]), mesh=mesh_settings(mesh), solver=newton_settings(mesh),
                  scatter=frustum_scatter(spec, mesh), attributes=names, device=settings["device"])


def names_of(settings: dict[str, Any]) -> dict[str, str]:
    """The attributes of a press' file."""
    item = settings["item"]
    return {"model": settings["model"], "set": item["set"], "item": item["name"]}


def press_label(settings: dict[str, Any]) -> str:
    """A press in words, by the path of its file."""
    return "{set}/{item}/{model}".format_map(names_of(settings))


def pose_of(item: dict[str, Any]) -> Pose | None:
    """The `Pose` of an item, or None for the centred one."""
    return None if item["pose"] is None else Pose.from_values(item["pose"])


def _laws(inputs, laws):
    """One law per layer from the fitted cards."""
    return {layer: law_from_card(load_card(inputs[f"card_{layer}"]), law) for layer, law in laws.items()}


def press_items(inputs: dict[str, Any], each: Sequence[dict[str, Any]], *, threads: int) -> list[Any]:
    """The `PressResult` or the error of each press; the settings `each` differ only in pose and name."""
    first = each[0]
    mesh = read_mesh(inputs["object"], unit=first["item"]["unit"])
    return make_sensor(inputs, first).press_many(
        mesh, [pose_of(one["item"]) for one in each], force_n=first["forces_n"], model=first["kind"], workers=threads,
        failures="keep", label=f"{press_label(first)} and {len(each) - 1} more")


def _shared(settings):
    return {name: value for name, value in settings.items() if name != "items"}


def _refuse_failed(results, each):
    failed = [number for number, result in enumerate(results) if isinstance(result, SofttactError)]
    if failed:
        error, more = results[failed[0]], f" ({len(failed) - 1} more of {len(each)} failed)" if failed[1:] else ""
        raise type(error)(f"{press_label(each[failed[0]])}: {error}{more}")

"""What a study does not have that the paper has: the box at the head of the report."""

from typing import Any

from softtact.published.archive import MAPS_OF_SETS

PAPERS_INDENTERS, PAPERS_OBJECTS = 49, 12
_OWN_READINGS = ("Readings are own recordings of a real sensor, not the paper's, so none of its numbers is judged on them. That a "
                 "recorded object is that of its mesh, that it lay where the study presses it, and the order of the taxels are "
                 "taken as stated: nothing here checks them.")
# Errors of the meshes' maps at 50 N: root mean square, and at single points (docs/explanation/discretisation.md).
MESH_ERRORS = {"draft": "2 to 5 % of its largest value in the root mean square and up to 10 % at single points",
               "default": "up to 2 % of its largest value in the root mean square and up to 5 % at single points"}


def missing(settings: dict[str, Any], *, archive: bool) -> list[str]:
    """Sentences on a study, of its own presses or of the published archive; settings as of the stage `report`."""
    return _beside_archive(settings) if archive else _of_presses(settings)


def recorded(settings: dict[str, Any]) -> bool:
    """Whether the readings are recordings of a real sensor."""
    return settings.get("config", {}).get("data", {}).get("source") == "recorded"


def _of_presses(settings):
    return ["No robot and no gripper: a grasp is a rigid object pressed on one sensor along its normal with a stated force.",
            *([_OWN_READINGS] if recorded(settings) else []), _places(settings), _sizes(settings), *_mesh(settings["config"]),
            _seeds(settings)]


def _beside_archive(settings):
    return ["Nothing was pressed here: maps are the archive's.", _seeds(settings)]


def _places(settings):
    drawn = settings["presses"]["grasps"] - settings["grasps"]
    more = f"; {drawn} more presses lie in places drawn with the seed" if drawn > 0 else ""
    return f"Each grasped object is pressed centred, as its mesh lies{more}. The paper grasps in 40 places, 50 times each."


def _sizes(settings):
    load_steps, presses = len(settings["forces_n"]), settings["presses"]
    maps = {name: count * load_steps for name, count in presses.items()}
    grasps = round(presses["grasps"] * settings["trials"]["grasps"])
    return (f"Sizes: {settings['indenters']} of the paper's {PAPERS_INDENTERS} indenters with {maps['indenters']:,} of "
            f"{MAPS_OF_SETS[0]:,} maps to train and validate, {maps['unseen']:,} of {MAPS_OF_SETS[1]:,} unseen cases, "
            f"{settings['grasps']} of {PAPERS_OBJECTS} objects with {grasps:,} of {MAPS_OF_SETS[2]:,} grasps (readings "
            f"of {presses['grasps']} presses).")


def _mesh(config):
    """The error of the tested hyperelastic model's mesh, if it is one of those that were measured."""
    presets = {name: model.get("mesh", {}).get("preset") or "default" for name, model in config.get("models", {}).items()
               if name in config.get("tested", ()) and model.get("kind", "hyperelastic") == "hyperelastic"}
    return [f"Mesh: the {preset} one of the {name} model puts its map off by {MESH_ERRORS[preset]}."
            for name, preset in presets.items() if preset in MESH_ERRORS]


def _seeds(settings):
    repeats = settings.get("config", {}).get("learning", {})
    specimen = "recorded sensor" if recorded(settings) else "virtual specimen"
    if repeats.get("seeds", 1) > 1:
        return (f"One {specimen} and one split, of seed {settings['seed']}. Intervals are over objects and trials. Of "
                f"learning {repeats['seeds']} seeds were tried, for the network {' and '.join(repeats['networks'])}: see their "
                "spread.")
    return (f"One seed, {settings['seed']}: one {specimen}, one split, one training of each network. Intervals are over "
            "objects and trials and hold nothing of what another seed would give.")

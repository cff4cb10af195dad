# The hybrid study: materials, the dielectric on glass, presses with every model, networks that learn the readings, tables and figures.

import re


wildcard_constraints:
    set="|".join(STUDY.items_of),
    item="[a-z0-9_-]+",
    model="[a-z0-9_]+",
    material="[a-z0-9_]+",


def rule_name(*parts):
    """The name of a rule that a loop makes."""
    return re.sub(r"\W", "_", "_".join(parts))


def card_of(layer):
    """The fitted card of the material of one of the sensor's layers."""
    return f"{RESULTS}/materials/{STUDY.sensor[layer]['material']}.json"


def model_files(wildcards):
    """The prepared files that a model's presses start from, as the configuration lists them under `needs`."""
    return needs_of(wildcards.model)


def needs_of(model):
    """The same of a model by its name."""
    return _prepared(model, STUDY.values.models[model].needs)


def compliance_files(wildcards):
    """The prepared files that a model's compliance is computed from."""
    return _prepared(wildcards.model, STUDY.values.models[wildcards.model].prepared_from)


def _prepared(model, names):
    """Prepared files of a model by their names."""
    prepared = {
        "mesh": f"{RESULTS}/sensor/{model}/mesh.vtu",
        "frustum_law": f"{RESULTS}/sensor/{model}/frustum_law.npz",
        "compliance": f"{RESULTS}/sensor/{model}/compliance.npz",
        "card_dielectric": card_of("dielectric"),
        "card_cover": card_of("cover"),
    }
    return {name: prepared[name] for name in names}


def press_settings(item):
    """What a press uses of an item; its label, say, is none of a solver's business."""
    return {"name": item.id, "set": item.set, "unit": item.unit, "pose": item.pose}


def mesh_of(model):
    """Mesh settings of a model, as far as the configuration states them."""
    return STUDY.values.models[model].mesh.model_dump(mode="json", exclude_none=True)


def friction_of(model):
    """A model's own coefficients of friction; None where it takes the sensor's."""
    friction = STUDY.values.models[model].friction
    return friction and friction.model_dump(mode="json")


def plain(section):
    """A section of the configuration as JSON values."""
    return section.model_dump(mode="json")


def pressed_with(model, items, forces_n):
    """The settings of a press of an item, or of several in one job, with a model of the configuration."""
    chosen = STUDY.values.models[model]
    pressed = [press_settings(item) for item in items]
    return as_settings(
        **({"items": pressed} if len(pressed) > 1 else {"item": pressed[0]}),
        sensor=STUDY.sensor,
        model=model,
        kind=chosen.kind,
        laws=chosen.laws,
        mesh=mesh_of(model),
        friction=friction_of(model),
        device=chosen.device,
        forces_n=forces_n,
    )


def presses(models):
    """The press files of some models, in the study's order."""
    return [f"{RESULTS}/presses/{item.set}/{item.id}/{model}.nc" for model in models for item in STUDY.items()]


def everything(workflow):
    """All files of the study: one that went missing is made again, though what was made from it is still there."""
    without = ("compare_policies", "draw_fig7_maps", "draw_fig8_policies") if STUDY.archive else ()
    rules_asked = [rule for rule in workflow.rules if not rule.has_wildcards() and rule.name not in ("all", *without)]
    fixed = [path for rule in rules_asked for path in rule.output]
    models = () if STUDY.archive else STUDY.pressed_with
    sensor = [path for model in models for path in needs_of(model).values()]
    materials = [
        path for name in STUDY.values.materials for path in (*data_of_material(name), *figure_files(f"material_{name}").values())
    ]
    learning = [path for name in ("model.pt", "history.csv", "timing.csv") for path in learned(name)]
    learning += [f"{RESULTS}/learning/{model}/{name}" for model in STUDY.tested for name in ("search.csv", "best.json")]
    readings = [] if STUDY.archive else [f"{RESULTS}/tactile/{item.set}/{item.id}.nc" for item in STUDY.items()]
    return sorted({*fixed, *sensor, *materials, *learning, *presses(models), *readings})


def samples_of():
    """What data sets are built from, as inputs: a file for each press and reading, or what the archive was turned into."""
    if STUDY.archive:
        return {name: f"{RESULTS}/{name}" for name in ("presses", "tactile")} | {"item_list": f"{RESULTS}/published/items.json"}
    tactile = [f"{RESULTS}/tactile/{item.set}/{item.id}.nc" for item in STUDY.items()]
    return {"presses": presses(STUDY.learnt_from), "tactile": tactile}


include: "materials.smk"
include: "ftir.smk"
include: "sensor.smk"
include: "objects.smk"
include: "published.smk" if STUDY.archive else "presses.smk"
include: "learning.smk"
include: "report.smk"

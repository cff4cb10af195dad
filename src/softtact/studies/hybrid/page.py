"""report.html: one file with the figures inside, and links from each to its data, its code and the configuration.

Its head states what was found, and the differences between the study and the paper.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from softtact.evaluation.score_tables import ALL_FORCES, forces_of
from softtact.files import read_csv, read_json
from softtact.published.archive import MAPS_OF_SETS
from softtact.reporting.page import Page, counted
from softtact.reporting.run_record import run_sentence
from softtact.reporting.words import KINDS, PREDICTORS, SETS, force_in_words
from softtact.studies.hybrid.mesh_error import mesh_sentences, with_mesh_error

CAPTIONS = {
    "fig2_section": "Figure 2. Section through the sensor at rest and pressed: how the frusta fold. Curved elements are cut by "
                    "their shape functions; displacements are to scale.",
    "pressed_sensor": "The sensor's surface in the same press: turn it by mouse, touch or arrow keys, and slide from rest to "
                      "pressed. Grey: the object, lifted from the surface.",
    "fig4_complexity": "Figure 4. Above: mesh (grey) and convex hull (lines in the colour of the chosen model) of two objects, "
                       "seen from the side that touches. Below: the part over the sensor and within its reach. Right: the ratios "
                       "of all objects with the two thresholds.",
    "fig5_ftir": "Figure 5. Contact area of the dielectric pressed on glass.",
    "fig6_ssim": "Figure 6. SSIM of the networks' readings per item: bars are means, boxes quartiles over forces and trials; "
                 "black dashes, where trials are repeated: the sensor's own trials against each other, which no model passes by "
                 "more than the noise left in a mean of few trials. Red marks: predictors without a network, on the hyperelastic "
                 "maps where they look at a map. A bar below the red dash is a network that is not trained.",
    "fig7_maps": "Figure 7. Objects seen from the side that touches, deformation maps of both models in mm (one scale for both), "
                 "tactile maps predicted from them, and those that the sensor (virtual, or recorded) read, the mean of its "
                 "trials. Jet colours and turned 90 degrees as printed; tactile maps from 0 to the readout's largest count; red: "
                 "the model chosen by the complexity rule.",
    "fig8_policies": "Figure 8. Left: what each policy costs and which error it accepts, against the study's hyperelastic model, "
                     "which has no error by definition: its own mesh's is stated above. Right: the error that was expected before "
                     "the costly model ran, against the true one.",
    "fig9_networks": "Figure 9. The paper's network and another architecture on the same split. Left: mean SSIM with its 95 % "
                     "interval (bootstrap over objects, then trials). Right: loss and SSIM of the validation maps after an epoch.",
    "fig10_learning_curve": "Figure 10. Mean SSIM against the number of training maps, with its 95 % interval (bootstrap over "
                            "objects, then trials): equal steps of the optimiser for each. Where the readings are a virtual "
                            "sensor's, the reference's maps are those that it felt itself, so that line is what the same network "
                            "reads from a perfect model.",
}
TITLES = {"summary": "Scores with their 95 % interval, by set",
          "levels": "Scores at each force",
          "networks": "Architectures on the same split: scores with their 95 % interval beside predictors without a network, how "
                      "the training ended, and times",
          "seeds": "The same training from several seeds, on the same presses and split",
          "limits": "What limits the scores: model, data or network",
          "gains": "How SSIM depends on the gain of the readings, at the largest force on grasped objects, without any network",
          "policies": "Policies that choose a model, on the presses that the expected error was not calibrated on",
          "table1": "Table 1. Material laws",
          "contradictions": "Where the paper's table 1 contradicts itself",
          "table2": "Table 2. Complexity and choice of model",
          "counts": "The archive's counts against those in print",
          "table3": "Table 3. Time per tactile map"}
SOURCES_PAGE = "sources.html"
_CONFIGURED = f"{SOURCES_PAGE}#config"
_CONFIGURATION = ("", [("Configuration", _CONFIGURED)])
_QUESTION = ("Does choosing between an elastic and a hyperelastic model by an object's complexity give what a soft tactile sensor "
             "reads, in less time than the hyperelastic model alone?")
_MODULE_OF = {"policies": "compare_policies", "networks": "compare_networks", "levels": "compare_networks",
              "counts": "import_published", "summary": "evaluate", "gains": "limits", "limits": "limits",
              "seeds": "retraining"}     # others: make_tables
_DRAWN_BY_MATPLOTLIB = "Views are rendered off screen by VTK; a figure says so where matplotlib drew them instead."
_WITH_VIEWS = ("fig4_complexity", "fig7_maps")
_FOLDERS = ("presses", "tactile", "dataset", "learning", "evaluation", "section", "tables", "figures", "logs")
PAPERS_SENSOR = "coro: "     # start of the line on the paper's sensor
PAPERS_INDENTERS, PAPERS_OBJECTS = 49, 12
_RECORDED_READINGS = (
    "Readings are own recordings of a real sensor, not the paper's, so none of its numbers is judged on them. That a "
    "recorded object is that of its mesh, that it lay where the study presses it, and the order of the taxels are taken as stated: "
    "nothing here checks them.")


def render_page(inputs: dict[str, Any], settings: dict[str, Any], *, folder: Path, run: pd.DataFrame) -> str:
    """The page as text. `inputs` and `settings`: as in the stage; links are relative to `folder`; run: of `run_record`."""
    ftir = read_json(inputs["ftir"])
    archive = read_json(inputs["inventory"]) if "inventory" in inputs else None
    page = Page("Simulating a soft tactile sensor: the study", settings["study"], folder=folder)
    claims = read_csv(inputs["claims"], keep_default_na=False)
    page.opening(
        asked=[_QUESTION,
               (_archive_facts(settings, archive), inputs["inventory"]) if archive else (_facts(settings), _CONFIGURED)],
        found=[*((sentence, inputs["scores"]) for sentence in read_json(inputs["verdicts"])["sentences"]),
               (counted(claims), inputs["claims"])],
        sure=[*((sentence, _CONFIGURED) for sentence in missing(settings, archive=archive is not None)),
              (range_end_sentence(read_csv(inputs["gains"]), settings["config"]), inputs["gains"]) if "gains" in inputs else ""],
        synthetic=[(_synthetic_but_for_the_archive(ftir) if archive else _synthetic(ftir, settings), inputs["ftir"])])
    for text, anchor in (("Configuration", "config"), ("Code", "code")):
        page.other_page(text, f"{SOURCES_PAGE}#{anchor}")
    _show_figures(page, inputs["figures"], settings["sources"], {"fig5_ftir": ftir["verdict"]})
    _show_tables(page, inputs, {} if archive else settings["config"])
    page.claims(claims, file=inputs["claims"],
                links=[_code("softtact/studies/hybrid/claims/table.py")])
    page.section("What was run, on what, how long", anchor="run")
    page.text(run_sentence(run))
    page.table(run, file=folder / "tables/run.csv", links=[("Each job's", [(name, name) for name in ("benchmarks", "logs")])])
    page.text("", links=[("Folders", [(name, name) for name in _FOLDERS if (folder / name).is_dir()])])
    return page.render()




def render_sources(paths: Iterable[str | Path], *, study: str, config: str, named: str, page: str) -> str:
    """The page of the configuration (YAML texts) and of source files below src/, each under an anchor."""
    sources = Page("Configuration and code of the study", study, folder=".")
    sources.text("As they were when the report was made.", links=[("", [("Report", page)])])
    sources.section("Configuration", anchor="config")
    files = [(name, name) for name in ("config.yaml", "config_named.yaml")]
    sources.text("With all defaults. The first file runs the same study by snakemake --configfile config.yaml; the second holds "
                 "what it names: sensor, materials, objects.", links=[("", files)])
    sources.code(config)
    sources.section("What it names", anchor="named")
    sources.code(named)
    sources.section("Code")
    names = {_below_src(path): path for path in paths}
    sources.text("", links=[("", [(name, f"#{name}") for name in names])])
    for name, path in names.items():
        sources.code(Path(path).read_text(encoding="utf-8"), title=name)
    return sources.render()


def _code(*names):
    """Links to source files on the page of sources, given by their paths below src/."""
    return "Code", [(name.removeprefix("softtact/"), f"{SOURCES_PAGE}#{name}") for name in names]


def _below_src(path):
    return Path(path).as_posix().removeprefix("src/")


def _show_figures(page, paths, sources, more):
    """The figures with links to data and code; sources: {figure: {data: paths, code: paths}}, more: {figure: a sentence}."""
    page.section("Figures")
    more |= dict.fromkeys(_WITH_VIEWS, _DRAWN_BY_MATPLOTLIB)
    for path in paths:
        material, source = path.stem.removeprefix("material_"), sources.get(path.stem, {})
        caption = CAPTIONS.get(path.stem) or (f"Material {material}: test curves and the laws fitted to them, what they leave, and "
                                              "the stretches over which each law is stable.")
        data = [(page.link(file).replace("../", ""), page.link(file)) for file in source.get("data", ())]
        page.figure(path, caption, remark=more.get(path.stem, ""),
                    links=[("Data", data), _code(*map(_below_src, source.get("code", ()))), _CONFIGURATION])


def _show_tables(page, inputs, config):
    page.section("Result in one table")
    page.text("Grasped objects: at the largest force, the paper's test 2, and over all forces. Skill is (score - best trivial) / "
              "(ceiling - best trivial) of the mean SSIM; below 0, that predictor reads better than the network. The file holds "
              "all sets and forces.")
    result = result_table(read_csv(inputs["scores"], dtype={"force": str}))
    page.table(with_mesh_error(result, config), file=inputs["scores"])
    page.section("Tables")
    for name, title in TITLES.items():
        if name in inputs:
            code = _code(f"softtact/studies/hybrid/stages/{_MODULE_OF.get(name, 'make_tables')}.py")
            table = _in_words(with_mesh_error(read_csv(inputs[name]), config))
            page.table(table, title, file=inputs[name], links=[code, _CONFIGURATION])




def _facts(settings):
    sets = (("indenters", "indenter"), ("unseen", "unseen indenter"), ("grasps", "object"))
    pressed = [f"{_number(settings[name], word)} in {_number(settings['presses'][name], 'place')}, each read "
               f"{_number(settings['trials'][name], 'time')}" for name, word in sets]
    forces = ", ".join(f"{force:g}" for force in settings["forces_n"])
    reader = "from recordings of a TSF-85 (tactile/)" if recorded(settings) else "by the virtual sensor"
    another = "It is not the paper's sensor: the paper's numbers and claims below are another sensor's. "
    return (f"Sensor {settings['sensor']}. {'' if settings['sensor'].startswith(PAPERS_SENSOR) else another}"
            f"Pressed at {forces} N with each model and read {reader}: {'; '.join(pressed)}. "
            f"Seed {settings['seed']}.")


def _number(count, word):
    return f"{count:.3g} {word}{'' if count == 1 else 's'}"


def _archive_facts(settings, archive):
    """The facts of a study on the published archive, in place of its presses."""
    items = archive["items"]
    return (f"Maps and readings are those of the published archive: {archive['tests_used']} of {archive['tests']} tests of "
            f"{len(items['indenters'])} indenters, {len(items['unseen'])} held-out ones (our choice: the paper does not name its "
            f"own) and {len(items['grasps'])} objects; {archive['tests_left_out']} odd tests are left out "
            f"(published/outliers.csv). {archive['sentence']} No object was pressed, so figures 2, 7 and 8 and our times "
            "are not here. "
            f"Seed {settings['seed']}.")


def range_end_sentence(gains: pd.DataFrame, config: dict[str, Any]) -> str:
    """How many taxels of the virtual sensor read the end of the converter's range; nothing where the study's gain is not listed."""
    gain = config.get("virtual_sensor", {}).get("counts_per_relative_change")
    own = gains[gains.gain == gain]
    if not len(own) or not own.full_share.iloc[0] > 0:
        return ""
    return (f"At the largest force {own.full_share.iloc[0]:.1%} of the taxels' readings on grasped objects are at the end of the "
            "converter's range: they read less than the taxels feel, and no model's counts there can be told right from wrong.")


def _synthetic_but_for_the_archive(ftir):
    return ("Stress-strain curves are made from the paper's printed constants with noise; the measured contact area is from: "
            f"{ftir['source']}; tables 1 and 2 and figures 4 and 5 are of our own curves, objects and specimen. "
            "Maps and readings, and so all SSIM values, are of the published archive; that maps and readings match by their "
            "order, how the taxels lie, and which indenters are held out is assumed.")


def _synthetic(ftir, settings):
    config = settings["config"]
    rubs = "friction, " if config.get("models", {}).get(config.get("reference"), {}).get("friction") else ""
    readings = ("the readings are own recordings of a TSF-85, so SSIM values below are against them" if recorded(settings) else
                f"the readings come from a virtual sensor (a law of another name fitted to the same curves, another mesh, {rubs}"
                "scatter, hysteresis, noise). SSIM values below are against that virtual sensor")
    return ("The paper's curves, camera frames and taxel readings are not published here. Stress-strain curves are made from "
            f"its printed constants with noise; the measured contact area is from: {ftir['source']}; {readings} and are not the "
            "paper's.")


def missing(settings: dict[str, Any], *, archive: bool) -> list[str]:
    """Sentences on the differences from the paper of a study of presses, or of the archive; settings: of the stage `report`."""
    return _beside_archive(settings) if archive else _of_presses(settings)


def recorded(settings: dict[str, Any]) -> bool:
    """Whether the readings are recordings of a real sensor."""
    return settings.get("config", {}).get("data", {}).get("source") == "recorded"


def _of_presses(settings):
    return ["No robot and no gripper: a grasp is a rigid object pressed on one sensor along its normal with a stated force.",
            *([_RECORDED_READINGS] if recorded(settings) else []), _places(settings), _sizes(settings),
            *mesh_sentences(settings["config"]), _seeds(settings)]


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


def _seeds(settings):
    repeats = settings.get("config", {}).get("learning", {})
    specimen = "recorded sensor" if recorded(settings) else "virtual specimen"
    if repeats.get("seeds", 1) > 1:
        return (f"One {specimen} and one split, of seed {settings['seed']}. Intervals are over objects and trials. Of "
                f"learning {repeats['seeds']} seeds were tried, for the network {' and '.join(repeats['networks'])}: see their "
                "spread.")
    return (f"One seed, {settings['seed']}: one {specimen}, one split, one training of each network. Intervals are over "
            "objects and trials and hold nothing of what another seed would give.")


def result_table(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of a `score_table` for grasped objects at the largest force (the paper's test 2) and over all forces, in words."""
    forces = forces_of(scores)
    rows = scores[(scores["set"] == "grasps") & scores.force.isin([forces[-1], ALL_FORCES])]
    shown = rows.assign(predictor=rows.predictor.map(PREDICTORS), kind=rows.kind.map(KINDS), force=rows.force.map(force_in_words))
    return shown.sort_values(["force", "model"], kind="stable").drop(columns=["set", "overlap", "maps"])


def _summary(summary):
    """The summary with the interval in words."""
    interval = ["one item: none" if low != low else f"{low:.3f} to {high:.3f}"
                for low, high in zip(summary.ssim_low, summary.ssim_high, strict=True)]
    place = list(summary.columns).index("ssim_low")
    shown = summary.drop(columns=["ssim_low", "ssim_high"])
    shown.insert(place, "95 % interval of the mean", interval)
    return shown


def _in_words(frame):
    """A table with the names of its columns and values in words."""
    frame = _summary(frame) if {"ssim_low", "ssim_high"} <= set(frame) else frame
    words = {"predictor": PREDICTORS, "kind": KINDS, "set": SETS}
    return frame.assign(**{name: frame[name].map(lambda value, known=known: known.get(value, value))
                           for name, known in words.items() if name in frame})

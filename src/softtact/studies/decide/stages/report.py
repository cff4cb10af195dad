"""The page of the study."""

from typing import Any

from softtact.files import read_csv
from softtact.reporting.page import Page, counted

CAPTIONS = {
    "maps": "Maps of {shown} by the truths and the tested models, each with its own scale.",
    "scores": "Error over the mean reading of every contestant, in the mean over smooth (pale) and stepped objects; bars: 95 % "
              "intervals, objects and seeds drawn with replacement. Above each panel: the error of the mean reading at a "
              "force. Ceiling and flipped are controls: a tested model is the truth.",
    "collapse": "The collapse: what a map shows of the lower feature against step height over indentation, at all forces. Crosses: "
                "elastic layers of all moduli, and the foundation model; circles: hyperelastic.",
    "learning_curve": "Error of each network trained on growing shares of the indenters, with as many steps for each.",
    "robustness": "What the hyperelastic model errs less than the elastic ones against truths of every combination; few objects, "
                  "gap formula, one gain for all forces or for each alone. Right of zero the hyperelastic model is nearer; grey: "
                  "undecided.",
}
_TITLES = {"power": "Power, stated before the scores", "robustness": "Map of robustness", "learning_curve": "Learning curves"}
_MOST_ROWS = 60


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page.

    inputs: scores, mean_scores, hypotheses, learning_curve, power, robustness, collapse, claims (CSV), figures (list)
    outputs: page
    settings: study, names (of the figures), shown (the object of the maps), config
    """
    tables = {name: read_csv(path, keep_default_na=name != "claims") for name, path in inputs.items() if name != "figures"}
    page = Page("Does the paper's claim hold? The study", settings["study"], folder=outputs["page"].parent)
    judged = tables["claims"]
    page.opening(
        asked="Does the hyperelastic model show detail that the elastic one loses, is that more than stiffness, and is a hybrid of "
              "both as accurate for less time? Each model is compared with several truths, object by object.",
        found=[(counted(judged), inputs["claims"]),
               *((f"{one.claim}: {one.verdict}.", inputs["claims"]) for one in judged[judged["where"] != "control"].itertuples())],
        sure=[*((f"{one.claim}: {one.verdict}.", inputs["claims"]) for one in judged[judged["where"] == "control"].itertuples()),
              ("A difference counts only where its 95 % interval over objects and seeds is clear of its bound; the tests of one "
               "claim share their level by Holm's rule.", inputs["hypotheses"]),
              ("What the study could see at all was stated before the scores.", inputs["power"])],
        synthetic="Truths are simulations with other laws, meshes and boundaries than the tested models; readings are the virtual "
                  "sensor's. No score here is the paper's.")
    page.claims(tables["claims"], file=inputs["claims"])
    page.section("Hypotheses")
    page.text("More is better in every difference. Intervals are of 95 %; all tests of a claim share its level by "
              "Holm's rule.")
    page.table(tables["hypotheses"], file=inputs["hypotheses"])
    captions = [CAPTIONS[name].format(shown=settings["shown"].replace("_", " ")) for name in settings["names"]]
    page.figures(zip(inputs["figures"], captions, strict=True))
    page.section("Scores")
    page.text("Means over objects and seeds. Error over the mean reading: sum of the errors over the sum of the readings. SSIM "
              "has either the range of each map, or the converter's with the smallest and the largest window that fits, for the "
              "paper states none. The mean reading at a force reads no map, and is the same beside each readout.")
    page.table(tables["mean_scores"], file=inputs["scores"])
    for name, title in _TITLES.items():
        page.table(tables[name], title, file=inputs[name], most_rows=_MOST_ROWS)
    page.configuration(settings["config"])
    page.write(outputs["page"])

"""What the paper's numbers and words say of each other: nothing here is computed from a press or a reading of ours.

A row is `consistent in print`, `contradicts itself`, or `undecided` where what would decide it is not printed.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from softtact.evaluation.decisions import CONSISTENT, CONTRADICTION, UNDECIDED, row
from softtact.published.archive import ALL_MAPS, MAPS_OF_SETS, PRINTED_SSIM

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Counts, Times

_CLOSE = 0.1  # relative: the text rounds
_SIMILAR, _MORE = 1.5, 3.0  # factors: edges that "remain similar", points that "change significantly"; assumed
_ARITHMETIC = "none: arithmetic of printed numbers"
_WORDS = "none: the paper's own words"
_TABLE_2, _TABLE_3, _HERE = "tables/table2_complexity.csv", "tables/table3_timing.csv", "tables/claims.csv"
FLAT, DETAILED = ("object_3", 1.43, 0.6), ("object_6", 21, 9.6)  # of figure 4, with the ratios that its text prints


def claims_in_print(*, printed_counts: "dict[str, Counts]", printed_times: "dict[str, Times]") -> Iterator[dict[str, str]]:
    """Rows for the paper's numbers that others of its numbers decide: does what the text says follow from what its tables print?

    printed_counts: {object: (NPt, CHt, NPo, CHo, model)};  printed_times: {model: (mean, min, max, sd)} in s
    """
    yield from _times(printed_times)
    yield _all_maps()
    yield from _figure_4(printed_counts)
    yield _closed_meshes(printed_counts)
    yield _superior()
    yield from _in_words()


def _times(printed):
    hyper, elastic = printed["hyperelastic"], printed["elastic"]
    yield _follows(
        "Hyperelastic maps take 3.5 times longer than elastic ones",
        "sec. 5",
        3.5,
        hyper[0] / elastic[0] - 1,
        f"{hyper[0]:g} s / {elastic[0]:g} s - 1 of table 3",
        _TABLE_3,
    )
    yield _follows(
        "The longest elastic time is near the mean hyperelastic one",
        "sec. 4.2",
        hyper[0],
        elastic[2],
        "s, both of table 3",
        _TABLE_3,
    )
    yield _follows(
        "In complex cases the difference is up to 11 times",
        "sec. 5",
        11,
        hyper[2] / elastic[2],
        f"longest times, {hyper[2]:g} s / {elastic[2]:g} s of table 3",
        _TABLE_3,
    )
    for name, times, longest in (("elastic", elastic, 64), ("hyperelastic", hyper, 38)):
        yield _follows(
            f"The {name} model's longest time is {longest} times its shortest",
            "sec. 4.2",
            longest,
            times[2] / times[1],
            f"{times[2]:g} s / {times[1]:g} s of table 3",
            _TABLE_3,
        )


def _follows(claim, where, printed, ours, how, evidence):
    holds = abs(ours - printed) <= _CLOSE * printed
    return row(
        claim,
        where,
        f"{printed:,g}",
        f"{ours:,.3g} ({how})" if ours < 1000 else f"{ours:,.0f} ({how})",
        CONSISTENT if holds else CONTRADICTION,
        f"the paper's other numbers give it within {_CLOSE:.0%}",
        evidence,
        uncertainty=_ARITHMETIC,
    )


def _all_maps():
    """The number of maps in a grasp is not printed, so the abstract's number cannot be checked, only solved for it."""
    train, unseen, grasps = MAPS_OF_SETS
    solved = (ALL_MAPS - train - unseen) / grasps
    return row(
        f"The data set holds {ALL_MAPS:,} maps",
        "abstract",
        f"{ALL_MAPS:,}",
        f"{train:,} + {unseen:,} + {grasps:,} = {train + unseen + grasps:,} with one map for each grasp, as table 3 has it; "
        f"{ALL_MAPS:,} needs {solved:g} maps for each grasp, which is solved from it and not printed",
        UNDECIDED,
        "the printed sizes alone give it; undecided where a size that is not printed would",
        _HERE,
        uncertainty=_ARITHMETIC,
    )


def _figure_4(printed):
    for name, whole, overlap in (FLAT, DETAILED):
        NPt, CHt, NPo, CHo, _ = printed[name]
        shown = name.replace("_", " ")
        yield _follows(
            f"{shown}: NPt = {whole:g} CHt (figure 4)", "fig. 4", whole, NPt / CHt, f"{NPt} / {CHt} of table 2", _TABLE_2
        )
        yield _follows(
            f"{shown}: NPo = {overlap:g} CHo (figure 4)", "fig. 4", overlap, NPo / CHo, f"{NPo} / {CHo} of table 2", _TABLE_2
        )
    flat, detailed = printed[FLAT[0]], printed[DETAILED[0]]
    growth = {name: detailed[k] / flat[k] for k, name in enumerate(("NPt", "CHt", "NPo", "CHo"))}
    holds = min(growth["NPt"], growth["NPo"]) > _MORE and max(growth["CHt"], growth["CHo"]) < _SIMILAR
    largest = max(printed.values(), key=lambda counts: counts[1] / counts[0])
    yield row(
        "With rising detail NPt and NPo grow, while CHt and CHo stay",
        "sec. 3.3.1, fig. 4",
        "two objects",
        f"of the two objects with figure 4's ratios {', '.join(f'{name} {ratio:.2g}-fold' for name, ratio in growth.items())}; "
        f"table 2 has an object with {largest[1]:,} edges on {largest[0]:,} points, too",
        CONSISTENT if holds else CONTRADICTION,
        f"between the two objects NPt and NPo grow more than {_MORE:g}-fold, CHt and CHo less than {_SIMILAR:g}-fold; no family "
        "of ours is judged, for one with details below its hull has them by construction",
        _TABLE_2,
        uncertainty=_ARITHMETIC,
    )


def _closed_meshes(printed):
    """A closed mesh of F triangles has V = F/2 + 2 - 2 g points, and a hull of at most V corners at most 3 V - 6 edges."""
    least = {name: counts[0] / counts[1] for name, counts in printed.items()}
    impossible = [name for name, ratio in least.items() if ratio < 2]
    merged = all(counts[1] <= 3 * counts[0] - 6 for counts in printed.values())
    numbers = "; ".join(
        f"{name.replace('_', ' ')} prints {printed[name][1]:,} edges where {printed[name][0] // 2:,} is the most"
        for name in impossible
    )
    fits = "points that are merged fit all rows" if merged else "points that are merged do not fit all rows either"
    if all(counts[0] % 3 == 0 for counts in printed.values()):
        fits += " (yet every NPt divides by 3, as three for each facet do)"
    return row(
        "Table 2 counts the points of closed meshes, three for each facet",
        "table 2; NPt as we count it",
        f"NPt / CHt from {min(least.values()):.2f} up",
        f"NPt / CHt of a closed mesh without handles is 2 or more; {numbers or 'all rows are possible'}; {fits}: "
        "NPt may be the number of merged points, a sixth of ours, or the meshes are not closed"
        if impossible
        else "all rows are possible",
        CONTRADICTION if impossible else CONSISTENT,
        "every row has NPt >= 2 CHt: V points, 2 V - 4 facets, at most 3 V - 6 edges of the hull",
        _TABLE_2,
        uncertainty="none: Euler's formula",
    )


def _superior():
    printed = {name: (values["hyperelastic"], values["elastic"]) for name, values in PRINTED_SSIM.items()}
    against = [name for name, (hyper, elastic) in printed.items() if elastic > hyper]
    shown = ", ".join(f"{name} {hyper:g} and {elastic:g}" for name, (hyper, elastic) in printed.items())
    return row(
        "The hyperelastic pipeline is superior in accuracy",
        "sec. 5",
        "superior accuracy",
        f"printed SSIM, hyperelastic and elastic: {shown}",
        CONTRADICTION if against else CONSISTENT,
        "its printed mean SSIM is the larger one on every set",
        _HERE,
        uncertainty="no interval is printed: a difference of 0.01 may be none",
    )


def _in_words():
    yield row(
        "Objects 1, 2 and 3 are smooth",
        "sec. 4.2",
        "smooth objects: 1, 2, 3",
        "the same section names 'objects with reliefs, such as objects 2 and 4'",
        CONTRADICTION,
        "an object is not both smooth and with reliefs",
        _HERE,
        uncertainty=_WORDS,
    )
    yield row(
        "Figure 6 shows the second test, on grasped objects",
        "sec. 4.2, fig. 6",
        "results for the second testing dataset",
        "its caption says 'SSIM of the validation dataset', and names Isaac Sim where the text has Isaac Gym",
        CONTRADICTION,
        "text and caption name the same data",
        _HERE,
        uncertainty=_WORDS,
    )
    yield row(
        "The fits' RMSE is an area, in mm2",
        "table 1",
        "RMSE (mm2)",
        "residuals of a stress have the unit of a stress; an error of contact area (sec. 4.1) would be one, but the cover of "
        "neoprene has no frusta",
        CONTRADICTION,
        "the unit is that of the fitted quantity",
        _HERE,
        uncertainty=_WORDS,
    )
    yield row(
        "The conductive fabric is negligible beside the cover",
        "sec. 3.2.1",
        "markedly diminished thickness",
        "neither thickness nor stiffness of the fabric is printed; thin is not soft: a sheet is negligible where its modulus "
        "times its thickness is small beside the cover's. No model here has a fabric",
        UNDECIDED,
        "modulus times thickness of the fabric below a tenth of the cover's",
        _HERE,
        uncertainty="not printed",
    )
    yield row(
        "One solver fitted the laws and solved the model",
        "sec. 3.2.1, 4.1",
        "C3D4H and C3D8RH; fits by Abaqus/Explicit",
        "hybrid elements are of Abaqus/Standard alone (Abaqus 2024, three-dimensional solid element library); so Explicit's "
        "default for a law without D, K0/mu0 = 20, need not be that of the solved model",
        CONTRADICTION,
        "the named elements belong to the named program",
        _HERE,
        uncertainty=_WORDS,
    )

"""Claims that the paper's own numbers decide: does what the text says follow from what its tables print?"""

from collections.abc import Iterator

from softtact.evaluation.claim_rows import CONSISTENT, CONTRADICTION, row
from softtact.published.archive import ALL_MAPS, MAPS_OF_A_GRASP, MAPS_OF_SETS

Counts = tuple[int, int, int, int, str]
Times = tuple[float, float, float, float]

_CLOSE = 0.1      # relative: the text rounds


def claims_in_print(*, printed_counts: dict[str, Counts], printed_times: dict[str, Times]) -> Iterator[dict[str, str]]:
    """A row for each; printed_counts {object: (NPt, CHt, NPo, CHo, model)}, printed_times {model: (mean, min, max, sd)} in s."""
    hyper, elastic = printed_times["hyperelastic"], printed_times["elastic"]
    yield _follows("Hyperelastic maps take 3.5 times longer than elastic ones", "sec. 5", 3.5, hyper[0] / elastic[0] - 1,
                   f"{hyper[0]:g} s / {elastic[0]:g} s - 1 of table 3", "tables/table3_timing.csv")
    yield _follows("The longest elastic time is near the mean hyperelastic one", "sec. 4.2", hyper[0], elastic[2],
                   "s, both of table 3", "tables/table3_timing.csv")
    yield _follows("In complex cases the difference is up to 11 times", "sec. 5", 11, hyper[2] / elastic[2],
                   f"longest times, {hyper[2]:g} s / {elastic[2]:g} s of table 3", "tables/table3_timing.csv")
    for name, times, printed in (("elastic", elastic, 64), ("hyperelastic", hyper, 38)):
        yield _follows(f"The {name} model's longest time is {printed} times its shortest", "sec. 4.2", printed, times[2] / times[1],
                       f"{times[2]:g} s / {times[1]:g} s of table 3", "tables/table3_timing.csv")
    train, unseen, grasps = MAPS_OF_SETS
    yield _follows("The data set holds 53,400 maps", "abstract", ALL_MAPS, train + unseen + grasps * MAPS_OF_A_GRASP,
                   f"{train:,} + {unseen:,} + {grasps:,} grasps x {MAPS_OF_A_GRASP} maps from closing to held; that there are "
                   f"{MAPS_OF_A_GRASP} is our reading", "tables/claims.csv")
    for name, whole, overlap in (("object_3", 1.43, 0.6), ("object_6", 21, 9.6)):
        NPt, CHt, NPo, CHo, _ = printed_counts[name]
        yield _follows(f"{name.replace('_', ' ')}: NPt = {whole:g} CHt (figure 4)", "fig. 4", whole, NPt / CHt,
                       f"{NPt} / {CHt} of table 2", "tables/table2_complexity.csv")
        yield _follows(f"{name.replace('_', ' ')}: NPo = {overlap:g} CHo (figure 4)", "fig. 4", overlap, NPo / CHo,
                       f"{NPo} / {CHo} of table 2", "tables/table2_complexity.csv")


def _follows(claim, where, printed, ours, how, evidence):
    holds = abs(ours - printed) <= _CLOSE * printed
    return row(claim, where, f"{printed:,g}", f"{ours:,.3g} ({how})" if ours < 1000 else f"{ours:,.0f} ({how})",
               CONSISTENT if holds else CONTRADICTION, f"the paper's other numbers give it within {_CLOSE:.0%}", evidence,
               uncertainty="none: arithmetic of printed numbers")

"""The shading of a set: fitted to a part of its presses, judged on the rest; and the ball's size."""

from typing import Any

import numpy as np
import pandas as pd

from softtact.calibration.camera import odd_middle
from softtact.files import atomic_path, read_csv, write_csv
from softtact.imaging.ball_presses import Gel
from softtact.progress import Watch
from softtact.studies.real.labelled import (
    REACH,
    SHADOWS,
    SMALL,
    WHEEL,
    LabelledSet,
    circles_found,
    clipped,
    drawn,
    fitted,
    found_again,
    normal_errors,
    per_press_mae,
    read_set,
    scores,
    scores_around,
    scores_of,
    split,
    with_shadows,
)

GIVEN, FOUND = "labelled", "found"
KINDS = ("table", "polynomial", SMALL, "phong")
_DRAWS = 400            # of the presses, for the interval of the ball's size


def fit_shading(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Fit and judge the shading of one set.

    inputs: presses (npz);  outputs: table, ball, circles (CSV), shading (YAML), examples (npz);  settings: set, shading, name
    """
    values, one = settings["shading"], settings["set"]
    own = read_set(inputs["presses"], Gel(one["ball_px"], one["thickness_px"]))
    options = {"tilt_degree": values["tilt_degree"], "place_degree": values["place_degree"]}
    watch, rows, examples = Watch(f"shading {settings['name']}"), [], dict[str, np.ndarray]()
    for number, seed in enumerate(values["seeds"]):
        made, drawn_ones = _of_split(own, split(len(own.presses), values["held_out"], seed), options, values["rounds"], seed)
        rows += made
        examples = examples or drawn_ones
        watch.report(f"{number + 1} of {len(values['seeds'])} splits")
    write_csv(outputs["table"], pd.DataFrame(rows).assign(set=settings["name"]))
    write_csv(outputs["ball"], _ball_sizes(own, one, values, options).assign(set=settings["name"]))
    with atomic_path(outputs["examples"]) as temporary:
        np.savez_compressed(temporary, **examples)     # type: ignore[arg-type]
    every, _ = circles_found(own, range(len(own.presses)), own.gel, options, values["rounds"])
    write_csv(outputs["circles"], _circles(own, every).assign(set=settings["name"]))
    reach = _reach(own, every, range(len(own.presses)))
    shading = fitted("table", own, every, own.gel, options, reach=[REACH * one for one in reach])
    shading = with_shadows(shading, every, own.gel, reach=reach)
    provenance = {"fitted": True, "presses": len(own.presses), "circles": "found from the colours", "ball_px": one["ball_px"],
                  "thickness_px": one["thickness_px"], "source": one["source"] + (f" {one['name']}" if one["name"] else "")}
    type(shading)(**{**vars(shading), "provenance": provenance}).save(outputs["shading"])
    watch.end()


def gather_tables(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Join the tables of all sets.  inputs: shading, ball, circles (lists of CSV);  outputs: shading, ball_size, circles (CSV);
    settings: sets
    """
    for name, output in (("shading", "shading"), ("ball", "ball_size"), ("circles", "circles")):
        write_csv(outputs[output], pd.concat([read_csv(path) for path in inputs[name]], ignore_index=True))


def _reach(own, presses, numbers):
    """Contact radii that are a labelled one."""
    return [clipped(own.presses[number], own.gel).radius_px / press.radius_px
            for number, press in zip(numbers, presses, strict=True)]


def _of_split(own, parts, options, rounds, seed):
    """Rows of all models with labelled and found circles, one for each press that was held out; and pictures of one press."""
    fit, held = parts
    labels = [clipped(own.presses[number], own.gel) for number in held]
    given = [clipped(own.presses[number], own.gel) for number in fit]
    found, finder = circles_found(own, fit, own.gel, options, rounds)
    again = [found_again(own.presses[number], own, own.gel, finder) for number in held]
    rows, examples = [], {}
    for circles, fitting, held_out, reach in ((GIVEN, given, labels, [1.0] * len(given)),
                                              (FOUND, found, again, _reach(own, found, fit))):
        far = [(REACH if circles == FOUND else 1.0) * one for one in reach]
        models: dict[str, Any] = {kind: fitted(kind, own, fitting, own.gel, options, reach=far) for kind in KINDS}
        models |= {SHADOWS: with_shadows(models["table"], fitting, own.gel, reach=reach)}
        models |= {WHEEL: own.wheel} if own.wheel is not None else {}
        for name, model in models.items():
            for number, press, label in zip(held, held_out, labels, strict=True):
                angle = normal_errors(model, press, own.gel) if name not in (WHEEL, SHADOWS) else np.array([np.nan])
                around = scores_around(model, press, label, own.gel) if name in ("table", SHADOWS) else {}
                rows.append({"circles": circles, "model": name, "seed": seed, "press": number,
                             **scores(model, press, label, own.gel), **around, "normal_deg": float(np.mean(angle)),
                             "normal_median_deg": float(np.median(angle))})
        rows += [{"circles": circles, "model": "background alone", "seed": seed, "press": number, **_background(label)}
                 for number, label in zip(held, labels, strict=True)]
        if circles == FOUND:
            examples = _examples(own, models, again[0], labels[0])
    return rows, examples


def _background(label):
    """Scores of the untouched gel."""
    return scores_of(label, lambda x, y: label.background[y, x], 0.0, 1.0)


def _circles(own, found):
    """Of each press the labelled circle, that found by the shading, and the middle about which the image is most odd."""
    rows = []
    for label, press in zip(own.presses, found, strict=True):
        middle = odd_middle(label.difference, near_px=label.centre_px, within_px=label.radius_px)
        rows.append({"press": int(label.name), "label_x_px": label.centre_px[0], "label_y_px": label.centre_px[1],
                     "label_radius_px": label.radius_px, "found_x_px": press.centre_px[0], "found_y_px": press.centre_px[1],
                     "found_radius_px": press.radius_px, "odd_x_px": middle[0], "odd_y_px": middle[1],
                     "found_minus_label_px": float(np.hypot(*np.subtract(press.centre_px, label.centre_px))),
                     "odd_minus_label_px": float(np.hypot(*np.subtract(middle, label.centre_px))),
                     "odd_minus_found_px": float(np.hypot(*np.subtract(middle, press.centre_px)))})
    return pd.DataFrame(rows)


def _examples(own, models, press, label):
    """Pictures of one press that was held out: measured, and by each model."""
    x, y = label.square(1.8 * label.radius_px)
    made = {"measured": label.image[y, x]} | {name: drawn(model, press, own.gel, x, y) for name, model in models.items()}
    circle = np.array([label.centre_px[0] - x[0, 0], label.centre_px[1] - y[0, 0], label.radius_px])
    return {name: np.rint(image).astype(np.uint8) for name, image in made.items()} | {"circle": circle}


def _ball_sizes(own: LabelledSet, one: dict[str, Any], values: dict[str, Any], options: dict[str, Any]) -> pd.DataFrame:
    """The error over the ball's size, of our models (found circles, in and around the contact) and of the wheel's table."""
    fit, held = split(len(own.presses), values["held_out"], values["seeds"][0])
    errors: dict[str, list[np.ndarray]] = {}
    sizes = [ratio * own.largest_px for ratio in values["ball_ratios"]]
    for ball in sizes:
        gel = Gel(ball, one["thickness_px"])
        found, finder = circles_found(own, fit, gel, options, 1)
        again = [found_again(own.presses[number], own, gel, finder) for number in held]
        reach = {name: [REACH * clipped(own.presses[number], gel).radius_px / press.radius_px
                        for number, press in zip(numbers, presses, strict=True)]
                 for name, numbers, presses in (("fit", fit, found), ("held", held, again))}
        for kind in ("polynomial", "phong"):
            model = fitted(kind, own, found, gel, options, reach=reach["fit"])
            errors.setdefault(kind, []).append(per_press_mae(model, again, gel, reach=reach["held"]))
        if own.wheel is not None:
            labelled = [clipped(press, gel) for press in own.presses]
            errors.setdefault(WHEEL, []).append(per_press_mae(own.wheel, labelled, gel, reach=[1.0] * len(labelled)))
    rows = [_size_rows(name, np.array(found), sizes, one["mm_per_px"]) for name, found in errors.items()]
    return pd.concat(rows, ignore_index=True)


def _size_rows(model, errors, sizes, mm_per_px):
    """A row for each size: the mean error, the best size, and its interval over presses drawn with replacement."""
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, errors.shape[1], (_DRAWS, errors.shape[1]))
    best = np.array(sizes)[np.argmin(errors[:, chosen].mean(axis=2), axis=0)]
    low, high = np.quantile(best, [0.025, 0.975])
    return pd.DataFrame({"model": model, "ball_px": sizes, "ball_mm": np.array(sizes) * mm_per_px, "mae": errors.mean(axis=1),
                         "best_px": sizes[int(np.argmin(errors.mean(axis=1)))], "best_low_px": low, "best_high_px": high,
                         "presses": errors.shape[1]})

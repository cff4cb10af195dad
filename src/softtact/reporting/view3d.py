"""A surface in colours that turns in a browser: one self-contained piece of HTML, without a network, a library or a graphics card.

The page's own script (`view3d_script`) draws the triangles into a depth buffer: nested surfaces are right, every browser does it,
and a page may hold as many views as it likes (browsers allow a page only few WebGL contexts).
"""

import base64
import html
import json
from collections.abc import Sequence

import numpy as np

from softtact.errors import InputError
from softtact.reporting.view3d_script import SCRIPT

_DIGITS = 3      # of the numbers beside the colour bar


def html_view(points_mm: np.ndarray, triangles: np.ndarray, values: np.ndarray, *, title: str, unit: str,
              labels: Sequence[str] | None = None, limits: tuple[float, float] | None = None, map_name: str = "viridis",
              see_through: int = 0) -> str:
    """A piece of HTML, a <figure> with its script: the surface turns by mouse, touch and arrow keys, and zooms.

    points_mm: (n, 3), z upwards, or (states, n, 3): a slider goes through the states
    triangles: (m, 3) indices of points, seen from both sides
    values: (n,) or (states, n) in `unit`, coloured over `limits` (low, high; by default all of them); nan is grey
    see_through: so many of the last triangles are the object, drawn see-through, and can be hidden
    title: what is shown;  unit: stands at the colour bar;  labels: what each state is, at its slider
    Several views may stand on a page. Nothing is loaded: it works from a file.
    """
    points, triangles, values = _checked(points_mm, triangles, values)
    labels = [str(label) for label in labels] if labels is not None else [""] * max(len(points), len(values))
    if len(labels) != max(len(points), len(values)):
        raise InputError(f"The view {title!r} has {max(len(points), len(values))} states and {len(labels)} labels; name each.")
    low, high = limits or _limits(values)
    data = {"points": _packed(points, "<f4"), "triangles": _packed(triangles, "<u4"), "values": _packed(values, "<f4"),
            "count": points.shape[1], "pointStates": len(points), "valueStates": len(values), "labels": labels,
            "seeThrough": see_through, "low": low, "high": high, "colours": _packed(_colours(map_name), "u1")}
    return (f'<figure class="view3d" data-title="{html.escape(title)}"><figcaption>{html.escape(title)}</figcaption>'
            f"{_bar(low, high, unit, map_name)}"
            f"<script>\n({SCRIPT.strip()})(document.currentScript.parentElement, {_json(data)});\n</script></figure>")


def _checked(points, triangles, values):
    """Arrays (states, n, 3), (m, 3) and (states, n) that fit each other."""
    points, values = (np.asarray(array, dtype=float) for array in (points, values))
    points, values = points.reshape(-1, *points.shape[-2:]), values.reshape(-1, values.shape[-1])
    triangles = np.asarray(triangles)
    count = points.shape[1]
    if points.shape[2] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3 or values.shape[1] != count:
        raise InputError(f"A view needs points (n, 3), triangles (m, 3) and values (n,); these are {points.shape}, "
                         f"{triangles.shape} and {values.shape}.")
    if len({len(points), len(values), 1}) > 2:
        raise InputError(f"A view's points have {len(points)} states and its values {len(values)}; give one, or as many of each.")
    if not np.isfinite(points).all() or (triangles.size and not 0 <= triangles.min() <= triangles.max() < count):
        raise InputError("A view's points must be finite, and its triangles be made of them.")
    return points, triangles, values


def _limits(values):
    """Lowest and highest finite value; 0 and 1 where there is none."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return low, high if high > low else low + 1.0


def _packed(array, kind):
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()


def _json(data):
    """JSON that cannot end the script that it stands in."""
    return json.dumps(data).replace("<", "\\u003c")


def _colours(map_name, count=256):
    """Red, green, blue (count, 3) of a colour map, 0 to 255."""
    from matplotlib import colormaps

    return np.round(255 * colormaps[map_name](np.linspace(0, 1, count))[:, :3])


def _bar(low, high, unit, map_name):
    """The colour bar, with the values at its ends and its middle."""
    stops = ",".join("rgb({:.0f},{:.0f},{:.0f})".format(*colour) for colour in _colours(map_name, 17))
    smallest = 1e-6 * (high - low)     # below, it is round-off and reads as 0
    ticks = [value if abs(value) > smallest else 0.0 for value in (low, (low + high) / 2, high)]
    numbers = "".join(f"<span>{value:.{_DIGITS}g}</span>" for value in ticks)
    return (f'<div class="view3d-bar" style="max-width:420px;font:13px system-ui,sans-serif"><div style="height:12px;'
            f'border:1px solid #888;background:linear-gradient(to right,{stops})"></div><div style="display:flex;'
            f'justify-content:space-between">{numbers}</div><div style="text-align:center">{html.escape(unit)}</div></div>')

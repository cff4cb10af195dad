"""An interactive view of a coloured surface: self-contained HTML that needs no network, library or graphics card.

Its script draws the triangles into a depth buffer. So nested surfaces are drawn correctly in every browser, and a page may have
any number of views, whereas browsers allow only few WebGL contexts.
"""

import base64
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softtact.errors import InputError

SCRIPT = r"""
function (figure, data) {
  "use strict";
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const allPoints = new Float32Array(bytes(data.points).buffer), allValues = new Float32Array(bytes(data.values).buffer);
  const triangles = new Uint32Array(bytes(data.triangles).buffer), colours = bytes(data.colours), count = data.count;
  const BACKGROUND = 0xffffffff, UNKNOWN = [170, 170, 170], LIGHT = [-0.3, 0.45, 0.84], FIRST = {turn: -0.6, tilt: 0.55, zoom: 1};
  const view = Object.assign({}, FIRST);
  let state = data.labels.length - 1, waiting = false, shown = true;

  // The middle of all states and their sides, so that a change of state does not move the picture.
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < allPoints.length; i++) {
    low[i % 3] = Math.min(low[i % 3], allPoints[i]);
    high[i % 3] = Math.max(high[i % 3], allPoints[i]);
  }
  const middle = low.map((value, k) => (value + high[k]) / 2), sides = low.map((value, k) => high[k] - value);
  const plan = Math.hypot(sides[0], sides[1]);     // how wide the body gets when it turns

  function fitted(width, height) {   // pixels per mm at which nothing is cut off, however the body is turned at this tilt
    const tall = plan * Math.abs(Math.sin(view.tilt)) + sides[2] * Math.cos(view.tilt);
    return 0.95 * Math.min(width / (plan || 1), height / (tall || 1));
  }

  const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
  canvas.style.cssText = "width:100%;height:min(75vw,75vh);min-height:240px;max-height:900px;touch-action:none;cursor:grab;"
    + "display:block;background:#fff";
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", figure.dataset.title + "; arrow keys turn it, plus and minus zoom, 0 puts it back");
  figure.insertBefore(canvas, figure.querySelector(".view3d-bar"));
  const hint = document.createElement("small");
  hint.textContent = "Drag or arrow keys turn; pinch, + and \u2212, or (after a click) the wheel zoom; 0 or a double click "
    + "puts it back. " + low.map((value, k) => (high[k] - value).toPrecision(3)).join(" \u00d7 ") + " mm.";
  figure.appendChild(hint);

  function axes() {   // rows: to the right, upwards, towards the eye
    const c = Math.cos(view.turn), s = Math.sin(view.turn), ct = Math.cos(view.tilt), st = Math.sin(view.tilt);
    return [[c, s, 0], [-s * st, c * st, ct], [s * ct, -c * ct, st]];
  }

  function draw() {
    waiting = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 1.5);
    const pixelsOf = length => Math.max(1, Math.round(length * ratio));
    const width = pixelsOf(canvas.clientWidth), height = pixelsOf(canvas.clientHeight);
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const image = context.createImageData(width, height), pixels = new Uint32Array(image.data.buffer);
    const depth = new Float32Array(width * height).fill(-Infinity);
    pixels.fill(BACKGROUND);
    const [right, up, eye] = axes(), scale = view.zoom * fitted(width, height);
    const points = allPoints.subarray(3 * count * (state % data.pointStates));
    const values = allValues.subarray(count * (state % data.valueStates));
    const seen = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      const x = points[3 * i] - middle[0], y = points[3 * i + 1] - middle[1], z = points[3 * i + 2] - middle[2];
      seen[3 * i] = width / 2 + scale * (right[0] * x + right[1] * y + right[2] * z);
      seen[3 * i + 1] = height / 2 - scale * (up[0] * x + up[1] * y + up[2] * z);
      seen[3 * i + 2] = scale * (eye[0] * x + eye[1] * y + eye[2] * z);
    }
    const target = {pixels, depth, width, height};
    const solid = triangles.length - 3 * data.seeThrough, end = shown ? triangles.length : solid;
    for (let t = 0; t < end; t += 3) fill(seen, values, triangles[t], triangles[t + 1], triangles[t + 2], target, t >= solid);
    context.putImageData(image, 0, 0);
    drawAxes(right, up, ratio, height);
  }

  function fill(seen, values, a, b, c, {pixels, depth, width, height}, everySecond) {   // every second pixel lets one see through
    const ax = seen[3 * a], ay = seen[3 * a + 1], az = seen[3 * a + 2];
    const ux = seen[3 * b] - ax, uy = seen[3 * b + 1] - ay, uz = seen[3 * b + 2] - az;
    const vx = seen[3 * c] - ax, vy = seen[3 * c + 1] - ay, vz = seen[3 * c + 2] - az;
    const area = ux * vy - uy * vx;
    if (Math.abs(area) < 1e-9) return;
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, length = Math.hypot(nx, ny, area);
    const toEye = Math.sign(area);      // both sides are lit: the normal is turned to the eye
    const light = 0.45 + 0.55 * Math.max(0, toEye * (LIGHT[0] * nx - LIGHT[1] * ny + LIGHT[2] * area) / length);
    const x0 = Math.max(0, Math.ceil(Math.min(ax, ax + ux, ax + vx))), x1 = Math.min(width - 1, Math.max(ax, ax + ux, ax + vx));
    const y0 = Math.max(0, Math.ceil(Math.min(ay, ay + uy, ay + vy))), y1 = Math.min(height - 1, Math.max(ay, ay + uy, ay + vy));
    const valueA = values[a], valueU = values[b] - valueA, valueV = values[c] - valueA;
    for (let y = y0; y <= y1; y++) {
      for (let x = everySecond ? x0 + (x0 + y & 1) : x0; x <= x1; x += everySecond ? 2 : 1) {
        const u = ((x - ax) * vy - (y - ay) * vx) / area, v = ((y - ay) * ux - (x - ax) * uy) / area;
        if (u < -1e-6 || v < -1e-6 || u + v > 1.000001) continue;
        const z = az + u * uz + v * vz, pixel = y * width + x;
        if (z <= depth[pixel]) continue;
        depth[pixel] = z;
        const share = (valueA + u * valueU + v * valueV - data.low) / (data.high - data.low);
        const k = 3 * Math.max(0, Math.min(255, Math.round(255 * share)));
        const [red, green, blue] = share === share ? [colours[k], colours[k + 1], colours[k + 2]] : UNKNOWN;
        pixels[pixel] = 0xff000000 | (light * blue << 16) | (light * green << 8) | (light * red);
      }
    }
  }

  function drawAxes(right, up, ratio, height) {
    const length = 26 * ratio, x = 40 * ratio, y = height - 40 * ratio;
    context.strokeStyle = context.fillStyle = "#222";
    context.lineWidth = 1.5 * ratio;
    context.font = 13 * ratio + "px system-ui, sans-serif";
    ["x", "y", "z"].forEach((name, k) => {
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + length * right[k], y - length * up[k]);
      context.stroke();
      context.fillText(name, x + 1.3 * length * right[k] - 4 * ratio, y - 1.3 * length * up[k] + 4 * ratio);
    });
  }

  function show() { if (!waiting) { waiting = true; requestAnimationFrame(draw); } }
  function turn(dx, dy) {
    view.turn -= dx;
    view.tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.tilt + dy));
    show();
  }
  function zoom(factor) { view.zoom = Math.max(0.3, Math.min(30, view.zoom * factor)); show(); }
  function back() { Object.assign(view, FIRST); show(); }

  const fingers = new Map();
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, event => fingers.delete(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (!fingers.has(event.pointerId)) return;
    const apart = () => { const [p, q] = [...fingers.values()]; return Math.hypot(p[0] - q[0], p[1] - q[1]) || 1; };
    const [x, y] = fingers.get(event.pointerId), before = fingers.size === 2 ? apart() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 2) zoom(apart() / before);
    else turn(0.01 * (event.clientX - x), 0.01 * (event.clientY - y));
  });
  canvas.addEventListener("wheel", event => {   // unclicked, the wheel scrolls the page
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-0.001 * event.deltaY));
  }, {passive: false});
  canvas.addEventListener("dblclick", back);
  const keys = {ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
                ArrowDown: () => turn(0, 0.1), "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), "0": back};
  canvas.addEventListener("keydown", event => { if (keys[event.key]) { event.preventDefault(); keys[event.key](); } });
  window.addEventListener("resize", show);

  if (data.labels.length > 1) {
    const label = document.createElement("label"), slider = document.createElement("input"), name = document.createElement("span");
    Object.assign(slider, {type: "range", min: 0, max: data.labels.length - 1, step: 1, value: state});
    slider.style.cssText = "width:240px;vertical-align:middle;margin-right:.6em";
    label.style.cssText = "font:14px system-ui,sans-serif;display:block;margin:.4em 0";
    label.append(slider, name);
    canvas.after(label);
    slider.addEventListener("input", () => { state = Number(slider.value); name.textContent = data.labels[state]; show(); });
    name.textContent = data.labels[state];
  }
  if (data.seeThrough) {
    const label = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, {type: "checkbox", checked: true});
    label.style.cssText = "font:14px system-ui,sans-serif;display:block;margin:.4em 0";
    label.append(box, " object");
    canvas.after(label);
    box.addEventListener("change", () => { shown = box.checked; show(); });
  }
  show();
}
"""


_DIGITS = 3      # of the numbers beside the colour bar


@dataclass(frozen=True)
class ColourScale:
    """Colours of a view's values."""

    limits: tuple[float, float] | None = None
    """Values at the ends of the scale; by default the lowest and the highest."""
    map_name: str = "viridis"
    """Name of matplotlib's colour map."""


def html_view(points_mm: np.ndarray, triangles: np.ndarray, values: np.ndarray, *, title: str, unit: str,
              labels: Sequence[str] | None = None, scale: ColourScale = ColourScale(), see_through: int = 0) -> str:
    """HTML of a <figure> with its script: the surface turns by mouse, touch and arrow keys, and zooms.

    points_mm: (n, 3), z upwards, or (states, n, 3) with a slider for the states
    triangles: (m, 3) indices of points, visible from both sides
    values: (n,) or (states, n) in `unit`, the label of the colour bar; nan is grey
    labels: names of the states at the slider;  see_through: number of triangles at the end that belong to the object, which is
    drawn transparent and can be hidden
    A page may have several views. It loads nothing and works from a file.
    """
    points, triangles, values = _checked(points_mm, triangles, values)
    labels = [str(label) for label in labels] if labels is not None else [""] * max(len(points), len(values))
    if len(labels) != max(len(points), len(values)):
        raise InputError(f"The view {title!r} has {max(len(points), len(values))} states and {len(labels)} labels; name each.")
    low, high = scale.limits or _limits(values)
    data = {"points": _packed(points, "<f4"), "triangles": _packed(triangles, "<u4"), "values": _packed(values, "<f4"),
            "count": points.shape[1], "pointStates": len(points), "valueStates": len(values), "labels": labels,
            "seeThrough": see_through, "low": low, "high": high, "colours": _packed(_colours(scale.map_name), "u1")}
    return (f'<figure class="view3d" data-title="{html.escape(title)}"><figcaption>{html.escape(title)}</figcaption>'
            f"{_bar(low, high, unit, scale.map_name)}"
            f"<script>\n({SCRIPT.strip()})(document.currentScript.parentElement, {_json(data)});\n</script></figure>")


def _checked(points, triangles, values):
    """Arrays (states, n, 3), (m, 3) and (states, n), checked for consistency."""
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
        raise InputError("A view's points must be finite, and its triangles must refer to them.")
    return points, triangles, values


def _limits(values):
    """Lowest and highest finite value; 0 and 1 if there is none."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return low, high if high > low else low + 1.0


def _packed(array, kind):
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()


def _json(data):
    """JSON in which no text can end the surrounding script."""
    return json.dumps(data).replace("<", "\\u003c")


def _colours(map_name, count=256):
    """Red, green, blue (count, 3) of a colour map, 0 to 255."""
    from matplotlib import colormaps

    return np.round(255 * colormaps[map_name](np.linspace(0, 1, count))[:, :3])


def _bar(low, high, unit, map_name):
    """The colour bar, with the values at its ends and its middle."""
    stops = ",".join("rgb({:.0f},{:.0f},{:.0f})".format(*colour) for colour in _colours(map_name, 17))
    smallest = 1e-6 * (high - low)     # smaller numbers are round-off and shown as 0
    ticks = [value if abs(value) > smallest else 0.0 for value in (low, (low + high) / 2, high)]
    numbers = "".join(f"<span>{value:.{_DIGITS}g}</span>" for value in ticks)
    return (f'<div class="view3d-bar" style="max-width:420px;font:13px system-ui,sans-serif"><div style="height:12px;'
            f'border:1px solid #888;background:linear-gradient(to right,{stops})"></div><div style="display:flex;'
            f'justify-content:space-between">{numbers}</div><div style="text-align:center">{html.escape(unit)}</div></div>')

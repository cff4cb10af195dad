"""A page part on which one drags through sequences: depth image, solved image, generated image, and markers' motions, five times.

All frames are in the page, as small PNG strips in base64; nothing is loaded from elsewhere.
"""

import base64
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_STYLE = """<style>.drag canvas{width:100%;image-rendering:auto;border:1px solid #ddd;touch-action:none}
.drag input[type=range]{width:100%}.drag .told{font:13px/1.4 system-ui,sans-serif;color:#444}</style>"""
_SCRIPT = """<script>(function(){
const part=name=>document.getElementById("drag-"+name), data=JSON.parse(part("data").textContent), pick=part("pick"),
 slider=part("slider"), canvas=part("canvas"), told=part("told"), arrows=part("arrows"), pen=canvas.getContext("2d"), side=256,
 images={};
data.forEach((one,k)=>{const o=document.createElement("option");o.value=k;o.textContent=one.title;pick.appendChild(o)});
function draw(){const one=data[+pick.value], k=Math.min(+slider.value,one.frames.length-1);slider.max=one.frames.length-1;
 canvas.width=side*one.panels.length;canvas.height=side;
 const key=pick.value+"/"+k;let image=images[key];
 if(!image){image=images[key]=new Image();image.onload=draw;image.src="data:image/png;base64,"+one.frames[k]}
 if(!image.complete)return;
 pen.imageSmoothingEnabled=true;pen.drawImage(image,0,0,canvas.width,side);
 if(arrows.checked)one.panels.forEach((panel,p)=>{const now=one.places[panel];if(!now)return;
  pen.strokeStyle="#ff0";pen.lineWidth=1.2;
  const rest=now[0];now[k].forEach((to,m)=>{if(!to||!rest[m])return;const [x,y]=rest[m];pen.beginPath();pen.moveTo(p*side+x,y);
  pen.lineTo(p*side+x+5*(to[0]-x),y+5*(to[1]-y));pen.stroke()})});
 told.textContent=one.panels.join("  |  ")+".  Frame "+k+" of "+(one.frames.length-1)+": "+one.told[k]}
slider.oninput=pick.onchange=arrows.onchange=draw;
canvas.onpointermove=e=>{if(!e.buttons)return;const r=canvas.getBoundingClientRect();
 slider.value=Math.round((e.clientX-r.left)/r.width*slider.max);draw()};
draw()})();</script>"""


@dataclass(frozen=True)
class DragSequence:
    """One sequence with its panels."""

    title: str
    """In the list."""
    panels: dict[str, np.ndarray]
    """{name: images (n, y, x, 3) uint8}, all of one size."""
    places: dict[str, np.ndarray]
    """{name of a panel: (n, marker, 2) px of an image with 256 px a side}; nan where a marker is not found."""
    told: list[str]
    """(n) words on each frame."""


def drag_fragment(sequences: Sequence[DragSequence]) -> str:
    """HTML with a slider, a list of sequences and a canvas, which a page takes as a figure."""
    data = json.dumps([_plain(one) for one in sequences], separators=(",", ":"))
    return (
        f'{_STYLE}<div class="drag"><p><select id="drag-pick" aria-label="sequence"></select> '
        '<label><input type="checkbox" id="drag-arrows" checked> motion of the markers, five times</label></p>'
        '<input type="range" id="drag-slider" min="0" value="0" aria-label="frame">'
        '<canvas id="drag-canvas"></canvas><p class="told" id="drag-told"></p>'
        f'<script type="application/json" id="drag-data">{data}</script>{_SCRIPT}</div>'
    )


def _plain(one: DragSequence) -> dict:
    strips = np.concatenate(list(one.panels.values()), axis=2)
    return {
        "title": one.title,
        "panels": list(one.panels),
        "told": one.told,
        "frames": [_png(strip) for strip in strips],
        "places": {name: _rounded(places) for name, places in one.places.items()},
    }


def _rounded(places: np.ndarray) -> list:
    return [[None if np.isnan(px).any() else [round(float(px[0]), 1), round(float(px[1]), 1)] for px in frame] for frame in places]


def _png(image: np.ndarray) -> str:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode()

"""A sensor as MJCF text that MuJoCo loads without softtact: its pad, its frame, and a touch sensor for its taxels.

Two forms: the plugin `mujoco.sensor.touch_grid`, which MuJoCo's wheel has, or a site and a `touch` sensor for each taxel, which MJX
and MuJoCo Warp know, too. Both sum up the contact forces of the engine in each taxel's area. They know nothing of the layer: see
`softtact.robot.attach` for what a soft pad does to them.
"""

from xml.sax.saxutils import quoteattr

import numpy as np

from softtact.press.sensor import Sensor, load_sensor
from softtact.robot.geoms import MM
from softtact.robot.scene import PAD_COLOUR, PAD_CONTACT

# The plugin's taxels are bins of angles, seen from its site. From so far off they are as wide as the sensor's within 1e-4.
_EYE_M = 1.0

_TEXT = """<mujoco model={name}>
  <!-- {words}
       Frame: origin in the middle of the sensing surface, z out of it, x along {columns} columns, y along {rows} rows.
       {order}
       {sign}Normal contact forces in N of a rigid pad: no deformation, no spreading into neighbours, no counts. -->{extension}
  <worldbody>
    <body name={name}>
      <geom name={pad} type="box" size="{half}" pos="0 0 {middle}" mass="0" rgba="{colour}" priority="1" condim="{condim}"
            solref="{solref}" solimp="{solimp}"/>
      <site name={frame} size="0.001"/>
{sites}
    </body>
  </worldbody>
  <sensor>
{sensors}
  </sensor>
</mujoco>
"""
_PLUGIN = """    <plugin name={taxels} plugin="mujoco.sensor.touch_grid" objtype="site" objname={taxels}>
      <config key="size" value="{columns} {rows}"/><config key="fov" value="{fov}"/>
      <config key="gamma" value="0"/><config key="nchannel" value="1"/>
    </plugin>"""


def export_mjcf(sensor: Sensor | str, *, plugin: bool = True) -> str:
    """MJCF text of a sensor with taxels; its body and all names begin with the sensor's name. See the module.

    plugin: the form with `touch_grid`; else one site and one `touch` sensor for each taxel, NAME_ROW_COLUMN
    The numbers of `sensordata`, reshaped to (rows, columns), lie like `PressResult.tactile_map`. Those of the plugin may all be
    negative: their sign follows from the order of bodies. Raises InputError for a sensor without taxels.
    """
    spec = (load_sensor(sensor) if isinstance(sensor, str) else sensor).spec
    taxels = spec.need_taxels("a touch sensor of MuJoCo")
    sides = np.array(spec.footprint_mm) * MM
    names = {"name": quoteattr(spec.name)} | {one: quoteattr(f"{spec.name}_{one}") for one in ("pad", "frame", "taxels")}
    if plugin:
        sites = f'      <site name={names["taxels"]} pos="0 0 {_EYE_M:g}" size="0.001" rgba="0 0 0 0"/>'
        fov = np.degrees(np.arctan(0.5 * sides / _EYE_M))
        sensors = _PLUGIN.format(columns=taxels.columns, rows=taxels.rows, fov=_plain(fov), **names)
    else:
        sites, sensors = _of_each_taxel(spec, sides / [taxels.columns, taxels.rows])
    half = [*(0.5 * sides), 0.5 * spec.thickness_mm * MM]
    extension = '\n  <extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>' if plugin else ""
    return _TEXT.format(words=spec.in_words.replace("--", "-"), rows=taxels.rows, columns=taxels.columns, extension=extension,
                        sign="Take absolute values: the plugin's sign depends on the order of bodies. " if plugin else "",
                        order="Numbers: row by row from the least y on, in a row from the least x on.", half=_plain(half),
                        middle=f"{-half[2]:g}", colour=_plain(PAD_COLOUR), condim=PAD_CONTACT["condim"], sites=sites,
                        solref=_plain(PAD_CONTACT["solref"]), solimp=_plain(PAD_CONTACT["solimp"]), sensors=sensors, **names)


def _of_each_taxel(spec, pitch):
    """Lines of a site, as thick as the pad to either side of the surface, and of a sensor for each taxel."""
    sites, sensors = [], []
    size = _plain([*(0.5 * pitch), spec.thickness_mm * MM])
    for row in range(spec.taxels.rows):
        for column in range(spec.taxels.columns):
            name = quoteattr(f"{spec.name}_{row}_{column}")
            x, y = pitch * (np.array([column, row]) - 0.5 * (np.array([spec.taxels.columns, spec.taxels.rows]) - 1))
            sites.append(f'      <site name={name} type="box" size="{size}" pos="{x:.9g} {y:.9g} 0" rgba="0 0 0 0"/>')
            sensors.append(f"    <touch name={name} site={name}/>")
    return "\n".join(sites), "\n".join(sensors)


def _plain(numbers):
    return " ".join(f"{number:.9g}" for number in numbers)

"""The page of one tab: widgets and the 3-D scene of viser, which show a `Tab` and change its state."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
import viser
from scipy.spatial.transform import Rotation

from softtact.errors import SofttactError
from softtact.play import pictures
from softtact.play.bench import Bench, force_span_n
from softtact.play.files import Folder
from softtact.play.recorded import Recorded
from softtact.play.solver import Shown
from softtact.play.state import Object, State, free_name
from softtact.play.tab import LONGEST_S, Tab
from softtact.press.result import PressResult

UNITS = ("mm", "cm", "m", "inch")
_OBJECT, _BOARD = (228, 140, 60), (46, 60, 72)
_BOARD_MM = 1.5             # thickness of the plate below the layers
_ASIDE_MM = 0.02            # movement of the gizmo along z that counts as one
_QUALITY = 92               # of the picture as JPEG, which is made in a fifth of a PNG's time
_LEAST_DEPTH_MM, _DEEPEST = 0.01, 0.6     # of a press by depth: least, and the largest share of the thickness
_STEP_MM, _STEP_DEG, _STEP_LOAD = 0.5, 5.0, 1.1      # of the keys
# Of the camera, in lengths of the sensor's longer side, and how many times farther away it is on a narrow screen.
_PERSPECTIVE, _FARTHER = np.array([0.45, -1.25, 1.1]), 1.6
_WIDE = 0.75                # of the width of sensor and taxels, which is seen as well as so much of the length


class Page:
    """Widgets and scene of one tab."""

    def __init__(self, client: viser.ClientHandle, state: State, objects: dict[str, Object], sensors: list[str],
                 folder: Folder, recorded: Recorded | None = None) -> None:
        self._client, self._gui, self._scene = client, client.gui, client.scene
        self._objects, self._folder = dict(objects), folder
        self._object_shown: Object | None = None
        self._sensor_shown = ""
        self._gizmo_from = np.zeros(3)
        self._depth_from = 0.0
        self._long_said = "Not run."
        self.tab = Tab(state, self, folder)
        state = self.tab.state = replace(state, **self._borne(state, state.sensor))
        self._build_panel(state, sensors)
        self._build_scene()
        self._fit_panel(state.sensor)
        self._add_keys()
        if recorded is not None:
            self._show_recording(recorded)
        self.tab.start()

    # --- what the tab shows: `View` ---

    def show(self, shown: Shown) -> None:
        """Show a press in the scene and the panel."""
        with self._client.atomic():
            self._show_sensor(shown)
            self._show_object(shown)
            self._show_board(shown)
            self._show_long_words()
            self._numbers.content = self._table(shown)
            self._same.content = f"```bash\n{shown.press.command_lines}\n```\n```python\n{shown.press.python}\n```"

    def refuse(self, sentence: str) -> None:
        """Show why there is no map."""
        self._numbers.content = _refused(sentence, self.tab.shown)

    def tell(self, sentence: str) -> None:
        """Show what a button did."""
        self._told.content = _plain(sentence)

    def show_long(self, words: str, result: PressResult | None, fast: Shown | None) -> None:
        """Show a long press: its progress, or its end with the difference to the fast model's of the same press."""
        if result is None:
            self._long_said, self._difference.visible = _plain(words), False
            self._show_long_words()
            return
        lines = [f"**{_plain(words)}**: {result.indentation_mm[-1]:.3f} mm deep{_apart(result, fast)}."]
        if result.selection_reason:
            lines.append(f"Why this model: {_plain(result.selection_reason)}.")
        lines += [f"Not within validity: {why}." for why in result.validity_reason[-1:] if why]
        self._long_said = "\n\n".join(lines)
        self._show_long_words()
        self._difference.image = pictures.comparison(result, fast.result if fast else result)
        self._difference.visible = True

    def _show_long_words(self):
        """The words on the last long press, which may be that of an earlier state."""
        earlier = self.tab.long_state not in (None, self.tab.state)
        self._long_words.content = ("Of an earlier press: " if earlier else "") + self._long_said

    def show_recorded(self) -> None:
        """Show the recording's reading at the present time."""
        tab = self.tab
        with self._client.atomic():
            self._moment.value = round(tab.recorded_s, 2)
            self._play.label = "Stop" if tab.plays_recorded else "Play"
            if tab.shown is not None:
                self._show_board(tab.shown)

    def _show_board(self, shown):
        recorded, time_s = self.tab.recorded, self.tab.recorded_s
        counts = None if recorded is None else recorded.at(time_s).counts
        self._board.image = pictures.board(shown.result, shown.clearance_mm, counts)
        if recorded is not None:
            self._recorded_words.content = _plain(recorded.in_words(time_s, pictures.taxels_of(shown.result),
                                                                    float(shown.result.normal_force_n[-1])))

    # --- panel ---

    def _build_panel(self, state, sensors):
        gui = self._gui
        gui.set_panel_label("softtact play")
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        self._board = gui.add_image(np.full((416, 434, 3), 255, dtype=np.uint8), format="jpeg", jpeg_quality=_QUALITY)
        self._numbers = gui.add_markdown("The first map follows.")
        with gui.add_folder("Load"):
            self._load_by = gui.add_dropdown("load by", ("force", "depth"), initial_value=state.load_by)
            self._force = gui.add_slider("force, N", *force_span_n(self.tab.solver.bench(state.sensor)), 0.01, state.force_n,
                                         visible=state.load_by == "force")
            self._depth = gui.add_slider("depth, mm", 0.01, 2.0, 0.01, state.depth_mm, visible=state.load_by == "depth")
            self._slide_x = gui.add_slider("slide x, mm", -5.0, 5.0, 0.1, 0.0)
            self._slide_y = gui.add_slider("slide y, mm", -5.0, 5.0, 0.1, 0.0)
            self._twist = gui.add_slider("twist, deg", -45.0, 45.0, 1.0, 0.0)
        with gui.add_folder("Object and sensor"):
            self._object = gui.add_dropdown("object", tuple(self._objects), initial_value=self._name_of(state.object))
            self._sensor = gui.add_dropdown("sensor", tuple(sensors), initial_value=state.sensor)
            self._unit = gui.add_dropdown("unit of a file", ("of the file", *UNITS), initial_value="mm",
                                          hint="STL, OBJ, PLY and OFF files do not state their unit")
            self._upload = gui.add_upload_button("Take a mesh file", icon=viser.Icon.UPLOAD,
                                                 mime_type=".stl,.obj,.ply,.off,.3mf,.amf,.dae,.glb,.step,.stp,.zip")
        with gui.add_folder("Place", expand_by_default=False):
            self._place = gui.add_vector2("x, y, mm", (0.0, 0.0), step=0.1)
            self._turn = gui.add_vector3("turn, deg", (0.0, 0.0, 0.0), step=1.0)
            centre = gui.add_button("Centre", icon=viser.Icon.FOCUS_CENTERED)
        with gui.add_folder("Long model"):
            self._long = gui.add_dropdown("model", self.tab.solver.bench(state.sensor).models)
            self._on_release = gui.add_checkbox("after each release", self.tab.long_on_release)
            run = gui.add_button_group("press again", ("Run", "Abandon"))
            self._long_words = gui.add_markdown("Not run.")
            self._difference = gui.add_image(np.full((8, 8, 3), 255, dtype=np.uint8), format="png", visible=False)
        with gui.add_folder("Record and save"):
            self._record = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD)
            replay = gui.add_button("Replay", icon=viser.Icon.PLAYER_PLAY)
            movie = gui.add_button("Save recording as MP4", icon=viser.Icon.MOVIE)
            save = gui.add_button("Save press: NetCDF, PNG, lines", icon=viser.Icon.DOWNLOAD)
            self._told = gui.add_markdown(f"Files go to {self._folder.path}.")
        self._build_recorded()
        with gui.add_folder("The same press"):
            self._same = gui.add_markdown("")
        self._bind(centre, run, replay, movie, save)

    def _build_recorded(self):
        gui = self._gui
        with gui.add_folder("Recording of a real sensor", expand_by_default=False):
            take = gui.add_upload_button("Take a recording", icon=viser.Icon.UPLOAD, mime_type=".csv,.mcap")
            self._moment = gui.add_slider("time, s", 0.0, 1.0, 0.01, 0.0)
            self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY)
            self._recorded_words = gui.add_markdown("None.")
        take.on_upload(lambda _: self._take_recording(take.value))
        self._moment.on_update(lambda event: self.tab.look_at(float(self._moment.value)) if event.client is not None else None)
        self._play.on_click(lambda _: self.tab.play_recorded())

    def _take_recording(self, file):
        finger = self.tab.recorded.finger if self.tab.recorded else 0
        try:
            self._show_recording(Recorded.read(self._folder.keep_upload(file.name, file.content), finger=finger))
        except SofttactError as error:
            self._recorded_words.content = _plain(str(error))

    def _show_recording(self, recorded):
        self._moment.max = max(round(recorded.duration_s, 2), 0.01)
        self.tab.take_recorded(recorded)

    def _bind(self, centre, run, replay, movie, save):
        def on(handle: Any, change: Callable[[], Any]) -> None:
            handle.on_update(lambda event: change() if event.client is not None else None)     # not what this page set itself

        on(self._load_by, self._choose_load)
        on(self._force, lambda: self.tab.change(force_n=float(self._force.value)))
        on(self._depth, lambda: self.tab.change(depth_mm=float(self._depth.value)))
        on(self._slide_x, lambda: self.tab.change(slide_mm=(float(self._slide_x.value), self.tab.state.slide_mm[1])))
        on(self._slide_y, lambda: self.tab.change(slide_mm=(self.tab.state.slide_mm[0], float(self._slide_y.value))))
        on(self._twist, lambda: self.tab.change(twist_deg=float(self._twist.value)))
        on(self._object, lambda: self.tab.change(object=self._objects[self._object.value]))
        on(self._sensor, self._choose_sensor)
        on(self._place, lambda: self.tab.change(x_mm=float(self._place.value[0]), y_mm=float(self._place.value[1])))
        on(self._turn, lambda: self.tab.change(rotation_deg=tuple(map(float, self._turn.value))))
        on(self._on_release, lambda: setattr(self.tab, "long_on_release", self._on_release.value))
        on(self._long, lambda: setattr(self.tab, "long_model", self._long.value))
        centre.on_click(lambda _: self.tab.change(x_mm=0.0, y_mm=0.0, rotation_deg=(0.0, 0.0, 0.0), slide_mm=(0.0, 0.0),
                                                  twist_deg=0.0))
        run.on_click(lambda _: self._run_long() if run.value == "Run" else self.tab.abandon_long())
        self._record.on_click(lambda _: self._toggle_record())
        replay.on_click(lambda _: self.tab.replay())
        movie.on_click(lambda _: self.tab.save_movie())
        save.on_click(lambda _: self.tab.save())
        self._upload.on_upload(lambda _: self._take_upload())

    def _choose_load(self):
        self._force.visible, self._depth.visible = self._load_by.value == "force", self._load_by.value == "depth"
        self.tab.change(load_by=self._load_by.value)

    def _choose_sensor(self):
        """Press on another sensor, with a load that it bears."""
        try:
            self._fit_panel(self._sensor.value)
            self.tab.change(sensor=self._sensor.value, **self._borne(self.tab.state, self._sensor.value))
        except SofttactError as error:
            self._sensor.value = self.tab.state.sensor     # the panel is still as that sensor has it
            self.refuse(str(error))

    def _run_long(self):
        try:
            self.tab.run_long(self._long.value)
        except SofttactError as error:
            self.tell(str(error))

    def _fit_panel(self, name):
        """Ranges of the loads and long models as a sensor has them."""
        bench = self.tab.solver.bench(name)
        self._panel_of = name
        (self._force.min, self._force.max), self._depth.max = force_span_n(bench), _deepest_mm(bench)
        self._on_release.value = self.tab.long_on_release = bench.long_on_release
        self._long.options = bench.models
        self._long.value = self.tab.long_model = bench.models[0]

    def _borne(self, state, name):
        """The load of a state, as far as a sensor bears it."""
        bench = self.tab.solver.bench(name)
        force = float(np.clip(state.force_n, force_span_n(bench)[0], bench.first_force_n))
        return {"force_n": force, "depth_mm": min(state.depth_mm, _deepest_mm(bench))}

    def _toggle_record(self):
        records = self.tab.record()
        self._record.label = "End the recording" if records else "Record"
        self.tell(f"Recording: what you change is kept, for at most {LONGEST_S:.0f} s." if records else "Recorded.")

    def _take_upload(self):
        file = self._upload.value
        try:
            path = self._folder.keep_upload(file.name, file.content)
        except SofttactError as error:
            self.tell(str(error))
            return
        new = Object(path, None if self._unit.value == "of the file" else self._unit.value)
        name = free_name(self._objects, new)
        self._objects[name] = new
        self._object.options = tuple(self._objects)
        self._object.value = name
        self.tell(f"Kept {path}.")
        self.tab.change(object=new, x_mm=0.0, y_mm=0.0, rotation_deg=(0.0, 0.0, 0.0))

    def _name_of(self, of: Object) -> str:
        return next(name for name, one in self._objects.items() if one == of)

    def _add_keys(self):
        for key, label, change in (
                ("J", "Object to the left", lambda s: {"x_mm": s.x_mm - _STEP_MM}),
                ("L", "Object to the right", lambda s: {"x_mm": s.x_mm + _STEP_MM}),
                ("I", "Object forward", lambda s: {"y_mm": s.y_mm + _STEP_MM}),
                ("K", "Object back", lambda s: {"y_mm": s.y_mm - _STEP_MM}),
                ("U", "Turn to the left", lambda s: {"rotation_deg": (*s.rotation_deg[:2], s.rotation_deg[2] + _STEP_DEG)}),
                ("O", "Turn to the right", lambda s: {"rotation_deg": (*s.rotation_deg[:2], s.rotation_deg[2] - _STEP_DEG)}),
                ("M", "Press harder", lambda s: self._loaded(s, _STEP_LOAD)),
                ("N", "Press less", lambda s: self._loaded(s, 1 / _STEP_LOAD))):
            self._gui.add_command(label, hotkey=key).on_trigger(
                lambda _, change=change: self.tab.change(**change(self.tab.state)))
        self._gui.add_command("Record, or end it", hotkey="R").on_trigger(lambda _: self._toggle_record())
        self._gui.add_command("Save the press", hotkey="P").on_trigger(lambda _: self.tab.save())

    def _loaded(self, state, times):
        if state.load_by == "depth":
            return {"depth_mm": float(np.clip(state.depth_mm * times, _LEAST_DEPTH_MM, self._depth.max))}
        return {"force_n": float(np.clip(round(state.force_n * times, 2), self._force.min, self._force.max))}

    def _table(self, shown):
        """The numbers of a press as Markdown."""
        result, state = shown.result, shown.state
        rows = [*(_rows_of(result) if shown.done else []), ("press", f"{shown.stage}, {_time(shown.seconds)}")]
        notes = [*shown.remarks, *(f"Not within validity: {why}." for why in result.validity_reason[-1:] if why)]
        bench = self.tab.solver.bench(state.sensor)
        if shown.stage != "whole" and not bench.refines:
            what = "This press is coarse" if shown.draft else "The object only touches"
            notes.insert(0, f"{what}: the {bench.models[0]} model of this sensor takes seconds to minutes. It runs where the "
                            "object rests, or with Run below; the page goes on meanwhile.")
        if state.moves and isinstance(shown.press.load, float):
            notes.append(f"The {result.model} model has no friction here: slide and twist only change the place.")
        head = f"| {result.model} model{'' if shown.done else ': not pressed yet'} | |\n|---|---|\n"
        return head + "\n".join(f"| {name} | {value} |" for name, value in rows) + "".join(f"\n\n{_plain(note)}" for note in notes)

    # --- scene ---

    def _build_scene(self):
        self._surface = self._tiles = None
        self._mesh: Any = None
        self._gizmo = self._scene.add_transform_controls("/place", scale=7.0, depth_test=False, line_width=3.0)

        @self._gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:     # in the event loop, which keeps the order
            self._drag(event.phase)

    def _drag(self, phase):
        if phase == "start":
            self._gizmo_from = np.array(self._gizmo.position)
            self._depth_from = self._depth_shown()
        x, y, z = np.array(self._gizmo.position) - self.tab.solver.bench(self.tab.state.sensor).middle_mm * [1, 1, 0]
        turn = Rotation.from_quat(self._gizmo.wxyz, scalar_first=True).as_euler("xyz", degrees=True)
        fields: dict[str, Any] = {"x_mm": round(float(x), 3), "y_mm": round(float(y), 3),
                                  "rotation_deg": tuple(np.round(turn, 2).tolist())}
        if abs(down := self._gizmo_from[2] - z) > _ASIDE_MM:
            depth = float(np.clip(self._depth_from + down, _LEAST_DEPTH_MM, self._depth.max))
            fields |= {"load_by": "depth", "depth_mm": round(depth, 3)}
        self.tab.change(held=phase != "end", **fields)

    def _depth_shown(self):
        return float(self.tab.shown.result.indentation_mm[-1]) if self.tab.shown else 0.0

    def _show_sensor(self, shown):
        surface, tiles = pictures.surface_mesh(shown.result), pictures.taxel_mesh(shown.result)
        if (sensor := self.tab.state.sensor) != self._panel_of:
            self._fit_panel(sensor)
        if shown.state.sensor != self._sensor_shown:
            self._new_sensor(surface, tiles)
            self._sensor_shown = shown.state.sensor
        if self._surface is None:
            self._surface = self._scene.add_glb("/surface", _glb(surface), cast_shadow=False)
        self._surface.glb_data = _glb(surface)
        if tiles is not None:
            if self._tiles is None:
                self._tiles = self._scene.add_glb("/taxels", _glb(tiles), cast_shadow=False)
            self._tiles.glb_data = _glb(tiles)
        if self._tiles is not None:
            self._tiles.visible = tiles is not None

    def _new_sensor(self, surface, tiles):
        """A board below a new sensor, and the camera on it and its taxels."""
        low, high = surface.bounds
        width, length, _ = 1.04 * (high - low)
        self._scene.add_box("/board", dimensions=(width, length, _BOARD_MM), color=_BOARD, cast_shadow=False,
                            position=(*(0.5 * (low + high)[:2]), low[2] - _BOARD_MM / 2))
        right = high[0] if tiles is None else tiles.bounds[1, 0]
        middle, width = 0.5 * (low + [right, *high[1:]]), right - low[0]
        self._look(middle, width, max(length, _WIDE * width, 2 * (high - low)[2]))

    def _look(self, middle, width, size):
        """Show sensor and taxels beside the panel; above it on a narrow screen, where the panel is below."""
        narrow = self._client.camera.aspect < 1
        at = middle + (np.array([0.1 * width, -1.7 * size, 0.0]) if narrow else np.array([0.25 * width, 0.0, 0.0]))
        self._client.camera.position = at + _PERSPECTIVE * size * (_FARTHER if narrow else 1.0)
        self._client.camera.look_at = at

    def _show_object(self, shown):
        state, mesh = shown.state, self.tab.solver.mesh(shown.state.object)
        if state.object != self._object_shown:
            light = pictures.light_mesh(mesh)
            self._mesh = self._scene.add_mesh_simple("/object", light.vertices, light.faces, color=_OBJECT, opacity=0.45,
                                                     side="double", flat_shading=True)
            self._object_shown = state.object
        self._mesh.position, self._mesh.wxyz = shown.end
        if not self.tab.held:
            turn = Rotation.from_euler("xyz", state.rotation_deg, degrees=True)
            height = (Rotation.from_quat(shown.end[1], scalar_first=True).apply(mesh.bounds.mean(axis=0)) + shown.end[0])[2]
            x, y, _ = self.tab.solver.bench(state.sensor).middle_mm
            self._gizmo.position, self._gizmo.wxyz = (state.x_mm + x, state.y_mm + y, height), turn.as_quat(scalar_first=True)
        self._show_state(self.tab.state)     # which may be newer than that of a press that took long

    def _show_state(self, state):
        """Widgets as the state is, which the gizmo, a key or a replay may have changed."""
        self._force.value = float(np.clip(state.force_n, self._force.min, self._force.max))
        self._depth.value = min(state.depth_mm, self._depth.max)
        self._slide_x.value, self._slide_y.value = state.slide_mm
        self._twist.value = state.twist_deg
        self._place.value, self._turn.value = (state.x_mm, state.y_mm), state.rotation_deg
        if self._load_by.value != state.load_by:
            self._load_by.value = state.load_by
            self._force.visible, self._depth.visible = state.load_by == "force", state.load_by == "depth"
        if self._sensor.value != state.sensor:
            self._sensor.value = state.sensor
        if (name := self._name_of(state.object)) != self._object.value:
            self._object.value = name


def _refused(sentence: str, before: Shown | None) -> str:
    """Why there is no map, and what the scene shows instead."""
    shown = f"\n\nScene, map and lines are still those of the press before, on {_plain(before.state.sensor)}." if before else ""
    return f"**No map.** {_plain(sentence)}{shown}"


def _plain(sentence: str) -> str:
    """A sentence as Markdown that shows it as it is, such as a file's name with underscores."""
    return re.sub(r"([\\`*_<>\[\]{}|#$])", r"\\\1", sentence)


def _deepest_mm(bench: Bench) -> float:
    """Largest depth of a press by depth."""
    return round(_DEEPEST * float(bench.size_mm[2]), 2)


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"


def _rows_of(result: PressResult) -> list[tuple[str, str]]:
    """Names and values of a result's numbers."""
    rows = [("force", f"{result.normal_force_n[-1]:.4g} N"), ("depth", f"{result.indentation_mm[-1]:.3f} mm"),
            ("contact", f"{result.contact_area_mm2[-1]:.4g} mm²")]
    if result.deformation_map_mm is not None:
        rows.append(("deformation, most", f"{result.deformation_map_mm[-1].max():.3f} mm"))
    else:
        rows.append(("displacement, most", f"{pictures.moved_mm(result).max():.3f} mm"))
    if (taxels := pictures.taxels_of(result)) is not None:
        rows.append(("taxels, sum", f"{np.nansum(taxels):.0f} counts"))
    rows += [(f"{places.name}, most", f"{places.values.max():.4g} {places.units}") for places in pictures.places_of(result)]
    if np.isfinite(result.slipping_share[-1]):
        rows.append(("slipping", f"{result.slipping_share[-1]:.0%}"))
    if np.isfinite(error := float(result.expected_error_mm[-1])):
        rows.append(("expected error", f"{error:.3f} mm"))
    return rows


def _apart(result: PressResult, fast: Shown | None) -> str:
    """How far a fast press is from a long model's, in words; empty without two maps or two readings at places."""
    if fast is None:
        return ""
    which = f"the {'coarse' if fast.draft else fast.result.model}"
    if result.deformation_map_mm is not None and fast.result.deformation_map_mm is not None:
        rms = float(np.sqrt(((result.deformation_map_mm[-1] - fast.result.deformation_map_mm[-1]) ** 2).mean()))
        return f"; {which} map differs by {rms:.4f} mm (root mean square)"
    both = zip(pictures.places_of(result), pictures.places_of(fast.result), strict=False)
    return "".join(f"; {which} {one.name} differs by up to {np.abs(one.values - other.values).max():.4g} {one.units}"
                   for one, other in both)


def _glb(mesh: trimesh.Trimesh) -> bytes:
    return trimesh.exchange.gltf.export_glb(trimesh.Scene(mesh))

"""One tab's session: the newest state is pressed, coarse while it changes, whole and by a long model where it rests.

States that came in during a press are passed over, all but the newest. A `View` shows what is found; this module knows no page.
"""

import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from softtact.errors import InputError, SofttactError
from softtact.play.bench import LEAST_FORCE_N, Bench
from softtact.play.files import FPS, Folder
from softtact.play.long_press import LongPress
from softtact.play.pictures import board
from softtact.play.recorded import Recorded
from softtact.play.solver import Shown, Solver
from softtact.play.state import Press, State
from softtact.press.result import PressResult

_RESTS_S = 0.35         # without a change, after which the whole map follows
_LOOK_S = 0.1           # between two looks at a long press
LONGEST_S = 300.0       # of a recording


class View(Protocol):
    """What shows a session."""

    def show(self, shown: Shown) -> None:
        """Show a press."""

    def refuse(self, sentence: str) -> None:
        """Show why there is no map."""

    def tell(self, sentence: str) -> None:
        """Show what a button did, or why it did not."""

    def show_long(self, words: str, result: PressResult | None, fast: Shown | None) -> None:
        """Show the progress or the end of a long press; fast: the same press as it is shown in the scene."""

    def show_recorded(self) -> None:
        """Show the reading of a real sensor's recording at the present time."""


class Tab:
    """The session of one tab, with a thread that computes."""

    def __init__(self, state: State, view: View, folder: Folder, *, solver: Solver | None = None) -> None:
        self.solver, self._view, self._folder = solver or Solver(), view, folder
        self.state, self._changed = state, time.monotonic()
        self.long_model = ""
        """That of choice where the sensor has none of this name."""
        self.long_on_release = False
        self.shown: Shown | None = None
        self._long: LongPress | None = None
        self.long_state: State | None = None
        """Of the long press that was started last."""
        self._long_of: tuple[State, Press, PressResult] | None = None
        self._wanted: State | None = None           # for a long press
        self._released: State | None = None         # for which one was started
        self._stop_long = False
        self.held = False
        """Whether the mouse holds the object."""
        self._refused: State | None = None
        self._recording: list[tuple[float, State]] | None = None
        self._recorded: list[tuple[float, State]] = []
        self.recorded: Recorded | None = None
        """Of a real sensor."""
        self.recorded_s = 0.0
        """The time in it that is shown."""
        self._plays = threading.Event()
        self._lock, self._wake, self._closed = threading.RLock(), threading.Event(), threading.Event()
        self._preparing: set[str] = set()
        self._thread = threading.Thread(target=self._work, daemon=True, name="softtact play")

    def start(self) -> None:
        """Start the thread that computes."""
        self._thread.start()

    def close(self) -> None:
        """End the thread, and a long press with it."""
        self._closed.set()
        self._wake.set()

    def change(self, *, held: bool | None = None, **fields: Any) -> None:
        """Change fields of the state; held: whether a mouse button holds the object from now on."""
        with self._lock:
            state = replace(self.state, **fields)
            self.held = self.held if held is None else held
            if state != self.state or held is not None:
                self.state, self._changed = state, time.monotonic()
            if self._recording is not None:
                self._note(self._recording)
        self._wake.set()

    def run_long(self, model: str) -> None:
        """Press the present state with a long model."""
        models = self.solver.bench(self.state.sensor).models
        if model not in models:
            raise InputError(f"The model {model!r} is unknown; use one of {', '.join(models)}.")
        with self._lock:
            self.long_model, self._wanted, self._released = model, self.state, self.state
        self._wake.set()

    def abandon_long(self) -> None:
        """End the long press that runs."""
        with self._lock:
            self._stop_long, self._wanted = True, None
        self._wake.set()

    # --- recording ---

    @property
    def recording(self) -> bool:
        """Whether states are recorded."""
        return self._recording is not None

    def record(self) -> bool:
        """Begin to record states, or end it; return whether it records now."""
        with self._lock:
            if self._recording is None:
                self._recording = [(time.monotonic(), self.state)]
            else:
                self._note(self._recording)
                self._recorded, self._recording = self._recording, None
            return self.recording

    def _note(self, recording):
        now = time.monotonic()
        if now - recording[0][0] <= LONGEST_S:
            recording.append((now, self.state))
        else:
            self._view.tell(f"A recording takes at most {LONGEST_S:.0f} s, which have passed: what you change now is not kept. End "
                            "the recording.")

    def replay(self) -> None:
        """Play the recording in real time, in a thread of its own."""
        self._aside(self._replay)

    def _replay(self):
        recorded = self._need_recording()
        for (before, _), (now, state) in zip([recorded[0], *recorded], recorded, strict=False):
            if self._closed.wait(now - before):
                return
            self.change(**vars(state))

    def save_movie(self) -> None:
        """Write the recording as MP4, in a thread of its own."""
        self._aside(lambda: self._view.tell(f"Saved {self._folder.save_movie(self._frames(self._need_recording()))}."))

    def _need_recording(self):
        if not self._recorded:
            raise InputError("There is no recording; press Record, move the object, and press it again.")
        return self._recorded

    def _frames(self, recorded: list[tuple[float, State]]) -> Iterator[np.ndarray]:
        """Pictures of a recording at `FPS`, all as large as the first; a state without a map has that before, or else the first.

        Raises SofttactError, as the first state does, where no state has a map.
        """
        times = np.array([moment for moment, _ in recorded])
        moments = np.arange(times[0], times[-1] + 1 / FPS, 1 / FPS)
        waiting, last = 0, None     # frames before the first map
        frame: np.ndarray | None = None
        why: SofttactError | None = None
        for number, moment in enumerate(moments):
            if self._closed.is_set():
                raise InputError("The tab was closed while its movie was written; record again.")
            state = recorded[int(np.searchsorted(times, moment, side="right")) - 1][1]
            if state != last:
                last = state
                try:
                    shown = self.solver.solve(state, draft=True)
                    picture = board(shown.result, shown.clearance_mm)
                    frame = picture if frame is None else _fitted(picture, frame.shape)
                except SofttactError as error:
                    why = why or error
            if number % int(FPS) == 0:
                self._view.tell(f"Writing the movie: {number} of {len(moments)} frames.")
            if frame is None:
                waiting += 1
                continue
            for _ in range(waiting + 1):
                yield frame
            waiting = 0
        if frame is None and why is not None:
            raise why

    # --- a recording of a real sensor ---

    def take_recorded(self, recorded: Recorded) -> None:
        """Show a recording beside the press, from its beginning."""
        self._plays.clear()
        self.recorded = recorded
        self.look_at(0.0)

    def look_at(self, time_s: float) -> None:
        """Show a recording's reading at a time in s; where its force is known, press with it."""
        if self.recorded is None:
            return
        self.recorded_s = float(np.clip(time_s, 0.0, self.recorded.duration_s))
        self._view.show_recorded()
        force = self.recorded.at(self.recorded_s).force_n
        if force is not None and force >= LEAST_FORCE_N:
            self.change(load_by="force", force_n=round(force, 2))

    def play_recorded(self) -> bool:
        """Play the recording in real time from the time shown, or stop it; return whether it plays now."""
        if self._plays.is_set() or self.recorded is None:
            self._plays.clear()
            return False
        if self.recorded_s >= self.recorded.duration_s:
            self.recorded_s = 0.0
        self._plays.set()
        self._aside(lambda: self._play_recorded(self.recorded, time.monotonic() - self.recorded_s))
        return True

    def _play_recorded(self, recorded, start):
        while self._plays.is_set() and self.recorded is recorded and not self._closed.wait(1 / FPS):
            self.look_at(time.monotonic() - start)
            if self.recorded_s >= recorded.duration_s:
                self._plays.clear()
        self._view.show_recorded()

    @property
    def plays_recorded(self) -> bool:
        """Whether the recording plays."""
        return self._plays.is_set()

    # --- saving ---

    def save(self) -> None:
        """Save the present press as NetCDF and PNG, and its command line and Python lines, in a thread of its own."""
        self._aside(self._save)

    def _save(self):
        state = self.state
        shown = self.shown if self.shown and self.shown.state == state and not self.shown.draft else self.solver.solve(state)
        if shown.stage != "whole":
            raise InputError(f"This press is not whole: the {shown.press.model} model has not run for it; press Run, and save when "
                             "it has ended.")
        pressed = [(shown.press, shown.result)]
        if self._long_of and self._long_of[0] == state and self._long_of[2] is not shown.result:
            pressed.append(self._long_of[1:])
        files = self._folder.save_press(*pressed)
        self._view.tell("Saved " + ", ".join(map(str, files)) + ".")

    def _aside(self, work: Callable[[], None]) -> None:
        """Do work in a thread; what it refuses is told."""
        threading.Thread(target=lambda: self._guarded(work, self._view.tell), daemon=True).start()

    # --- the thread that computes ---

    def _work(self):
        try:
            while not self._closed.is_set():
                self._guarded(self._next_press, self._view.refuse)
                self._guarded(self._next_look, lambda sentence: self._view.show_long(sentence, None, None))
                if self._is_idle():
                    self._wake.wait(_LOOK_S)
                self._wake.clear()
        finally:
            self._end_long()

    def _guarded(self, work, refuse):
        """Do work; an error becomes a sentence, so that the page lives on."""
        try:
            work()
        except SofttactError as error:
            refuse(str(error))
        except Exception as error:     # a fault of this program: the terminal gets its place
            traceback.print_exc(file=sys.stderr)
            refuse(f"This press failed with an unexpected {type(error).__name__} ({error}); the terminal shows where.")

    def _is_idle(self):
        return self.state in (self._refused, self.shown.state if self.shown else None)

    def _next_press(self):
        """Press the newest state, coarse if it just changed; or one that rests whole, and then by a long model."""
        with self._lock:
            state, rests = self.state, not self.held and time.monotonic() - self._changed > _RESTS_S
        if state == self._refused:
            return
        if self._refused is not None and self.shown is not None and self.shown.state == state:
            self._publish(self.shown)     # in place of the sentence that refused a state between
            return
        try:
            new, bench = self.shown is None or self.shown.state != state, self.solver.bench(state.sensor)
            if new or rests and bench.refines and self.shown.draft:
                if new or self._is_ready(state.sensor):
                    self._publish(self.solver.solve(state, draft=new))
                return
        except BaseException:
            self._refused = state
            raise
        whole = self.shown.stage == "whole" and self.shown.result.model == self._long_model(bench)
        if rests and self.long_on_release and self._long is None and state != self._released and not whole:
            with self._lock:
                self._wanted = self._released = state

    def _publish(self, shown):
        self.shown, self._refused = shown, None
        if not self._closed.is_set():
            self._view.show(shown)

    def _is_ready(self, name):
        """Whether a whole press needs no preparation; else it is prepared in a thread, once."""
        bench = self.solver.bench(name)
        if not bench.is_ready and name not in self._preparing:
            self._preparing.add(name)
            self._aside(bench.prepare)
        return bench.is_ready

    def _next_look(self):
        """Start, end or look at the long press."""
        with self._lock:
            wanted, stop, self._stop_long = self._wanted, self._stop_long, False
            if wanted is not None and self._long is None:
                self._wanted = None
        if stop and self._long is not None:
            self._end_long()
            self._view.show_long("Abandoned.", None, None)
        if self._long is None:
            if wanted is not None:
                self._start_long(wanted)
            return
        if self._long.running:
            self._view.show_long(f"{self._long.press.model}, {self._long.seconds:.0f} s: {self._long.progress}", None, None)
            return
        state, long = self.long_state, self._long
        try:
            result = long.result()
            if long.stopped:
                self._view.show_long(f"{result.model}, stopped after load step {result.steps}: {long.stopped}", result, None)
                return
            self._long_of = state, long.press, result
            fast = self.solver.solve(state)
            self.solver.bench(state.sensor).take(long.press, result)
            if state == self.state and (shown := self.solver.solve(state)).result is result:
                self._publish(shown)
            self._view.show_long(f"{result.model}, {long.seconds:.0f} s", result, fast if fast.done else None)
        finally:
            self._end_long()

    def _start_long(self, state):
        self.long_state = state
        press = self.long_press(state)
        self._long = LongPress(press, self._folder.path)
        self._view.show_long(f"{press.model}: starting", None, None)

    def long_press(self, state: State) -> Press:
        """The press of a state by the long model that is chosen: with slide and twist as a motion where that model follows it.

        Raises InputError for a twist that the model does not follow.
        """
        bench, by_depth = self.solver.bench(state.sensor), state.load_by == "depth"
        model = self._long_model(bench)
        if model == "hyperelastic" and state.twist_deg:
            raise InputError("The hyperelastic model does not twist an object; set the twist to 0, or run the solid model.")
        shown = self.shown
        if shown is None or shown.state != state or shown.draft and by_depth:     # whose force is that of the coarse map
            shown = self.solver.solve(state, draft=not by_depth)
        if not state.moves or not bench.follows(model) or isinstance(shown.press.load, str):
            return replace(shown.press, model=model)
        pose = state.pose(self.solver.mesh(state.object), moved=False, middle_mm=bench.middle_mm)
        return replace(shown.press, model=model, pose=pose, load=state.motion(shown.press.load))

    def _long_model(self, bench: Bench) -> str:
        """The long model that is chosen, or else that of choice."""
        return self.long_model if self.long_model in bench.models else bench.models[0]

    def _end_long(self):
        if self._long is not None:
            self._long.close()
            self._long = None


def _fitted(frame, shape):
    """A picture cut or padded with white to a shape."""
    out = np.full(shape, 255, dtype=np.uint8)
    rows, columns = min(frame.shape[0], shape[0]), min(frame.shape[1], shape[1])
    out[:rows, :columns] = frame[:rows, :columns]
    return out

"""Recordings in ROS 2 bags: MCAP files, and rosbag2 folders with SQLite or MCAP (rosbags, extra `ros`).

Taxels are read from any message with one field of 28 or 56 numbers: those of the maker's driver (robotiq_tsf/msg/StaticData and
Sensor, github.com/robotiq/ros), std_msgs/msg/...MultiArray, tactile_msgs/msg/TactileState; 56 are finger 0, then finger 1.
Definitions of messages come from the bag, or from ROS 2's own where it has none. Forces are `force.z` of a Wrench or WrenchStamped,
or a std_msgs/msg/Float32 or Float64, in N. Readings are raw where a topic that ends with `baseline` has their baseline, or by their
size. Of several such topics that in the namespace of the taxels is theirs.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.inputs import check_input, in_one_sentence
from softtact.outputs import not_written, temporary_folder
from softtact.readout.recording import COLUMNS, LARGEST_RAW, LATE_S, ROWS, TAXELS, make_recording, running_forward, with_forces_at

if TYPE_CHECKING:
    import xarray

BAGS = (".mcap", ".db3")
FOLDER = ".rosbag2"              # ending of a folder that is written
TAXEL_TOPIC, BASELINE_TOPIC, FORCE_TOPIC = "/tactile/static_data", "/tactile/baseline", "/tactile/force"
_DEFINITIONS = {"robotiq_tsf/msg/Taxels": "uint16[28] values", "robotiq_tsf/msg/StaticData": "robotiq_tsf/Taxels[2] taxels"}
_LOW, _RAW = 0.02, 200.0         # share of a taxel's readings that is taken for rest; counts above which these are raw
_AT_REST = 10                    # first frames, whose median is the baseline of raw readings without one
_DAMAGED = "if its recording was cut off, recover it (mcap recover, ros2 bag reindex), else record it again"


def is_bag(path: str | Path) -> bool:
    """Whether a path is that of a bag, by its ending, or of a folder."""
    path = Path(path)
    return path.suffix.lower() in (*BAGS, FOLDER) or path.is_dir()


def read_bag(path: str | Path, *, baseline: str = "auto", topics: Sequence[str] = ()) -> "xarray.Dataset":
    """The recording in a bag; `notes` in its attributes say which topic, stamps and baseline were taken.

    baseline: whether readings are raw (`kept`) or over it (`subtracted`);  topics: names of the topics to read, where several fit
    Raises InputError with the bag's name and the remedy.
    """
    path = Path(path)
    with _opened(path) as bag:
        series = bag.only(_taxels, topics, "taxels (messages with 28 or 56 numbers)")
        rest = None if baseline == "subtracted" else bag.baseline_of(series, topics)
    stamps, repairs = running_forward(path, series.time_s(), range(len(series.values)), unit="s")
    values, fingers = np.array(series.values), len(series.values[0]) // TAXELS
    base, words = _baseline(values, rest, baseline)
    shape = (-1, fingers, ROWS, COLUMNS)
    made = make_recording(stamps - stamps[0], (values - base).reshape(shape), baseline=np.reshape(base, shape[1:]),
                          start_ms=round(1e3 * stamps[0]), source=f"ROS 2 bag, {series.type}", file=str(path), repairs=repairs)
    note = f"{path}: taxels are read from {series.topic} ({series.type}), times from {series.stamps}; {words}."
    return made.assign_attrs(notes=(note,), start_s=float(stamps[0]), stamps=series.stamps)


def with_force_of_bag(recording: "xarray.Dataset", path: str | Path, *, topics: Sequence[str] = ()) -> "xarray.Dataset":
    """The recording with `force_n` from a bag, by the same clock as its taxels. Raises InputError as `read_bag`."""
    path = Path(path)
    with _opened(path) as bag:
        found = bag.pair(_force, topics) or [bag.only(_force, topics, "a force (Wrench, WrenchStamped, Float32 or Float64)")]
    receive = recording.attrs.get("stamps") == RECEIVED
    start = recording.attrs.get("start_s", 1e-3 * recording.attrs["start_ms"])
    stamps, repairs = running_forward(path, found[0].time_s(receive=receive), range(len(found[0].values)), unit="s")
    _refuse_short(path, found, start + recording.time.values, receive)
    force = np.stack([np.interp(stamps, one.time_s(receive=receive), one.values) for one in found], axis=1)
    force = force if force.shape[1] == recording.sizes["finger"] else np.repeat(force[:, :1], recording.sizes["finger"], axis=1)
    names = " and ".join(one.topic for one in found)
    with_it = with_forces_at(recording, stamps - start, force, log=str(path), repairs=repairs)
    note = f"{path}: forces are read from {names} ({found[0].type}), times from {RECEIVED if receive else found[0].stamps}."
    return with_it.assign_attrs(notes=(*recording.attrs.get("notes", ()), note))


def write_bag(path: str | Path, recording: "xarray.Dataset") -> None:
    """Write a recording, with its forces if it has any, as an MCAP file (`.mcap`) or as a folder of rosbag2 (`.rosbag2`).

    Counts that fit in 16 bits with their baseline are written as the maker's driver sends them (robotiq_tsf/msg/StaticData, raw,
    and the baseline once), others as std_msgs/msg/Float32MultiArray. Forces are geometry_msgs/msg/WrenchStamped, one topic or one a
    finger. Raises InputError if the folder exists already.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    path = Path(path)
    if path.suffix.lower() == FOLDER and path.exists():
        raise InputError(f"{path}: there is already such a folder; give another name.")
    with temporary_folder(path.parent) as folder:
        single = path.suffix.lower() == ".mcap"
        bag = folder / path.stem
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP if single else StoragePlugin.SQLITE3) as writer:
            _write_messages(writer, recording)
        try:
            if single:
                with atomic_path(path) as temporary:
                    (bag / f"{path.stem}.mcap").replace(temporary)
            else:
                bag.replace(path)
        except OSError as error:
            raise not_written(path, error) from None


HEADER, RECEIVED = "the messages' headers", "the bag (time of receipt)"


@dataclass
class _Series:
    """The messages of a topic: its name and type, stamps in ns of receipt and of headers (0 without one), and values."""

    topic: str
    type: str
    received_ns: list[int]
    header_ns: list[int]
    values: list[Any]

    @property
    def stamps(self):
        """Where the times come from."""
        return HEADER if all(self.header_ns) else RECEIVED

    def time_s(self, *, receive: bool = False):
        """Times (n,) in s since 1970."""
        return 1e-9 * np.array(self.header_ns if self.stamps == HEADER and not receive else self.received_ns, dtype=float)


class _Bag:
    """The topics of an open bag."""

    def __init__(self, path, reader):
        self.path, self._reader = path, reader

    def all(self, value_of, topics):
        """The series of each topic, of `topics` if given, whose messages have a value."""
        found = []
        for connection in self._reader.connections:
            if topics and connection.topic not in topics:
                continue
            one = _Series(connection.topic, connection.msgtype, [], [], [])
            for _, received, raw in self._reader.messages(connections=[connection]):
                message = self._reader.deserialize(raw, connection.msgtype)
                value = value_of(message)
                if value is None:
                    break
                one.received_ns.append(received)
                one.header_ns.append(_header_ns(message))
                one.values.append(value)
            else:
                self._refuse_lost(connection, len(one.values))
                if one.values:
                    found.append(one)
        return found

    def _refuse_lost(self, connection, count):
        """Refuse a topic of which fewer messages could be read than the bag states."""
        if count < connection.msgcount:
            raise InputError(f"{self.path}: it states {connection.msgcount} messages of {connection.topic}, and {count} could be "
                             f"read, so it is damaged; {_DAMAGED}.")

    def only(self, value_of, topics, what):
        """The one topic that has it. Raises InputError if there is none, or more than one."""
        if not self._reader.message_count:
            raise InputError(f"{self.path}: it holds no message; record again.")
        named = [one.topic for one in self._reader.connections]
        unknown = [one for one in topics if one not in named]
        if unknown:
            raise InputError(f"{self.path}: it has no topic {unknown[0]!r}; name one of {', '.join(sorted(set(named)))} (--topic).")
        found = [one for one in self.all(value_of, ()) if not one.topic.endswith("baseline")]
        chosen = [one for one in found if one.topic in topics] or found
        if not chosen:
            raise InputError(f"{self.path}: none of its topics, {', '.join(sorted(set(named)))}, has {what}; record one that has.")
        if len(chosen) > 1:
            several = ", ".join(one.topic for one in chosen)
            raise InputError(f"{self.path}: several topics have {what}: {several}; name one (--topic).")
        if len({np.size(value) for value in chosen[0].values}) > 1:
            raise InputError(f"{self.path}: messages of {chosen[0].topic} have different numbers of values; record one sensor in a "
                             "topic.")
        return chosen[0]

    def baseline_of(self, series, topics):
        """The series of the baseline of taxels: named in `topics`, or of their namespace, or the only one; None without one.

        Raises InputError where several fit, and where the named one has another number of taxels.
        """
        topic, count = series.topic, np.size(series.values[0])
        found = [one for one in self.all(_taxels, ()) if one.topic.endswith("baseline")]
        sizes = {one.topic: np.size(one.values[0]) for one in found}
        for name in topics:
            if name.endswith("baseline") and sizes.get(name) != count:
                raise InputError(f"{self.path}: the baseline {name} has {sizes.get(name, 'other')} numbers and {topic} has "
                                 f"{count}; name the baseline of the same sensor (--topic).")
        beside = [one for one in found if one.topic.rpartition("/")[0] == topic.rpartition("/")[0]]
        chosen = {one.topic: one for one in reversed([one for one in found if one.topic in topics] or beside or found)}
        if len(chosen) > 1:
            raise InputError(f"{self.path}: several topics may have the baseline of {topic}: {', '.join(sorted(chosen))}; name one "
                             "(--topic).")
        return next(iter(chosen.values()), None)

    def pair(self, value_of, topics):
        """The two topics that end with _0 and _1, one for each finger; None if there are no such."""
        found = {one.topic: one for one in self.all(value_of, topics)}
        first = next((name for name in found if name.endswith("_0") and name[:-1] + "1" in found), None)
        return None if first is None else [found[first], found[first[:-1] + "1"]]


@contextmanager
def _opened(path) -> Iterator[_Bag]:
    """The open bag; what rosbags raises for a damaged one becomes one sentence."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    for file in _files(path):
        check_input(file, "bag", missing="there is no such bag; give an .mcap file, or the folder of a rosbag2.")
    with in_one_sentence(path, "it cannot be read as a ROS 2 bag", _DAMAGED):
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
                yield _Bag(path, reader)
        except MemoryError:     # rosbags asks for as many bytes as a damaged record states
            raise InputError(f"{path}: a record of it is longer than memory; {_DAMAGED}.") from None


def _files(path):
    """Files to check of a bag."""
    if not path.is_dir():
        return [path]
    if not (path / "metadata.yaml").exists():
        raise InputError(f"{path}: the folder has no metadata.yaml, so it is no rosbag2; give the one that ros2 bag record made.")
    return [file for file in path.iterdir() if file.is_file()]


def _header_ns(message):
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else stamp.sec * 10**9 + stamp.nanosec


def _taxels(message):
    """The 28 or 56 numbers of a message, or None: of its only field with as many."""
    for field in fields(message):
        numbers = _numbers(getattr(message, field.name))
        if numbers.size in (TAXELS, 2 * TAXELS):
            return numbers
    return None


def _numbers(value):
    """All numbers (n,) in a field, in its order."""
    if isinstance(value, np.ndarray):
        return value.astype(float) if value.dtype.kind in "iuf" else np.zeros(0)
    if isinstance(value, list):
        return np.concatenate([np.zeros(0), *map(_numbers, value)])
    if is_dataclass(value):
        return np.concatenate([np.zeros(0), *(_numbers(getattr(value, field.name)) for field in fields(value))])
    return np.zeros(0)


def _force(message):
    """The force in N of a message, or None."""
    force = getattr(getattr(message, "wrench", message), "force", None)
    if force is not None and hasattr(force, "z"):
        return float(force.z)
    data = getattr(message, "data", None)
    return float(data) if isinstance(data, float) else None


def _refuse_short(path, forces, at_s, receive):
    """Refuse a second finger's forces that begin after the first one's, or end before, within times (n,) of readings in s."""
    if len(forces) < 2:
        return
    first, second = (one.time_s(receive=receive) for one in forces)
    begin, end = max(first[0], at_s[0]), min(first[-1], at_s[-1])
    if second[0] > begin + LATE_S or second[-1] < end - LATE_S:
        (a, b), (c, d) = (second[[0, -1]] - at_s[0], np.array([begin, end]) - at_s[0])
        raise InputError(f"{path}: {forces[1].topic} has forces from {a:.4g} to {b:.4g} s after the first reading, and "
                         f"{forces[0].topic} from {c:.4g} to {d:.4g} s; record both over the whole press, or name one (--topic).")


def _baseline(values, rest, form):
    """Baseline (taxel,) to take off values (time, taxel), and words on it.  rest: series of the baseline's topic, or None"""
    if rest is not None and len(rest.values[0]) == values.shape[1]:
        return np.array(rest.values[0]), f"they are raw, and {rest.topic} has their baseline"
    low = float(np.median(np.quantile(values, _LOW, axis=0)))
    if form == "subtracted" or (form == "auto" and low < _RAW):
        return np.zeros(values.shape[1]), "they are taken to be over the baseline already"
    words = f"they are raw; the baseline is the median of the first {_AT_REST}, taken to be at rest"
    return np.round(np.median(values[:_AT_REST], axis=0)), words


def _write_messages(writer, recording):
    """Write the messages of a recording in the order of time."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    stamps = np.round(1e6 * recording.attrs["start_ms"] + 1e9 * recording.time.values).astype(np.int64)
    counts, base = recording.counts.values, recording.baseline.values
    raw = counts + base
    driver = counts.shape[1] == 2 and _of_16_bits(raw) and _of_16_bits(base)
    of_taxels = _static_data(store) if driver else _array(store)
    messages = [(TAXEL_TOPIC, stamp, of_taxels(frame)) for stamp, frame in zip(stamps, raw if driver else counts, strict=True)]
    if driver:
        messages.insert(0, (BASELINE_TOPIC, stamps[0], of_taxels(base)))
    if "force_n" in recording:
        messages += _of_forces(store, stamps, recording.force_n.values)
    connections: dict[str, Any] = {}
    for topic, stamp, message in sorted(messages, key=lambda one: one[1]):
        kind = message.__msgtype__
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], int(stamp), store.serialize_cdr(message, kind))


def _of_16_bits(raw):
    """Whether raw counts are whole numbers that the driver's message holds."""
    return (raw == np.round(raw)).all() and raw.min() >= 0 and raw.max() <= LARGEST_RAW


def _static_data(store):
    """Message of raw counts (finger, row, column) as the maker's driver sends it."""
    whole, part = store.types["robotiq_tsf/msg/StaticData"], store.types["robotiq_tsf/msg/Taxels"]
    return lambda frame: whole(taxels=[part(values=finger.ravel().astype(np.uint16)) for finger in frame])


def _array(store):
    """Message of counts (finger, row, column) as an array."""
    whole, layout = store.types["std_msgs/msg/Float32MultiArray"], store.types["std_msgs/msg/MultiArrayLayout"]
    return lambda frame: whole(layout=layout(dim=[], data_offset=0), data=frame.ravel().astype(np.float32))


def _of_forces(store, stamps, force):
    """(topic, stamp, message) of forces (time, finger), one topic if they are equal."""
    types = {name: store.types[f"{package}/msg/{name}"] for package, name in (
        ("geometry_msgs", "WrenchStamped"), ("geometry_msgs", "Wrench"), ("geometry_msgs", "Vector3"), ("std_msgs", "Header"),
        ("builtin_interfaces", "Time"))}
    nothing = types["Vector3"](x=0.0, y=0.0, z=0.0)
    both = force.shape[1] == 1 or (force[:, 0] == force[:, 1]).all()
    for finger in range(1 if both else 2):
        topic = FORCE_TOPIC if both else f"{FORCE_TOPIC}_{finger}"
        for stamp, value in zip(stamps.tolist(), force[:, finger].tolist(), strict=True):
            header = types["Header"](stamp=types["Time"](sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id=f"finger_{finger}")
            wrench = types["Wrench"](force=types["Vector3"](x=0.0, y=0.0, z=value), torque=nothing)
            yield topic, stamp, types["WrenchStamped"](header=header, wrench=wrench)

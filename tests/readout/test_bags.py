"""Recordings in ROS 2 bags: what is written is read back; topics, stamps and damage are told."""

import numpy as np
import pytest
from support.sound_recordings import ramp

from softtact.errors import InputError
from softtact.readout.bags import read_bag, with_force_of_bag, write_bag
from softtact.readout.sources import with_force_of

rosbags = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")


@pytest.fixture
def press():
    return ramp().recording().isel(time=slice(30, 120)).assign_attrs(start_ms=1_764_000_000_123)


@pytest.mark.parametrize("name", ["r.mcap", "r.rosbag2"])
def test_what_is_written_is_read_back(tmp_path, press, name):
    write_bag(tmp_path / name, press)
    again = with_force_of_bag(read_bag(tmp_path / name), tmp_path / name)
    assert (again.counts.values == press.counts.values).all() and (again.baseline.values == press.baseline.values).all()
    assert again.force_n.values == pytest.approx(press.force_n.values)
    assert again.time.values == pytest.approx(press.time.values - press.time.values[0], abs=1e-6)
    assert "/tactile/static_data (robotiq_tsf/msg/StaticData), times from the bag (time of receipt)" in again.attrs["notes"][0]


def test_forces_of_each_finger_have_a_topic_each(tmp_path, press):
    press.force_n[:, 1] = 0.5 * press.force_n[:, 1] + 1
    write_bag(tmp_path / "r.mcap", press)
    again = with_force_of_bag(read_bag(tmp_path / "r.mcap"), tmp_path / "r.mcap")
    assert again.force_n.values == pytest.approx(press.force_n.values)


@pytest.mark.parametrize("base", [-3.0, 0.5])
def test_counts_over_a_baseline_that_the_driver_s_message_does_not_hold_are_kept_as_an_array(tmp_path, press, base):
    press = press.assign(baseline=press.baseline * 0 + base, counts=press.counts - press.counts.min() + 5 - base)
    write_bag(tmp_path / "r.mcap", press)
    again = read_bag(tmp_path / "r.mcap", baseline="subtracted")
    assert again.counts.values == pytest.approx(press.counts.values)


def test_counts_that_are_not_whole_are_kept_as_an_array(tmp_path, press):
    press = press.assign(counts=press.counts + 0.5)
    write_bag(tmp_path / "r.mcap", press)
    again = read_bag(tmp_path / "r.mcap")
    assert again.counts.values == pytest.approx(press.counts.values) and "Float32MultiArray" in again.attrs["notes"][0]


def bag_of(path, messages, *, definitions=()):
    """An MCAP file of (topic, type, time in ns, function of the types)."""
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, text in definitions:
        store.register(typesys.get_types_from_msg(text, name))
    with rosbags.Writer(path.with_suffix(""), version=9, storage_plugin=rosbags.StoragePlugin.MCAP) as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in
                       dict.fromkeys((topic, kind) for topic, kind, _, _ in messages)}
        for topic, kind, time, made in messages:
            writer.write(connections[topic], time, store.serialize_cdr(made(store.types), kind))
    (path.with_suffix("") / path.name).rename(path)
    return path


def array(values):
    return lambda types: types["std_msgs/msg/Int32MultiArray"](
        layout=types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0), data=np.asarray(values, np.int32))


def test_any_message_with_as_many_numbers_is_read_and_its_own_stamps_are_taken(tmp_path):
    def message(stamp):
        return lambda types: types["lab_msgs/msg/Pad"](
            header=types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=stamp, nanosec=5), frame_id="pad"),
            gain=np.ones(3), cells=np.arange(28, dtype=np.int16) + 100 * stamp)

    definition = ("lab_msgs/msg/Pad", "std_msgs/Header header\nfloat64[3] gain\nint16[28] cells")
    path = bag_of(tmp_path / "pad.mcap", [("/pad", "lab_msgs/msg/Pad", 10**9 + k, message(k + 1)) for k in range(3)],
                  definitions=[definition])
    one = read_bag(path, baseline="subtracted")
    assert one.counts.shape == (3, 1, 7, 4) and one.counts.values[2, 0, 1, 1] == 305
    assert one.time.values == pytest.approx([0, 1, 2]) and "times from the messages' headers" in one.attrs["notes"][0]


def test_raw_readings_without_a_baseline_take_that_of_the_first_frames(tmp_path):
    frames = [9000 + np.arange(56) + (500 if k > 20 else 0) for k in range(40)]
    one = read_bag(bag_of(tmp_path / "raw.mcap", [("/t", "std_msgs/msg/Int32MultiArray", 10**7 * (k + 1), array(frame))
                                                  for k, frame in enumerate(frames)]))
    assert (one.baseline.values.ravel() == frames[0]).all() and set(np.unique(one.counts.values)) == {0, 500}
    assert "the baseline is the median of the first 10" in one.attrs["notes"][0]


def test_several_topics_are_told_and_one_is_named(tmp_path):
    path = bag_of(tmp_path / "two.mcap", [(topic, "std_msgs/msg/Int32MultiArray", k + 1, array([k] * 28))
                                          for k in range(3) for topic in ("/left", "/right")])
    with pytest.raises(InputError, match=r"two.mcap: several topics have taxels .*: /left, /right; name one \(--topic\)"):
        read_bag(path)
    assert "/right" in read_bag(path, topics=["/right"]).attrs["notes"][0]
    with pytest.raises(InputError, match="it has no topic '/up'; name one of /left, /right"):
        read_bag(path, topics=["/up"])
    with pytest.raises(InputError, match="none of its topics, /left, /right, has a force"):
        with_force_of(read_bag(path, topics=["/left"]), path)


def bag_with_baselines(path, **baselines):
    """Two sensors that read 9,100 counts, and baselines {topic: counts}, with __ in place of /."""
    topics = {"/left/data": 9100, "/right/data": 9100} | {name.replace("__", "/"): counts for name, counts in baselines.items()}
    return bag_of(path, [(topic, "std_msgs/msg/Int32MultiArray", k + 1, array([counts] * 28))
                         for k in range(3) for topic, counts in topics.items()])


@pytest.mark.parametrize(("baselines", "topics", "counts", "taken"), [
    ({"__left__baseline": 9000, "__right__baseline": 9050}, ["/right/data"], 50, "/right/baseline"),
    ({"__left__baseline": 9000, "__right__baseline": 9050}, ["/left/data"], 100, "/left/baseline"),
    ({"__left__baseline": 9000, "__right__baseline": 9050}, ["/left/data", "/right/baseline"], 50, "/right/baseline"),
    ({"__rest__baseline": 9020}, ["/right/data"], 80, "/rest/baseline")])
def test_of_several_baselines_that_of_the_topic_read_is_taken_off_and_named(tmp_path, baselines, topics, counts, taken):
    one = read_bag(bag_with_baselines(tmp_path / "b.mcap", **baselines), topics=topics)
    assert (one.counts.values == counts).all() and f"{taken} has their baseline" in one.attrs["notes"][0]


def test_baselines_of_which_none_is_that_of_the_topic_read_are_told_and_one_is_named(tmp_path):
    path = bag_with_baselines(tmp_path / "b.mcap", __a__baseline=9000, __b__baseline=9050)
    with pytest.raises(InputError, match=r"the baseline of /left/data: /a/baseline, /b/baseline; name one \(--topic\)"):
        read_bag(path, topics=["/left/data"])
    assert (read_bag(path, topics=["/left/data", "/b/baseline"]).counts.values == 50).all()
    assert (read_bag(path, topics=["/left/data"], baseline="subtracted").counts.values == 9100).all()


@pytest.mark.parametrize(("count", "words"), [(56, "56"), (3, "other")])
def test_a_named_baseline_of_another_number_of_taxels_is_refused_with_both_topics(tmp_path, count, words):
    kind = "std_msgs/msg/Int32MultiArray"
    path = bag_of(tmp_path / "b.mcap", [("/pair/baseline", kind, 1, array([9000] * count)),
                                        *(("/one/data", kind, k + 1, array([9100] * 28)) for k in range(3))])
    with pytest.raises(InputError, match=rf"the baseline /pair/baseline has {words} numbers and /one/data has 28; .*\(--topic\)"):
        read_bag(path, topics=["/one/data", "/pair/baseline"])


@pytest.mark.parametrize(("kept", "sentence"), [
    (slice(0, 31), r"/force_1 has forces from 0 to 0.3 s after the first reading, and /force_0 from 0 to 0.5 s"),
    (slice(20, 51), r"/force_1 has forces from 0.2 to 0.5 s after the first reading, and /force_0 from 0 to 0.5 s"),
    (slice(3, 49), None)])
def test_forces_of_the_second_finger_that_end_early_or_begin_late_are_not_held(tmp_path, kept, sentence):
    """Rows are 0.01 s apart; 0.05 s are allowed, as of the first finger."""
    stamps = [10**9 + 10**7 * k for k in range(51)]
    taxels = [("/t", "std_msgs/msg/Int32MultiArray", stamp, array([k] * 56)) for k, stamp in enumerate(stamps)]
    forces = [(topic, "std_msgs/msg/Float64", stamp, lambda types: types["std_msgs/msg/Float64"](data=1.0))
              for topic, rows in (("/force_0", slice(None)), ("/force_1", kept)) for stamp in stamps[rows]]
    path = bag_of(tmp_path / "f.mcap", taxels + forces)
    recording = read_bag(path, baseline="subtracted")
    if sentence is None:
        assert (with_force_of_bag(recording, path).force_n.values == 1).all()
        return
    with pytest.raises(InputError, match=sentence):
        with_force_of_bag(recording, path)


@pytest.mark.parametrize(("change", "sentence"), [
    (lambda raw: b"", "seems to be empty"),
    (lambda raw: raw[:len(raw) // 2], "File end magic is invalid"),
    (lambda raw: b"PK" + raw[2:], "File magic is invalid"),
    (lambda raw: raw[:400] + bytes(200) + raw[600:], "could be read, so it is damaged"),
])
def test_a_damaged_file_is_refused_in_one_sentence(tmp_path, press, change, sentence):
    write_bag(tmp_path / "r.mcap", press)
    (tmp_path / "r.mcap").write_bytes(change((tmp_path / "r.mcap").read_bytes()))
    with pytest.raises(InputError, match="recover") as refused:
        read_bag(tmp_path / "r.mcap")
    assert sentence in str(refused.value) and str(refused.value).count("r.mcap") <= 2


def test_a_bag_without_a_message_is_refused(tmp_path):
    with rosbags.Writer(tmp_path / "empty", version=9) as writer:
        writer.add_connection("/t", "std_msgs/msg/Int32MultiArray", typestore=typesys.get_typestore(typesys.Stores.ROS2_HUMBLE))
    with pytest.raises(InputError, match="empty: it holds no message; record again"):
        read_bag(tmp_path / "empty")
    (tmp_path / "empty" / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="has no metadata.yaml, so it is no rosbag2"):
        read_bag(tmp_path / "empty")


def test_another_compression_is_named(tmp_path, monkeypatch):
    path = bag_of(tmp_path / "c.mcap", [("/t", "std_msgs/msg/Int32MultiArray", 1, array([0] * 28))])
    monkeypatch.delitem(pytest.importorskip("rosbags.rosbag2.storage_mcap").DECOMPRESSORS, "")
    with pytest.raises(InputError, match="Unsupported chunk compression"):
        read_bag(path)

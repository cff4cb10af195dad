"""Data sets in LeRobot's format v3.0, as its package loads them (tried with lerobot 0.4.4): extra `lerobot`.

    meta/info.json                                 features with their shapes, numbers of frames, paths
    meta/stats.json                                least, largest, mean, deviation and quantiles of each feature over all frames
    meta/tasks.parquet                             task_index of each task
    meta/episodes/chunk-000/file-000.parquet       of each episode: its frames, tasks, place in the files, statistics
    data/chunk-000/file-000.parquet                a row for each frame
    videos/KEY/chunk-000/file-000.mp4              pictures of all frames of a key, one episode after the other

Statistics over all frames are put together from those of the episodes as LeRobot does it: its quantiles are means of theirs.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softtact.imaging.movies import write_movie

VERSION = "v3.0"
FPS = 10      # of the timestamps: 0.1 s between two forces, assumed because a press is quasi-static
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_FIRST = _FILE.format(chunk_index=0, file_index=0)
_VIDEO = {"g": "2", "bf": "0", "crf": "18"}     # a key frame at every second frame: single frames are found quickly

Block = Mapping[str, np.ndarray]


def write_lerobot(folder: Path, blocks: Callable[[], Iterable[Block]], *, length: int, tasks: Sequence[str],
                  names: Mapping[str, Any], videos: Sequence[str], robot: str) -> None:
    """Write a data set into an empty folder.

    blocks: gives the rows of whole episodes by key, again at each call; those of `videos` are pictures (n, height, width, 3) uint8
    length: frames of an episode;  tasks: words for each task_index;  names: of the entries of each key's last axes, or None
    """
    import pandas
    import pyarrow
    from pyarrow import parquet

    data, meta = folder / f"data/{_FIRST}.parquet", folder / "meta"
    for path in (data, meta / f"episodes/{_FIRST}.parquet"):
        path.parent.mkdir(parents=True)
    episodes: list[dict[str, Any]] = []
    features: dict[str, Any] = {}
    writer = None
    try:
        for block in blocks():
            features = features or {key: _feature(key, values, names.get(key), key in videos) for key, values in block.items()}
            table = pyarrow.table({key: _column(pyarrow, block[key]) for key in features if key not in videos})
            writer = writer or parquet.ParquetWriter(data, table.schema)
            writer.write_table(table)
            episodes += _episodes(block, len(episodes), length, tasks, videos)
    finally:
        if writer is not None:
            writer.close()
    for key in videos:
        path = folder / f"videos/{key}/{_FIRST}.mp4"
        path.parent.mkdir(parents=True)
        write_movie(path, (picture for block in blocks() for picture in block[key]), fps=FPS, options=_VIDEO)
    parquet.write_table(pyarrow.Table.from_pylist(episodes), meta / f"episodes/{_FIRST}.parquet")
    pandas.DataFrame({"task_index": range(len(tasks))}, index=pandas.Index(tasks, dtype=object)).to_parquet(meta / "tasks.parquet")
    info = {"codebase_version": VERSION, "robot_type": robot, "total_episodes": len(episodes),
            "total_frames": length * len(episodes), "total_tasks": len(tasks), "chunks_size": 1000, "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200, "fps": FPS, "splits": {"train": f"0:{len(episodes)}"},
            "data_path": f"data/{_FILE}.parquet", "video_path": f"videos/{{video_key}}/{_FILE}.mp4", "features": features}
    for name, content in (("info", info), ("stats", _of_all(episodes, features))):
        (meta / f"{name}.json").write_text(json.dumps(content, indent=4), encoding="utf-8")


def _feature(key, values, names, video):
    """Entry of a key in info.json."""
    shape = list(values.shape[1:]) or [1]
    if not video:
        return {"dtype": str(values.dtype), "shape": shape, "names": names}
    return {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"],
            "info": {"video.height": shape[0], "video.width": shape[1], "video.codec": "h264", "video.pix_fmt": "yuv420p",
                     "video.is_depth_map": False, "video.fps": FPS, "video.channels": 3, "has_audio": False}}


def _column(pyarrow, values):
    """Rows of numbers, or of lists of them as deep as they have axes; a last axis of one is none."""
    values = values[:, 0] if values.shape[1:] == (1,) else values
    column = pyarrow.array(values.ravel())
    for size in values.shape[:0:-1]:
        column = pyarrow.ListArray.from_arrays(np.arange(0, len(column) + 1, size, dtype=np.int32), column)
    return column


def _episodes(block, first, length, tasks, videos):
    """Rows of the episodes of a block in meta/episodes, the first of which has the number `first`."""
    for number in range(len(block["index"]) // length):
        rows = slice(number * length, (number + 1) * length)
        episode = first + number
        begin = episode * length
        row = {"episode_index": episode, "tasks": [tasks[block["task_index"][rows][0]]], "length": length,
               "data/chunk_index": 0, "data/file_index": 0, "dataset_from_index": begin, "dataset_to_index": begin + length,
               "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        for key in videos:
            row |= {f"videos/{key}/chunk_index": 0, f"videos/{key}/file_index": 0,
                    f"videos/{key}/from_timestamp": begin / FPS, f"videos/{key}/to_timestamp": (begin + length) / FPS}
        for key, values in block.items():
            row |= {f"stats/{key}/{name}": number for name, number in _statistics(values[rows], key in videos).items()}
        yield row


def _statistics(values, video):
    """Statistics of the frames of an episode by name; of a video for each colour, as (3, 1, 1) and in 0 to 1."""
    frames = values[:, None] if values.ndim == 1 else values
    data = frames.reshape(-1, 3) / 255 if video else frames.astype(float)
    found = {"min": data.min(axis=0), "max": data.max(axis=0), "mean": data.mean(axis=0), "std": data.std(axis=0),
             **dict(zip(_QUANTILES, np.quantile(data, list(_QUANTILES.values()), axis=0), strict=True))}
    return {name: (one.reshape(3, 1, 1) if video else one).tolist() for name, one in found.items()} | {"count": [len(frames)]}


def _of_all(episodes, features):
    """Statistics over all episodes by key and name."""
    return {key: _together({name: np.array([row[f"stats/{key}/{name}"] for row in episodes], dtype=float)
                            for name in ("min", "max", "mean", "std", "count", *_QUANTILES)}) for key in features}


def _together(of):
    """Statistics of all from those {name: (episode, ...)} of episodes."""
    counts = of["count"].reshape(-1, *[1] * (of["mean"].ndim - 1))
    share = counts / counts.sum()
    mean = (share * of["mean"]).sum(axis=0)
    variance = (share * (of["std"] ** 2 + (of["mean"] - mean) ** 2)).sum(axis=0)
    found = {"min": of["min"].min(axis=0), "max": of["max"].max(axis=0), "mean": mean, "std": np.sqrt(variance),
             **{name: (share * of[name]).sum(axis=0) for name in _QUANTILES}}
    return {name: one.tolist() for name, one in found.items()} | {"count": [int(of["count"].sum())]}


def same_as(folder: Path, blocks: Iterable[Block], videos: Sequence[str]) -> bool:
    """Whether the rows of a data set, and the number of its pictures, are those of the blocks."""
    import av
    from pyarrow import parquet

    table, first = parquet.read_table(folder / f"data/{_FIRST}.parquet"), 0
    for block in blocks:
        last = first + len(block["index"])
        for key, values in block.items():
            if key not in videos:
                found = np.array(table.column(key)[first:last].to_pylist(), dtype=values.dtype).reshape(values.shape)
                if found.tobytes() != values.tobytes():
                    return False
        first = last
    pictures = []
    for key in videos:
        with av.open(str(folder / f"videos/{key}/{_FIRST}.mp4")) as container:
            pictures.append(sum(1 for _ in container.decode(video=0)))
    return first == len(table) and all(count == first for count in pictures)

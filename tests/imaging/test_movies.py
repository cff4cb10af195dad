"""Movies: frames, size and time, and names that are refused."""

import numpy as np
import pytest
from PIL import Image

from softtact.errors import InputError
from softtact.imaging.movies import check_movie, write_movie

FRAMES = [np.full((24, 33, 3), level, dtype=np.uint8) for level in (10, 120, 230)]


def test_a_gif_holds_every_frame_for_its_time(tmp_path):
    write_movie(tmp_path / "a.gif", FRAMES, fps=4)
    with Image.open(tmp_path / "a.gif") as movie:
        assert (movie.n_frames, movie.size, movie.info["duration"]) == (3, (33, 24), 250)
        movie.seek(2)
        assert np.asarray(movie.convert("RGB"))[5, 5].tolist() == [230, 230, 230]


def test_an_mp4_holds_every_frame_without_the_odd_column(tmp_path):
    av = pytest.importorskip("av")
    write_movie(tmp_path / "a.mp4", FRAMES, fps=5)
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 5
    assert [frame.shape for frame in frames] == 3 * [(24, 32, 3)]
    assert [int(frame.mean()) for frame in frames] == pytest.approx([10, 120, 230], abs=4)


def test_another_ending_is_refused():
    with pytest.raises(InputError, match="clip.avi: the file is written as .mp4 or .gif"):
        check_movie("clip.avi")


def test_nothing_half_written_is_left_of_a_movie_that_fails(tmp_path):
    def broken():
        yield FRAMES[0]
        raise RuntimeError("no more frames")

    with pytest.raises(RuntimeError):
        write_movie(tmp_path / "a.gif", broken(), fps=4)
    assert not list(tmp_path.iterdir())

"""Files of the page: one folder, nothing overwritten, uploads with safe names and a limit."""

import pytest

from softtact.errors import InputError
from softtact.play.files import Folder


@pytest.mark.parametrize("name, kept", [("../../etc/part.stl", "part.stl"), ("C:\\x\\my part (2).STL", "my_part_2_.STL"),
                                        (".hidden.stl", "hidden.stl"), ("ä\x00b.obj", "b.obj"),
                                        ("a" * 300 + ".ply", "a" * 76 + ".ply"), ("x." + "y" * 75 + ".stl", "y" * 75 + ".stl")])
def test_an_upload_is_kept_in_the_folder_under_a_safe_name(tmp_path, name, kept):
    path = Folder(tmp_path / "out").keep_upload(name, b"solid")
    assert path == tmp_path / "out/uploads" / kept and path.read_bytes() == b"solid"


def test_an_upload_overwrites_none_of_another_content_and_is_kept_once(tmp_path):
    folder = Folder(tmp_path)
    paths = [folder.keep_upload("part.stl", content) for content in (b"one", b"two", b"one", b"two")]
    assert [path.name for path in paths] == ["part.stl", "part_2.stl", "part.stl", "part_2.stl"]
    assert (tmp_path / "uploads/part.stl").read_bytes() == b"one"


def test_an_upload_over_the_limit_or_without_an_ending_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTTACT_LIMITS", "0.00000001")
    with pytest.raises(InputError, match="part.stl: it has .* limit"):
        Folder(tmp_path).keep_upload("part.stl", b"0123456789")
    with pytest.raises(InputError, match="has no ending"):
        Folder(tmp_path).keep_upload("..", b"0")
    assert not list(tmp_path.iterdir())


def test_a_movie_that_fails_leaves_no_file(tmp_path):
    pytest.importorskip("av")

    def frames():
        raise InputError("no frames.")
        yield

    with pytest.raises(InputError, match="no frames"):
        Folder(tmp_path).save_movie(frames())
    assert not list(tmp_path.iterdir())

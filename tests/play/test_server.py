"""The server of the page: on this machine alone, nothing from elsewhere, no tunnel, no other site; and the page in Chromium."""

import io
import re
import shutil
import socket
import time
import urllib.request
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image
from support.chromium import Chromium

viser = pytest.importorskip("viser")
from viser import _messages  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

from softtact.cli import main  # noqa: E402
from softtact.play.page import _refused  # noqa: E402
from softtact.play.server import PlayServer, _limit_uploads  # noqa: E402

needs_browser = pytest.mark.skipif(not shutil.which("chromium"), reason="Chromium is not installed")


@pytest.fixture
def server(state, folder, tmp_path):
    """One that serves the ball on the small sensor."""
    one = PlayServer(state, {"ball": state.object}, [state.sensor, str(folder / "gel.yaml")], tmp_path / "out", port=0)
    yield one
    one.stop()


def test_the_page_is_served_to_this_machine_alone_and_loads_nothing_from_elsewhere(server):
    with urllib.request.urlopen(server.url) as answer:
        page = answer.read().decode()
    assert set(re.findall(r"https?://[\w./-]+", page)) <= {"http://www.w3.org/2000/svg"}      # a name space, no address
    others = {entry[4][0] for entry in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in others | {"127.0.0.2"}:
        with pytest.raises(OSError):
            socket.create_connection((address, server.port), timeout=1).close()


def test_no_tunnel_can_be_asked_for(server):
    handlers = server._server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers and _messages.ShareUrlDisconnect not in handlers


@pytest.mark.parametrize("origin, stays", [("http://elsewhere.example", False), (None, True), ("own", True)])
def test_a_page_of_another_site_gets_no_connection(server, origin, stays):
    address = server.url.replace("http", "ws")
    with connect(address, origin=server.url if origin == "own" else origin, max_size=None,
                 subprotocols=[f"viser-v{viser.__version__}"]) as socket_:
        if stays:
            socket_.recv(timeout=10)
        else:
            with pytest.raises(ConnectionClosed) as closed:
                for _ in range(100):
                    socket_.recv(timeout=10)
            assert closed.value.rcvd.code == 1008


def test_an_upload_over_the_limit_is_not_taken_into_memory(monkeypatch):
    monkeypatch.setenv("SOFTTACT_LIMITS", "0.00001")      # 3 kB
    started, handlers, told = [], {}, []

    class Client:
        class gui:
            _current_file_upload_states = {"an earlier one": {}}
            _handle_file_transfer_start = staticmethod(lambda number, message: started.append(message.size_bytes))

            class _websock_interface:
                unregister_handler = staticmethod(lambda kind: None)
                register_handler = staticmethod(handlers.__setitem__)

        add_notification = staticmethod(lambda title, body, **_: told.append(body))

    _limit_uploads(Client)
    for size in (5000, 2000):
        handlers[_messages.FileTransferStartUpload](0, _messages.FileTransferStartUpload("button", "id", "part.stl", "", 1, size))
    assert started == [2000] and "part.stl" in told[0] and not Client.gui._current_file_upload_states


def test_a_refused_press_says_whose_the_scene_is(state):
    assert _refused("It misses.", None) == "**No map.** It misses."
    before = SimpleNamespace(state=replace(state, sensor="gelsight_mini"))
    assert "the press before, on gelsight\\_mini." in _refused("It misses.", before)


def test_what_cannot_be_played_is_refused_before_the_server_starts(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("softtact.play.server.PlayServer", lambda *_, **__: pytest.fail("the server started"))
    (tmp_path / "solid.yaml").write_text((folder / "block.yaml").read_text().replace("block.vtu", "nowhere.vtu"))
    (tmp_path / "layers.yaml").write_text((folder / "gel.yaml").read_text().replace("gel_silicone", "unobtainium"))
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    for arguments, words in ((["--port", "99999"], "--port 99999"), (["broken.stl", "--unit", "mm"], "broken.stl"),
                             (["--sensor", "nowhere"], "no sensor"), (["--out", "broken.stl"], "broken.stl"),
                             (["--sensor", "solid.yaml"], "nowhere.vtu"), (["--sensor", "layers.yaml"], "unobtainium"),
                             (["--unit", "inch"], "--unit inch: it is the unit of the meshes that are given; add MESH")):
        assert main(["play", "--no-open", *arguments]) == 1
        said = capsys.readouterr().err
        assert words in said and said.count("\n") == 1


@needs_browser
@pytest.mark.slow
def test_a_broken_mesh_is_told_in_its_sentence_and_the_page_lives_on(server, tmp_path):
    (tmp_path / "broken_1_a.stl").write_bytes(b"solid x\nfacet nothing\n")
    trimesh.creation.torus(6, 2).export(tmp_path / "ring.stl")
    with Chromium(server.url) as tab:
        tab.wait_for_text("whole")
        tab.upload(tmp_path / "broken_1_a.stl")
        tab.wait_for_text("No map. " + str(tmp_path / "out/uploads/broken_1_a.stl"))
        tab.upload(tmp_path / "ring.stl")
        tab.wait_for_text(f"softtact press {tmp_path / 'out/uploads/ring.stl'}")
    assert {path.name for path in (tmp_path / "out/uploads").iterdir()} == {"broken_1_a.stl", "ring.stl"}


@needs_browser
@pytest.mark.slow
def test_two_tabs_press_by_keys_and_each_has_its_own_press(server):
    with Chromium(server.url) as one, Chromium(server.url, width=400, height=800) as other:
        for tab in (one, other):
            tab.wait_for_text("whole")
        for _ in range(4):
            one.key("L")
        one.wait_for_text("--pose=-1,2,")
        assert "--pose=-3,2," in other.text
        picture = np.asarray(Image.open(io.BytesIO(one.screenshot())).convert("RGB")).astype(int)
        scene = picture[100:, :900]
        assert (np.abs(scene - 255).sum(axis=2) > 60).mean() > 0.05      # the sensor and the object are drawn
        assert all(url.startswith((server.url, "data:", f"blob:{server.url}")) for url in one.asked_for)
        one.click("Save press")
        one.wait_for_text("Saved ")
        assert len(server.pages) == 2
    for _ in range(100):
        if not server.pages:
            return
        time.sleep(0.1)
    pytest.fail("the closed tabs are still there")


@needs_browser
@pytest.mark.slow
@pytest.mark.parametrize("name, before, load", [("skin", "This press is coarse", "0.2"), ("block", "The object only touches", "1")])
def test_a_skin_or_a_solid_is_moved_by_keys_pressed_where_it_rests_and_saved(state, folder, tmp_path, name, before, load):
    start = replace(state, sensor=str(folder / f"{name}.yaml"), force_n=float(load))
    server = PlayServer(start, {"ball": state.object}, [start.sensor], tmp_path / "out", port=0)
    try:
        with Chromium(server.url, width=400, height=800) as tab:
            tab.wait_for_text(before)
            pose = server.pages[0].tab.shown.press.pose
            tab.key("L")
            tab.wait_for_text(f"--pose={pose[0] + 0.5:g},")
            tab.wait_for_text("whole, ", tries=2000)      # after the press of the first place
            assert before not in tab.text and f"--force {load}" in tab.text
            tab.click("Save press")
            tab.wait_for_text("Saved ")
    finally:
        server.stop()
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".nc", ".png", ".txt"}

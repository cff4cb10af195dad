"""The server of the page: on this machine alone, without tunnels, with a limit on uploads; a `Page` for each tab."""

import contextlib
import io
import threading
import warnings
from pathlib import Path
from typing import Any

import viser
from viser import _messages  # those of uploads and of the tunnel, which viser handles by default

from softtact.inputs import limit
from softtact.play.files import Folder
from softtact.play.page import Page
from softtact.play.recorded import Recorded
from softtact.play.state import Object, State

HOST = "127.0.0.1"


class PlayServer:
    """Serves the page until `stop`."""

    def __init__(self, state: State, objects: dict[str, Object], sensors: list[str], folder: Path, *, port: int,
                 recorded: Recorded | None = None) -> None:
        """Serve on a port, or the next free one; 0 takes any.

        objects: what the page offers, by name;  state: of a new tab;  recorded: of a real sensor, beside the press
        """
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)     # a tab was closed during a press
        self._folder = Folder(folder)
        self._pages: dict[int, Page] = {}
        self._lock = threading.Lock()
        with contextlib.redirect_stdout(io.StringIO()):     # viser's banner, which names no address to open
            self._server = viser.ViserServer(host=HOST, port=port, verbose=False)
        sockets: Any = self._server._websock_server
        for kind in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            sockets.unregister_handler(kind)
        sockets.on_client_connect(self._check_origin)
        self._server.on_client_connect(lambda client: self._open(client, state, objects, sensors, recorded))
        self._server.on_client_disconnect(self._close)

    @property
    def port(self) -> int:
        """The port that is served."""
        return self._server.get_port()

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://{HOST}:{self.port}"

    @property
    def pages(self) -> list[Page]:
        """Those of the open tabs."""
        with self._lock:
            return list(self._pages.values())

    def stop(self) -> None:
        """End the server and what its tabs compute."""
        for page in self.pages:
            page.tab.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    async def _check_origin(self, connection: Any) -> None:
        """Close the connection of a page of another site, which a browser lets connect to this machine."""
        live: Any = self._server._websock_server._live_connections[connection.client_id]
        origin = live.request.headers.get("Origin")
        if origin not in (None, *(f"http://{host}:{self.port}" for host in (HOST, "localhost"))):
            await live.close(1008, "other site")

    def _open(self, client, state, objects, sensors, recorded):
        _limit_uploads(client)
        page = Page(client, state, objects, sensors, self._folder, recorded)
        with self._lock:
            self._pages[client.client_id] = page
        if client.client_id not in self._server.get_clients():     # closed meanwhile
            self._close(client)

    def _close(self, client):
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.tab.close()


def _limit_uploads(client: viser.ClientHandle) -> None:
    """Take no upload over the limit of meshes, and one at a time: viser would keep all of it in memory."""
    gui: Any = client.gui
    connection, started = gui._websock_interface, gui._handle_file_transfer_start

    def start(number: Any, message: Any) -> None:
        if message.size_bytes > limit("mesh"):
            client.add_notification("The file is too large", f"{message.filename}: it has {message.size_bytes / 1e6:.0f} MB, and "
                                    f"the limit of a mesh file is {limit('mesh') / 1e6:.0f} MB; give a smaller one.", color="red")
            return
        gui._current_file_upload_states.clear()
        started(number, message)

    connection.unregister_handler(_messages.FileTransferStartUpload)
    connection.register_handler(_messages.FileTransferStartUpload, start)

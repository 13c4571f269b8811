"""Serves the page: its files, its connections, drawings and recordings. Everything here runs in one thread; calls
that wait run in others."""

import asyncio
import json
import pathlib

from aiohttp import WSMsgType, web

from .errors import Refusal
from .recordings import Recordings
from .threads import in_thread

PAGE = pathlib.Path(__file__).resolve().parent / "page"
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
                               "img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
MOST_STRANGERS = 16  # connections that have not shown the token yet
MOST_CONNECTIONS = 128
LOGIN = 5.0  # [s] for the token, on a new connection
ALIVE = 4.0  # [s] between two pings; a page that misses one is gone
LARGEST_MESSAGE = 4096  # [bytes]
LARGEST_REQUEST = 4 << 20  # [bytes] a drawing
FORBIDDEN = 4403  # the code with which a socket ends after a wrong token
CHUNK = 1 << 18  # [bytes] of a recording


class Server:
    """The addresses of the page."""

    def __init__(self, panel):
        self._panel = panel
        self._strangers = []  # connections that have not shown the token yet
        self._files = {file.name: file.read_bytes() for file in PAGE.iterdir()}
        self.application = web.Application(client_max_size=LARGEST_REQUEST, middlewares=[self._guard])
        self.application.router.add_get("/", self._file)
        self.application.router.add_get("/socket", self._socket)
        self.application.router.add_post("/drawing", self._read_drawing)
        self.application.router.add_get("/drawing", self._drawing)
        self.application.router.add_get("/recordings", self._recordings)
        self.application.router.add_get("/recordings/{name}", self._recording)
        self.application.router.add_get("/{name}", self._file)

    @web.middleware
    async def _guard(self, request, handler):
        """Checks where each request comes from, and adds the headers that confine the page."""
        try:
            if not self._panel.gate.knows_host(request.headers.get("Host")):
                raise web.HTTPForbidden(text="This address isn't one of the panel's: see `hosts` in its page\n")
            response = await handler(request)
        except web.HTTPException as refused:
            refused.headers.update(HEADERS)
            raise
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    async def _file(self, request):
        # From memory: no path of a request reaches the file system.
        name = request.match_info.get("name", "index.html")
        if name not in self._files:
            raise web.HTTPNotFound()
        return web.Response(body=self._files[name], content_type=TYPES[pathlib.PurePath(name).suffix],
                            charset="utf-8")

    def _require_page(self, request):
        """A request of an open page: its script adds the token, which no foreign page has. Returns its viewer."""
        key = request.headers.get("X-Page", "")
        scheme, _, token = request.headers.get("Authorization", "").partition(" ")
        viewer = next((viewer for viewer in self._panel.viewers if viewer.key == key), None)
        if viewer is None or scheme != "Bearer" or not self._panel.gate.knows_token(token):
            self._panel.refuse_login()
            raise web.HTTPForbidden(text="Only the panel's own page may ask for this\n")
        return viewer

    async def _read_drawing(self, request):
        viewer = self._require_page(request)
        if not self._panel.gate.is_own_origin(request.headers.get("Origin"), request.headers.get("Host")):
            raise web.HTTPForbidden(text="Only the panel's own page may ask for this\n")
        try:
            self._panel.require_control(viewer)
            await self._panel.drawing.read(await request.read(), request.query, self._panel.publish_drawing)
        except Refusal as refusal:
            return web.json_response({"problem": str(refusal)})
        return web.json_response({"problem": ""})

    async def _drawing(self, request):
        self._require_page(request)
        return web.json_response(self._panel.drawing.strokes())

    async def _recordings(self, request):
        self._require_page(request)
        try:
            return web.json_response({"recordings": await in_thread(self._folder().shown), "problem": ""})
        except Refusal as refusal:
            return web.json_response({"recordings": [], "problem": str(refusal)})

    def _folder(self):
        machine = self._panel.machine
        return Recordings(machine.recorder.get("folder", ""), machine.driver.name)

    async def _recording(self, request):
        self._require_page(request)
        name = request.match_info["name"]
        try:
            file, size = await in_thread(self._folder().open, name)
        except Refusal as refusal:
            raise web.HTTPNotFound(text=f"{refusal}\n") from None
        response = web.StreamResponse(headers={**HEADERS, "Content-Disposition": f'attachment; filename="{name}"'})
        response.content_type = "application/octet-stream"
        response.content_length = size
        with file:
            await response.prepare(request)
            while size > 0:
                part = await in_thread(file.read, min(size, CHUNK))
                if not part:
                    break
                size -= len(part)
                await response.write(part)
        return response

    async def _socket(self, request):
        panel = self._panel
        if not panel.gate.is_own_origin(request.headers.get("Origin"), request.headers.get("Host")):
            panel.refuse_login()
            raise web.HTTPForbidden(text="Only the panel's own page may connect\n")
        socket = web.WebSocketResponse(heartbeat=ALIVE, max_msg_size=LARGEST_MESSAGE)
        await socket.prepare(request)
        login = await self._login(socket)
        if login is None:
            panel.refuse_login()
            await socket.close(code=FORBIDDEN, message=b"wrong token")
            return socket
        await self._serve(socket, request.transport, login.get("was"))
        return socket

    async def _login(self, socket):
        """The first message of a connection; None if it doesn't have the token."""
        strangers = self._strangers
        if len(strangers) >= MOST_STRANGERS:
            self._panel.begin(strangers.pop(0).close())
        strangers.append(socket)
        try:
            message = await socket.receive(timeout=LOGIN)
            login = json.loads(message.data) if message.type == WSMsgType.TEXT else None
            return login if isinstance(login, dict) and self._panel.gate.knows_token(login.get("token")) else None
        except (asyncio.TimeoutError, ValueError, RecursionError):
            return None
        finally:
            if socket in strangers:
                strangers.remove(socket)

    async def _serve(self, socket, transport, was):
        panel = self._panel
        viewer = panel.enter(socket, transport, was)
        viewer.answer(welcome={"number": viewer.number, "key": viewer.key})
        sender = asyncio.get_running_loop().create_task(self._send(viewer))
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    panel.take(viewer, message.data)
        finally:
            sender.cancel()
            panel.leave(viewer)

    async def _send(self, viewer):
        try:
            await viewer.send(self._panel.newest)
        except (asyncio.TimeoutError, ConnectionError, RuntimeError):
            await viewer.socket.close()


class Connections:
    """Makes the protocol of each new connection. If there are too many, the oldest one that shows no page is
    closed, so that idle ones keep nobody out."""

    def __init__(self, server, pages):
        """server: of aiohttp. pages: a function that returns the transports of the viewers."""
        self._server, self._pages = server, pages

    def __call__(self):
        connections = [handler for handler in self._server.connections if handler.transport is not None]
        surplus = len(connections) + 1 - MOST_CONNECTIONS  # several may come at once
        if surplus > 0:
            pages = self._pages()
            others = [handler.transport for handler in connections if handler.transport not in pages]
            for transport in others[:surplus]:
                transport.abort()
        return self._server()

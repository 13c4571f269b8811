"""Who may drive the page: tokens, hosts, origins, and what floods do. No test needs the browser but those of
foreign pages."""

import asyncio
import contextlib
import functools
import http.server
import json
import pathlib
import threading
import unittest

import aiohttp
import yarl
from machine import BOUND, Machine, Page, browser, wait_until

FORBIDDEN = 4403
FLOOD = 1000
GROWTH = 8.0  # [MB] of a process that served a flood


def setUpModule():
    global machine, chrome, foreign
    machine = Machine()
    unittest.addModuleCleanup(machine.end)
    chrome = browser()
    unittest.addModuleCleanup(chrome.quit)
    foreign = ForeignSite()
    unittest.addModuleCleanup(foreign.end)


class ForeignSite:
    """Another page in the same browser, which knows the panel's address and its token."""

    def __init__(self):
        self.page = b""
        self.asked = []
        site = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                site.asked.append(self.path)
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.end_headers()
                self.wfile.write(site.page)

            def log_message(self, *_):
                pass
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def end(self):
        self._server.shutdown()
        self._server.server_close()


def memory():
    """[MB] of the panel."""
    status = pathlib.Path(f"/proc/{machine.panel_process()}/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024.0


def descriptors():
    return len(list(pathlib.Path(f"/proc/{machine.panel_process()}/fd").iterdir()))


def with_session(test):
    @functools.wraps(test)
    def run(self):
        async def within():
            async with aiohttp.ClientSession(f"http://127.0.0.1:{machine.port}",
                                             timeout=aiohttp.ClientTimeout(total=BOUND)) as session:
                await test(self, session)
        asyncio.run(within())
    return run


def own_headers(**others):
    return {"Origin": f"http://127.0.0.1:{machine.port}", **others}


async def logged_in(session):
    """A connection like that of the page, after the token."""
    socket = await session.ws_connect("/socket", headers=own_headers())
    await socket.send_json({"token": machine.token})
    await socket.receive_json(timeout=BOUND)
    return socket


async def end_of(socket):
    while True:
        message = await socket.receive(timeout=BOUND)
        if message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.ERROR):
            return socket.close_code


class Requests(unittest.TestCase):
    @with_session
    async def test_every_answer_confines_the_page(self, session):
        for path in ("/", "/main.js", "/panel.css", "/nothing"):
            async with session.get(path) as answer:
                self.assertIn("default-src 'none'", answer.headers["Content-Security-Policy"], path)
                self.assertNotIn("unsafe", answer.headers["Content-Security-Policy"], path)
                self.assertEqual(answer.headers["X-Content-Type-Options"], "nosniff", path)

    @with_session
    async def test_no_path_reaches_the_file_system(self, _session):
        for path in ("/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/%2fetc%2fpasswd",
                     "/.%00", "/page/index.html"):
            address = yarl.URL(f"http://127.0.0.1:{machine.port}{path}", encoded=True)
            async with aiohttp.ClientSession() as raw, raw.get(address) as answer:
                self.assertIn(answer.status, (400, 404), path)

    @with_session
    async def test_nothing_in_the_page_has_the_token(self, session):
        for path in ("/", "/main.js", "/connection.js"):
            async with session.get(path) as answer:
                self.assertNotIn(machine.token, await answer.text())

    @with_session
    async def test_a_foreign_name_of_the_host_is_refused(self, session):
        for host in ("evil.example", f"evil.example:{machine.port}"):
            async with session.get("/", headers={"Host": host}) as answer:
                self.assertEqual(answer.status, 403)
            with self.assertRaises(aiohttp.WSServerHandshakeError):
                await session.ws_connect("/socket", headers={"Host": host, "Origin": f"http://{host}"})

    @with_session
    async def test_a_foreign_origin_is_refused(self, session):
        for headers in ({}, {"Origin": foreign.address}, {"Origin": "null"}, {"Origin": "http://localhost"}):
            with self.assertRaises(aiohttp.WSServerHandshakeError) as refused:
                await session.ws_connect("/socket", headers=headers)
            self.assertEqual(refused.exception.status, 403)

    @with_session
    async def test_without_the_token_nothing_is_told(self, session):
        for first in ("{}", '{"token": ""}', '{"token": null}', '{"token": ["x"]}', "[]", "nonsense", "[" * 2000,
                      json.dumps({"token": machine.token[:-1]}), json.dumps({"id": 1, "do": "stop"})):
            socket = await session.ws_connect("/socket", headers=own_headers())
            await socket.send_str(first)
            message = await socket.receive(timeout=BOUND)
            self.assertEqual(message.type, aiohttp.WSMsgType.CLOSE, first)
            self.assertEqual(socket.close_code, FORBIDDEN, first)

    @with_session
    async def test_a_thousand_refused_logins_change_nothing(self, session):
        page = await logged_in(session)

        async def knock(number):
            socket = await session.ws_connect("/socket", headers=own_headers())
            await socket.send_json({"token": f"wrong {number}"})
            return await end_of(socket)

        async def read():  # the panel leaves a page that reads nothing
            while True:
                await page.receive_json()
        reading = asyncio.ensure_future(read())
        await knock(-1)
        before = memory(), descriptors()
        for begin in range(0, FLOOD, 10):
            codes = await asyncio.gather(*(knock(begin + i) for i in range(10)))
            self.assertEqual(set(codes), {FORBIDDEN})
        grown = memory() - before[0]
        print(f"{FLOOD} refused logins: the panel grew by {grown:.1f} MB")
        self.assertLess(grown, GROWTH)
        self.assertLess(descriptors(), before[1] + 20)
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading
        await page.send_json({"id": 7, "do": "stop"})
        self.assertTrue(await self.answer_of(page, 7))
        await page.close()

    async def answer_of(self, socket, call):
        for _ in range(1000):
            update = await socket.receive_json(timeout=BOUND)
            for answer in update.get("answers", []):
                if answer.get("id") == call:
                    return answer["ok"]
        raise AssertionError("no answer")

    @with_session
    async def test_silent_connections_keep_nobody_out(self, session):
        silent = [await asyncio.open_connection("127.0.0.1", machine.port) for _ in range(300)]
        waiting = []
        for _ in range(30):
            waiting.append(await session.ws_connect("/socket", headers=own_headers()))
        page = await logged_in(session)
        await page.send_json({"id": 8, "do": "stop"})
        self.assertTrue(await self.answer_of(page, 8))
        self.assertLess(descriptors(), 250)
        await page.close()
        for socket in waiting:
            await socket.close()
        for _, writer in silent:
            writer.close()

    @with_session
    async def test_a_page_that_sends_too_much_is_told_and_can_still_stop(self, session):
        page = await logged_in(session)
        for number in range(300):
            await page.send_json({"id": number, "do": "no_such_command"})
        await page.send_json({"id": 9999, "do": "stop"})
        self.assertTrue(await self.answer_of(page, 9999))
        await page.close()

    @with_session
    async def test_too_large_messages_end_their_connection_only(self, session):
        page, other = await logged_in(session), await logged_in(session)
        await page.send_str("x" * 100_000)
        self.assertEqual(await end_of(page), 1009)
        await other.send_json({"id": 5, "do": "stop"})
        self.assertTrue(await self.answer_of(other, 5))
        await other.close()

    @with_session
    async def test_wrong_fields_are_refused_and_move_nothing(self, session):
        pulses = machine.pulses("x") + machine.pulses("y")
        page = await logged_in(session)
        await page.send_json({"id": 1, "do": "take_control"})
        await self.answer_of(page, 1)
        call = 10
        for message in ('"do": "move"', '"do": "move", "axis": "z", "by": 1', '"do": "move", "axis": "x", "by": "1"',
                        '"do": "move", "axis": "x", "by": NaN', '"do": "move", "axis": "x", "to": 1e999',
                        f'"do": "move", "axis": "x", "to": 1{"0" * 400}',
                        '"do": "move", "axis": ["x"], "by": 1', '"do": "move", "axis": "x", "by": true',
                        '"do": "jog", "axis": "x", "velocity": 1, "tick": "now", "press": 1',
                        '"do": "jog", "axis": "x", "velocity": NaN, "tick": 1e300, "press": 1',
                        '"do": "speed_override", "factor": 1e9', '"do": ["move"]', '"do": {"a": 1}', '"do": null'):
            call += 1
            await page.send_str(f'{{"id": {call}, {message}}}')
            self.assertFalse(await self.answer_of(page, call), message)
        for garbage in ("", "[]", "7", '"stop"', '{"do": "stop"}', '{"id": "a", "do": "stop"}', "\ud7ff"):
            await page.send_str(garbage)
        await page.send_json({"id": 99, "do": "stop"})
        self.assertTrue(await self.answer_of(page, 99))
        await page.close()
        self.assertEqual(machine.pulses("x") + machine.pulses("y"), pulses)


class ForeignPages(unittest.TestCase):
    """A page of another site in the browser of somebody who has the panel open."""

    def test_cannot_connect_even_with_the_token(self):
        foreign.page = f"""<!DOCTYPE html><body><script>
            const socket = new WebSocket("ws://127.0.0.1:{machine.port}/socket");
            socket.onopen = () => {{ document.title = "open"; socket.send('{{"token": "{machine.token}"}}'); }};
            socket.onmessage = () => {{ document.title = "told"; }};
            socket.onerror = () => {{ document.title = "refused"; }};
            </script>""".encode()
        chrome.get(foreign.address)
        wait_until(lambda: chrome.title, "the foreign page has tried")
        self.assertEqual(chrome.title, "refused")

    def test_cannot_show_the_panel_in_a_frame(self):
        foreign.page = f"""<!DOCTYPE html><body><iframe src="{machine.link}" onload="document.title = 'loaded'">
            </iframe>""".encode()
        chrome.get(foreign.address)
        wait_until(lambda: chrome.title == "loaded", "the frame has ended its load")
        chrome.switch_to.frame(0)
        self.assertEqual(chrome.find_elements("id", "stop"), [])
        chrome.switch_to.default_content()

    def test_the_page_asks_nobody_else(self):
        Page(chrome).open_live(machine.link)
        names = chrome.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
        self.assertTrue(names)
        for name in names:
            self.assertTrue(name.startswith(f"http://127.0.0.1:{machine.port}/"), name)
        self.assertNotIn(machine.token, chrome.current_url)

    def test_the_browser_finds_nothing_to_complain_about(self):
        chrome.get_log("browser")
        page = Page(chrome).open_live(machine.link)
        self.assertEqual(page.complaints(), [])

    def test_without_the_token_the_page_shows_nothing(self):
        page = Page(chrome)
        chrome.get(foreign.address)
        chrome.execute_cdp_cmd("Storage.clearDataForOrigin", {
            "origin": f"http://127.0.0.1:{machine.port}", "storageTypes": "all"})
        chrome.switch_to.new_window("tab")
        page.open(machine.link.partition("#")[0] + "#wrong")
        wait_until(lambda: "wrong token" in page.text("connection"), "the page says that its token is wrong")
        self.assertEqual(chrome.find_elements("css selector", ".axis"), [])
        chrome.close()
        chrome.switch_to.window(chrome.window_handles[0])

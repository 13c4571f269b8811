"""Who may talk to the panel: the checks of addresses, tokens and rates. None of them needs the server."""

import hmac
import ipaddress
import secrets
import socket
import time
from urllib.parse import urlsplit

TOKEN_BYTES = 24
LOOPBACK = {"localhost", "127.0.0.1", "::1"}


def new_token():
    return secrets.token_urlsafe(TOKEN_BYTES)


def host_of(header):
    """The host in a Host header, without its port; None if there is none."""
    try:
        return urlsplit(f"//{header}").hostname
    except ValueError:
        return None


def is_address(host):
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


class Gate:
    """Decides about the headers and the token of a request."""

    def __init__(self, token, listen, names=()):
        """listen: the address on which the panel listens. names: further names of this computer that links
        may have, for example of a proxy."""
        self._token = token.encode()
        own = socket.gethostname().lower()
        self._names = LOOPBACK | {listen.lower(), own, f"{own}.local"} | {name.lower() for name in names}
        # A name can be made to lead to any address, an address can't: DNS rebinding needs a name.
        self._any_address = not (listen in LOOPBACK or listen.startswith("127."))

    def knows_host(self, header):
        """Whether a request is for this computer by one of its own names. Another one may be a name with
        which a foreign page leads its own requests here."""
        host = host_of(header or "")
        return host is not None and (host in self._names or self._any_address and is_address(host))

    @staticmethod
    def is_own_origin(origin, host):
        """Whether a request was sent by a page of this server. Browsers send an Origin with each request of a
        page that is a WebSocket or a POST."""
        return origin is not None and origin.lower() in (f"http://{host}".lower(), f"https://{host}".lower())

    def knows_token(self, token):
        """Takes equally long for every wrong token."""
        return isinstance(token, str) and hmac.compare_digest(token.encode(errors="replace"), self._token)


class Rate:
    """A bucket of permits that fills at a rate."""

    def __init__(self, per_second, most, clock=time.monotonic):
        self._per_second, self._most, self._clock = per_second, most, clock
        self._permits, self._seen = most, clock()

    def take(self):
        """Whether one more is allowed now."""
        now = self._clock()
        self._permits = min(self._most, self._permits + (now - self._seen) * self._per_second)
        self._seen = now
        if self._permits < 1.0:
            return False
        self._permits -= 1.0
        return True

"""The service as seen from another computer: documents over HTTP, errors in the service's own words."""

from __future__ import annotations

import json
import urllib.error
import urllib.parse
import urllib.request
from typing import Any

from tacdata.errors import DeviceError, FormatError, TacdataError, UsageError

TOKEN = "TACDATA_FARM_TOKEN"
URL = "TACDATA_FARM_URL"
SECONDS = 60.0


class Client:
    """One service."""

    def __init__(self, url: str, token: str = "") -> None:
        """Name the service.

        Raises:
            UsageError: If the address is none of HTTP.
        """
        parts = urllib.parse.urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.netloc:
            raise UsageError(
                f"the address {url!r}", "http://HOST:PORT, as `tacdata farm up` says it", "give it with --url"
            )
        self.url, self._token = url.rstrip("/"), token

    def get(self, path: str) -> Any:
        """Return the document at a path."""
        return json.loads(self.send("GET", path))

    def post(self, path: str, document: Any = None) -> Any:
        """Send a document; return the answer."""
        body = json.dumps({} if document is None else document).encode()
        return json.loads(self.send("POST", path, body, {"Content-Type": "application/json"}))

    def send(self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None) -> bytes:
        """Send a request; return the answer's bytes.

        Raises:
            DeviceError: If the service cannot be reached.
            UsageError: If it refuses, in its words.
            FormatError: If it finds the content wrong, in its words.
        """
        given = dict(headers or {})
        if self._token:
            given["Authorization"] = f"Bearer {self._token}"
        request = urllib.request.Request(self.url + path, data=body, headers=given, method=method)
        try:
            with urllib.request.urlopen(request, timeout=SECONDS) as answer:
                return answer.read()
        except urllib.error.HTTPError as error:
            with error:
                raise _in_words(error.code, error.read()) from None
        except (urllib.error.URLError, OSError) as error:
            reason = getattr(error, "reason", error)
            raise DeviceError(
                f"no answer from {self.url}: {reason}", "a service that runs there", "start it: `tacdata farm up`"
            ) from None


def _in_words(status: int, body: bytes) -> TacdataError:
    kind = FormatError if status == 422 else UsageError
    try:
        document = json.loads(body)
        if "given" in document:
            return kind(document["given"], document["allowed"], document["next"])
        first = document["detail"][0] if isinstance(document.get("detail"), list) else document
        field = "/".join(str(part) for part in first.get("loc", ())[1:])
        return kind(f"{field}: {first.get('msg', document)}", "what /openapi.json says of it", "correct it")
    except (ValueError, KeyError, IndexError, TypeError, AttributeError):
        return kind(f"the service answered {status}", "an answer of tacdata's label farm", "check the address")

"""Requests to a service from another computer, with errors in the service's own words."""

from __future__ import annotations

import http.client
import json
import re
import time
import urllib.error
import urllib.parse
import urllib.request
from typing import Any

from tacdata.errors import DeviceError, FormatError, SolveError, TacdataError, UsageError

TOKEN = "TACDATA_FARM_TOKEN"
URL = "TACDATA_FARM_URL"
SECONDS = 60.0


class _Unchanged(Exception):
    """The client already has the requested content."""


class Client:
    """One service."""

    def __init__(self, url: str, token: str = "") -> None:
        """Name the service.

        Raises:
            UsageError: If the address is none of HTTP, or the token cannot be one.
        """
        if not _is_address(url):
            raise UsageError(
                f"the address {url!r}", "http://HOST:PORT, as `tacdata farm up` says it", "give it with --url"
            )
        if not re.fullmatch("[!-~]*", token):
            raise UsageError(
                "a token with blanks or letters beyond plain ones",
                "the token that `tacdata farm up` was started with",
                "give it with --token or TACDATA_FARM_TOKEN",
            )
        self.url, self._token = url.rstrip("/"), token

    @staticmethod
    def submission(number: str) -> str:
        """Return the path of a submission.

        Raises:
            UsageError: If that is no number.
        """
        if not re.fullmatch("[0-9]{1,6}", number):
            raise UsageError(f"submission {number!r}", "its number, such as 000001", "see `tacdata farm status`")
        return f"/api/submissions/{int(number):06d}"

    def get(self, path: str) -> Any:
        """Return the document at a path."""
        return self._document(self.send("GET", path))

    def post(self, path: str, document: Any = None) -> Any:
        """Send a document; return the answer."""
        body = json.dumps({} if document is None else document).encode()
        return self._document(self.send("POST", path, body, {"Content-Type": "application/json"}))

    def planned(self, number: str, seconds: float) -> dict[str, Any]:
        """Return a submission once the service has looked at its recordings, or its state after a while.

        Args:
            number: Which.
            seconds: Longest wait [s].
        """
        end = time.monotonic() + seconds
        entry = self.get(self.submission(number))
        while entry["state"] in ("waiting", "planning") and time.monotonic() < end:
            time.sleep(0.2)
            entry = self.get(self.submission(number))
        return entry

    def _document(self, answer: bytes) -> Any:
        try:
            return json.loads(answer)
        except ValueError:
            raise self._stranger() from None

    def _stranger(self) -> UsageError:
        return UsageError(
            f"what answers at {self.url} is no label farm of this version",
            "the address that `tacdata farm up` says",
            "check --url",
        )

    def content(self, path: str, digest: str = "") -> bytes | None:
        """Return the bytes at a path; None if they are still those of a hash that is known (SHA-256, hex)."""
        try:
            return self.send("GET", path, headers={"If-None-Match": f'"{digest}"'} if digest else {})
        except _Unchanged:
            return None

    def send(self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None) -> bytes:
        """Send a request; return the answer's bytes.

        Raises:
            DeviceError: If the service cannot be reached.
            UsageError: If it refuses, in its words.
            FormatError: If it finds the content wrong, in its words.
        """
        all_headers = dict(headers or {})
        if self._token:
            all_headers["Authorization"] = f"Bearer {self._token}"
        request = urllib.request.Request(self.url + path, data=body, headers=all_headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=SECONDS) as answer:
                return answer.read()
        except urllib.error.HTTPError as error:
            with error:
                if error.code == 304:
                    raise _Unchanged from None
                # Any other web server answers so; a farm's refusals come in words.
                if error.code in (404, 405, 501):
                    raise self._stranger() from None
                raise _in_words(error.code, error.read()) from None
        except (urllib.error.URLError, http.client.HTTPException, OSError) as error:
            reason = getattr(error, "reason", "") or error or type(error).__name__
            raise DeviceError(
                f"no answer from {self.url}: {reason}", "a service that runs there", "start it: `tacdata farm up`"
            ) from None


def refusal(entry: dict[str, Any]) -> SolveError:
    """Return why a submission was refused, in the service's own words."""
    fault, *lines = entry["reason"].split("\n  ")
    parts = {key: words for key, _, words in (line.partition(":") for line in lines)}
    return SolveError(
        f"submission {entry['id']} is refused: {fault}",
        parts.get("allowed", "a session whose every episode can be labelled").strip(),
        parts.get("next", "mend what is said above and submit again").strip(),
    )


def _is_address(url: str) -> bool:
    try:
        parts = urllib.parse.urlsplit(url)
        # `port` raises if it is no number.
        fits = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 0) >= 0
    except ValueError:
        return False
    return fits and bool(re.fullmatch("[!-~]+", url)) and not parts.query and not parts.fragment


def _in_words(status: int, body: bytes) -> TacdataError:
    kind = FormatError if status == 422 else UsageError
    try:
        document = json.loads(body)
        return kind(str(document["given"]), str(document["allowed"]), str(document["next"]))
    except (ValueError, KeyError, TypeError):
        return kind(f"the service answered {status}", "an answer of tacdata's label farm", "check the address")

"""Where a log lies: a path or a URL."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import parse_qsl, unquote, urlsplit

from rose2_logs.errors import ParameterError
from rose2_logs.system.files import readable

WEB_SCHEMES = ("http://", "https://")
_SIGNED = re.compile("signature|token|credential|^sig$", re.IGNORECASE)
"""Names of query parameters in the signed URLs of the large object stores."""


def require_place(url: str) -> None:
    """Check that a URL names a place: more than its scheme.

    Raises
    ------
    ParameterError
        If it does not.
    """
    scheme, _, place = url.partition("://")
    if not place.strip("/"):
        raise ParameterError(f"{scheme}://: names no place; write {scheme}://BUCKET/FOLDER, or a local path")


@dataclass(frozen=True, order=True, slots=True)
class Location:
    """Where a log lies.

    Attributes
    ----------
    target : str
        An absolute path, or a URL as it is opened.
    """

    target: str

    @property
    def is_remote(self) -> bool:
        """Whether it is a URL, to be opened by fsspec."""
        return "://" in self.target

    @property
    def address(self) -> str:
        """The path or URL without passwords and signatures, which identifies a log and may be shown."""
        if not self.is_remote:
            return readable(self.target)
        if "::" in self.target:
            return self.target
        url = urlsplit(self.target)
        signed = any(_SIGNED.search(name) for name, _ in parse_qsl(url.query, keep_blank_values=True))
        host = url.netloc.rpartition("@")[2]
        return url._replace(netloc=host, query="" if signed else url.query).geturl()

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of its folders and its own name, outermost first."""
        if not self.is_remote:
            return Path(self.target).parts
        inner, _, outer = self.target.partition("::")
        if outer and inner.endswith("://"):
            return Location(outer).parts
        if not inner.startswith(WEB_SCHEMES):
            return PurePosixPath(inner.partition("://")[2]).parts
        url = urlsplit(inner)
        return PurePosixPath(url.netloc.rpartition("@")[2], unquote(url.path).strip("/")).parts

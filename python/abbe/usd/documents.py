"""Files of MaterialX documents, with all they include, checked before the MaterialX library sees them.

That library recurses without a limit and expands whatever it is given.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.parsers import expat

from ._pxr import Ar

__all__ = ["MAX_DEPTH", "DocumentError", "DocumentReader"]


class DocumentError(Exception):
    """A document cannot be read; the message says why and what to do."""


# Largest document with all it includes, bytes and elements: the standard libraries of MaterialX 1.39, the largest
# documents that are in use, have 2.5 MB and 40,000. Half a minute is what the largest accepted take to translate.
_MAX_BYTES = 16_000_000
_MAX_ELEMENTS = 200_000
# Documents nest four deep (materialx, nodegraph, node, input); graphs of nodes that are graphs somewhat deeper.
MAX_DEPTH = 64


class DocumentReader:
    """Reads a document with what it includes; included files are looked for beside the one that includes them."""

    def __init__(self, mx: Any) -> None:
        self._mx = mx
        self._bytes = 0
        self._elements = 0
        self._open: list[str] = []

    def read(self, document: Any, identifier: str) -> None:
        """Read the file of ``identifier`` into ``document``."""
        resolved = Ar.GetResolver().Resolve(identifier)
        if not resolved:
            raise DocumentError(f"{identifier}: there is no such file: check the path")
        path = str(resolved)
        if path in self._open:
            raise DocumentError(f"{path}: includes itself: remove the xi:include")
        if len(self._open) >= MAX_DEPTH:
            raise DocumentError(f"{path}: is included through more than {MAX_DEPTH} files: include it directly")
        text = self._checked(path, resolved)
        options = self._mx.XmlReadOptions()

        def include(included: Any, file: Any, *_: Any) -> None:
            name = file.asString().replace("\\", "/")
            if not self._is_standard(name, path):
                self.read(included, Ar.GetResolver().CreateIdentifier(name, resolved))

        options.readXIncludeFunction = include
        self._open.append(path)
        self._mx.readFromXmlString(document, text, self._mx.FileSearchPath(), options)
        self._open.pop()

    def _is_standard(self, name: str, includer: str) -> bool:
        """Return whether a file is one of MaterialX' own, whose definitions are there anyhow."""
        if Path(includer).parent.joinpath(name).exists():
            return False
        search = self._mx.getDefaultDataSearchPath()
        for part in (name, f"libraries/{name}"):
            found = Path(search.find(self._mx.FilePath(part)).asString())
            # What is not found comes back as it is.
            if found.is_absolute() and found.is_file():
                return True
        return False

    def _checked(self, path: str, resolved: Any) -> str:
        """Return the text of a file that is well-formed, of sensible size and without a document type."""
        data = _content(path, resolved, _MAX_BYTES - self._bytes)
        self._bytes += len(data)
        depth = 0
        parser = expat.ParserCreate()

        def start(*_: Any) -> None:
            nonlocal depth
            depth += 1
            self._elements += 1
            if depth > MAX_DEPTH or self._elements > _MAX_ELEMENTS:
                raise DocumentError(
                    f"{path}: has more than {_MAX_ELEMENTS} elements, or more than {MAX_DEPTH} within each other: "
                    "split the document"
                )

        def end(_: str) -> None:
            nonlocal depth
            depth -= 1

        def document_type(*_: Any) -> None:
            raise DocumentError(f"{path}: has a document type (<!DOCTYPE>), which MaterialX does not know: remove it")

        parser.StartElementHandler = start
        parser.EndElementHandler = end
        parser.StartDoctypeDeclHandler = document_type
        try:
            parser.Parse(data, True)
            return data.decode("utf-8")
        except (expat.ExpatError, UnicodeDecodeError) as error:
            raise DocumentError(f"{path}: is no XML in UTF-8 ({error}): correct the document") from None


def _content(path: str, resolved: Any, limit: int) -> bytes:
    """Return the bytes of a file on disk, or of one in a package or store that the resolver opens."""
    try:
        data = _opened(path, resolved, limit)
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise DocumentError(f"{path}: cannot be read ({error}): check the path") from None
    if data is None or len(data) > limit:
        raise DocumentError(
            f"{path}: is larger than {limit:,} bytes, with what it is included from: split the document"
        )
    return data


def _opened(path: str, resolved: Any, limit: int) -> bytes | None:
    """Return the bytes, None if they are known to be too many."""
    if Path(path).is_file():
        with open(path, "rb") as file:
            return file.read(limit + 1)
    resolver = Ar.GetResolver()
    if not hasattr(resolver, "OpenAsset"):
        # Python cannot open assets before USD 25; what stands in a .usdz is in a zip file.
        package, inner = Ar.SplitPackageRelativePathOuter(path)
        with zipfile.ZipFile(package) as archive:
            return archive.read(inner) if archive.getinfo(inner).file_size <= limit else None
    asset = resolver.OpenAsset(resolved)
    if asset is None:
        raise OSError("the resolver does not open it")
    return bytes(asset.GetBuffer()) if asset.GetSize() <= limit else None

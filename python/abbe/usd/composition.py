"""What does not compose, and what USD says of it: warnings with prim paths, and nothing on the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..errors import StageError
from . import tokens
from ._pxr import Ar, Pcp, Tf, UsdUtils
from .description import Diagnostics
from .substitution import plain_names
from .values import place

if TYPE_CHECKING:
    from .stage import OpenedStage

__all__ = ["composition_warnings", "document_name", "quiet_usd", "unread_documents", "usd_reason"]


@contextmanager
def quiet_usd(source: str, diagnostics: Diagnostics) -> Iterator[None]:
    """Keep USD's own warnings off the terminal, and record those that are not reported otherwise.

    Composition errors are reported by :func:`composition_warnings`, with prim paths; a crate file's age is not the
    user's concern.

    Raises
    ------
    StageError
        A call of USD failed that is not expected to: the stage is at fault.
    """
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except Tf.ErrorException as error:
        raise StageError(f"{source}: USD cannot read it: {usd_reason(error)}: correct the file") from error
    finally:
        try:
            items = delegate.TakeUncoalescedDiagnostics()
            new = [item for item in items if not any(name in item.sourceFunction for name in _REPORTED_ELSEWHERE)]
            # Several threads compose a stage, so that the order says nothing.
            for message in sorted(map(_commentary, new)):
                diagnostics.warn("usd", source, message)
        finally:
            # The delegate listens until it is destroyed.
            del delegate


def _commentary(item: Any) -> str:
    """Return what USD says, on one line and without addresses, which no two runs share."""
    try:
        return _ADDRESS.sub("", " ".join(str(item.commentary).split()))
    except UnicodeDecodeError:
        return "USD met something that is no text"


# UsdStage::_ReportErrors, Sdf_CrateFile::_CheckFileVersion, UsdShadeMaterialBindingAPI's BindingsAtPrim (a missing API
# schema changes nothing).
_REPORTED_ELSEWHERE = ("_ReportErrors", "_CheckFileVersion", "BindingsAtPrim")
_ADDRESS = re.compile(r" <0x[0-9a-f]+>")
_COMMENTARY = re.compile(r"at line \d+ in file \S+ : '(.*?)'\s*(?=\n|$)", re.DOTALL)


def usd_reason(error: BaseException) -> str:
    """Return the first reason in a Tf error, on one line and without USD's own source positions."""
    try:
        text = str(error)
    except UnicodeDecodeError:
        # USD quotes what it could not read, and that need not be text.
        return "the file is not what its name or its beginning says"
    found = _COMMENTARY.findall(text)
    text = found[0] if found else text
    text = re.sub(r"pxrInternal_v[0-9_]+pxrReserved__(_pegtl)?::(internal::)?", "", text)
    return " ".join(text.split())


def composition_warnings(opened: OpenedStage, missing: str, diagnostics: Diagnostics) -> None:
    """Warn of everything that did not compose, with the prim it is missing from.

    Raises
    ------
    StageError
        ``missing`` is ``"error"`` and a layer or prim that is referred to is not there.
    """

    def described(error: Any) -> tuple[str, str, Any]:
        path = getattr(getattr(error, "rootSite", None), "path", None)
        where = place(path) if path is not None and not path.isEmpty else opened.source
        return where, plain_names(" ".join(str(error).split())), error

    # USD gives them in no order that two runs share.
    for where, text, error in sorted(map(described, _composition_errors(opened.stage)), key=lambda found: found[:2]):
        kind = "missing-reference" if isinstance(error, _MISSING) else "composition-error"
        document = document_name(text)
        reason = opened.documents.get(document) if document else None
        if isinstance(reason, str):
            text = f"@{document}@ {reason}"
        if kind == "missing-reference" and missing == "error":
            raise StageError(f"{where}: {text}: add what is missing, or choose --missing warn")
        diagnostics.warn(kind, where, text)


def _composition_errors(stage: Any) -> list[Any]:
    if hasattr(stage, "GetCompositionErrors"):
        return list(stage.GetCompositionErrors())
    # Before USD 23.05.
    return [error for prim in stage.TraverseAll() for error in prim.GetPrimIndex().localErrors]


def document_name(text: str) -> str | None:
    """Return the identifier of the MaterialX document that a composition error is about, None if about none."""
    named = _ASSET.search(text)
    identifier = named[1].partition(_FORMAT_ARGUMENTS)[0] if named else ""
    extension = Ar.GetResolver().GetExtension(identifier).lower()
    return identifier if extension == tokens.MATERIALX_EXTENSION else None


def unread_documents(stage: Any) -> set[str]:
    """Return the identifiers of the MaterialX documents that a stage refers to and USD has not read."""
    errors = _composition_errors(stage)
    named = {document_name(str(error)) for error in errors if isinstance(error, _UNREAD)}
    return {name for name in named if name is not None}


_ASSET = re.compile(r"@([^@]+)@")
_FORMAT_ARGUMENTS = ":SDF_FORMAT_ARGS:"
_UNREAD = (Pcp.ErrorInvalidAssetPath, Pcp.ErrorInvalidSublayerPath)
_MISSING = tuple(
    getattr(Pcp, name)
    for name in (
        "ErrorInvalidAssetPath",
        "ErrorInvalidSublayerPath",
        "ErrorMutedAssetPath",
        "ErrorUnresolvedPrimPath",
        "ErrorInvalidReferenceOffset",
    )
    if hasattr(Pcp, name)
)

"""Opening stages: files and stages in memory, variants and values set for one render, and what does not compose.

Overrides go to a session layer of our own; neither the files nor the caller's stage are changed.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from ..errors import NotUsdError, StageError, UsageError
from . import tokens
from ._pxr import Ar, Pcp, Sdf, Tf, Usd, UsdUtils
from .description import Diagnostics
from .documents import DocumentError
from .mtlx import read_document
from .substitution import plain_names, substitute
from .values import place

__all__ = [
    "OpenedStage",
    "Opening",
    "Overrides",
    "composition_warnings",
    "open_stage",
    "quiet_usd",
    "source_name",
    "stage_metadata",
    "stage_time",
]

Overrides = Mapping[str, Any] | Sequence[str]
"""``{"/World/Glass.inputs:ior": 1.6}`` or ``["/World/Glass.inputs:ior=1.6"]``."""


@dataclass
class OpenedStage:
    """A stage and what must live as long as it."""

    stage: Any
    source: str
    """The root layer as the user named it."""
    session: Any = None
    """Our session layer; None while the stage is the caller's own."""
    keep: list[Any] = field(default_factory=list)
    documents: dict[str, Any] = field(default_factory=dict)
    """MaterialX documents by asset identifier: the layer that stands for it, or why there is none."""


class Opening(TypedDict, total=False):
    """How a stage is opened; see :func:`abbe.usd.describe`."""

    variants: Sequence[str]
    overrides: Overrides
    search_paths: Sequence[str | os.PathLike[str]]
    session_layer: str | os.PathLike[str] | None
    mask: Sequence[str]
    payloads: str


def source_name(stage_or_path: Any) -> str:
    """Return what messages call a stage: its path as given, or its root layer."""
    if not isinstance(stage_or_path, Usd.Stage):
        return str(stage_or_path)
    root = stage_or_path.GetRootLayer()
    # An anonymous layer's identifier is an address, which no two runs share.
    return str(root.GetDisplayName() or "stage in memory") if root.anonymous else str(root.realPath or root.identifier)


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
        raise StageError(f"{source}: USD cannot read it: {_usd_reason(error)}: correct the file") from error
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


def _usd_reason(error: BaseException) -> str:
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


def open_stage(
    stage_or_path: Any,
    *,
    variants: Sequence[str] = (),
    overrides: Overrides = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
    also: Sequence[str] = (),
    diagnostics: Diagnostics,
) -> OpenedStage:
    """Open a file, or take a stage in memory, with the variants and values asked for.

    ``also`` are paths that a mask keeps if they are there; the other arguments are those of :func:`abbe.usd.describe`.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The file is no stage, or an override names what is not there.
    """
    if payloads not in ("all", "none"):
        raise UsageError(f"payloads '{payloads}': choose 'all' or 'none'")
    if isinstance(stage_or_path, Usd.Stage):
        opened = _from_memory(stage_or_path, search_paths)
        if payloads == "none":
            _own(opened)
            opened.stage.SetLoadRules(Usd.StageLoadRules.LoadNone())
    else:
        opened = _from_file(stage_or_path, search_paths, payloads == "all", diagnostics)
    if session_layer is not None:
        _add_session_layer(opened, os.fspath(session_layer))
    if mask:
        _mask(opened, mask, also)
    bring_in_documents(opened, diagnostics)
    _apply(opened, variants, overrides, diagnostics)
    if opened.stage.GetLoadRules() != Usd.StageLoadRules.LoadAll():
        unloaded = set(opened.stage.FindLoadable()) - set(opened.stage.GetLoadSet())
        if unloaded:
            diagnostics.skip("payload not loaded", len(unloaded))
    return opened


def _from_file(
    stage_or_path: Any, search_paths: Sequence[str | os.PathLike[str]], loads: bool, diagnostics: Diagnostics
) -> OpenedStage:
    try:
        path = os.fspath(stage_or_path)
    except TypeError:
        raise UsageError(
            f"stage: is a {type(stage_or_path).__name__}: give the path of a USD file or a pxr.Usd.Stage"
        ) from None
    if isinstance(path, bytes):
        path = os.fsdecode(path)
    context = _context(path, search_paths, diagnostics)
    root = _root_layer(path, context)
    session = _session_layer()
    load = Usd.Stage.LoadAll if loads else Usd.Stage.LoadNone
    stage = _compose(lambda: Usd.Stage.Open(root, session, context, load), path)
    return OpenedStage(stage, path, session, [root])


def _add_session_layer(opened: OpenedStage, path: str) -> None:
    """Put the layer ``path`` above all layers of the stage, below what else was asked for."""
    _own(opened)
    layer = _root_layer(path, opened.stage.GetPathResolverContext())
    if layer == opened.stage.GetRootLayer():
        raise UsageError(f"session layer {path}: is the stage itself: name another layer")
    # Stage metadata is read from the session's root layer alone.
    UsdUtils.CopyLayerMetadata(layer, opened.session, True)
    opened.session.subLayerPaths = [layer.identifier, *opened.session.subLayerPaths]
    opened.keep.append(layer)


# What a prim that a mask keeps needs beside its own: materials, prototypes, and what render settings name.
_NEEDED_TARGETS = (tokens.PROTOTYPES, tokens.PRODUCTS, tokens.ORDERED_VARS, tokens.CAMERA)


def _mask(opened: OpenedStage, paths: Sequence[str], also: Sequence[str]) -> None:
    """Leave out of the stage what is neither below ``paths`` nor needed by what is."""
    if isinstance(paths, str):
        raise UsageError("mask: is a list, not one string: put brackets around it")
    _own(opened)
    wanted = Usd.StagePopulationMask()
    for path in paths:
        if not path.startswith("/") or not Sdf.Path.IsValidPathString(path) or Sdf.Path(path).IsPropertyPath():
            raise UsageError(f"mask: '{path}' is no prim path: give one such as /World/Ball")
        wanted.Add(Sdf.Path(path))
    wanted = Usd.StagePopulationMask.Intersection(wanted, opened.stage.GetPopulationMask())
    settings = opened.stage.GetMetadata(tokens.RENDER_SETTINGS_PRIM_PATH)
    for path in (*also, *([settings] if settings else [])):
        if Sdf.Path.IsValidPathString(path) and Sdf.Path(path).IsPrimPath():
            wanted.Add(Sdf.Path(path))
    opened.stage.SetPopulationMask(wanted)
    for path in paths:
        if not opened.stage.GetPrimAtPath(path):
            raise StageError(f"<{path}>: there is no such prim in {opened.source}: correct mask '{path}'")
    while True:
        opened.stage.ExpandPopulationMask(relationshipPredicate=_is_needed)
        expanded = opened.stage.GetPopulationMask()
        # USD itself does not look into what instances share.
        for prototype in opened.stage.GetPrototypes():
            for prim in Usd.PrimRange(prototype):
                for relationship in filter(_is_needed, prim.GetAuthoredRelationships()):
                    for target in relationship.GetForwardedTargets():
                        if not Usd.Prim.IsPathInPrototype(target) and not expanded.Includes(target.GetPrimPath()):
                            expanded.Add(target.GetPrimPath())
        if expanded == opened.stage.GetPopulationMask():
            return
        opened.stage.SetPopulationMask(expanded)


def _is_needed(relationship: Any) -> bool:
    name = relationship.GetName()
    return name in _NEEDED_TARGETS or name.startswith(tokens.MATERIAL_BINDING)


def _session_layer() -> Any:
    return Sdf.Layer.CreateAnonymous("abbe-session.usda")


def _context(path: str, search_paths: Sequence[str | os.PathLike[str]], diagnostics: Diagnostics) -> Any:
    """Return the resolver context: the resolver's own for this file, with the search paths asked for behind it."""
    resolver = Ar.GetResolver()
    own = resolver.CreateDefaultContextForAsset(path)
    if not search_paths:
        return own
    folders = [Path(folder).absolute() for folder in search_paths]
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"search path {folder}: is no folder: correct or remove it")
    if not isinstance(Ar.GetUnderlyingResolver(), Ar.DefaultResolver):
        diagnostics.warn("search-path", path, "the site's own asset resolver is in use; search paths are ignored")
        return own
    beside = Path(path).absolute().parent
    return Ar.ResolverContext(Ar.DefaultResolverContext([str(folder) for folder in (beside, *folders)]))


def _root_layer(path: str, context: Any) -> Any:
    if not path:
        raise UsageError("stage: the path is empty: give that of a USD file")
    if Path(path).is_dir():
        raise StageError(f"{path}: is a folder, not a USD file: name the file in it")
    with Ar.ResolverContextBinder(context):
        if not Path(path).exists() and not Ar.GetResolver().Resolve(path):
            raise FileNotFoundError(f"{path}: there is no such file: check the path")
        try:
            layer = Sdf.Layer.FindOrOpen(path)
        except RuntimeError as error:
            if not Sdf.FileFormat.FindByExtension(path):
                raise _not_usd(path) from None
            raise StageError(f"{path}: cannot be read as USD: {_usd_reason(error)}: export it again") from None
    if not layer and not Sdf.FileFormat.FindByExtension(path):
        raise _not_usd(path)
    if not layer:
        raise StageError(f"{path}: is not a USD file (.usda, .usdc, .usd, .usdz), or it cannot be read: check the file")
    return layer


def _not_usd(path: str) -> NotUsdError:
    return NotUsdError(f"{path}: is not a USD file: name a .usd, .usda, .usdc or .usdz file")


def _compose(open_it: Any, source: str) -> Any:
    try:
        stage = open_it()
    except RuntimeError as error:
        raise StageError(f"{source}: cannot be composed: {_usd_reason(error)}: correct the file") from None
    if not stage:
        raise StageError(f"{source}: cannot be composed: correct the file")
    return stage


def _from_memory(stage: Any, search_paths: Sequence[str | os.PathLike[str]]) -> OpenedStage:
    if search_paths:
        raise UsageError("search_paths: a stage in memory is composed already: open it with them, or give its path")
    return OpenedStage(stage, source_name(stage))


def _own(opened: OpenedStage) -> None:
    """Replace the caller's own stage by a second one on the same layers, with a session layer of ours."""
    if opened.session is not None:
        return
    theirs = opened.stage.GetSessionLayer()
    opened.session = _session_layer()
    if theirs:
        # Stage metadata is read from the session's root layer alone.
        UsdUtils.CopyLayerMetadata(theirs, opened.session, True)
        opened.session.subLayerPaths = [theirs.identifier]
    opened.keep += [opened.stage, opened.stage.GetRootLayer(), theirs]
    _recompose(opened, opened.stage.GetRootLayer())


def _recompose(opened: OpenedStage, root: Any) -> None:
    """Compose anew from ``root`` and our session layer, with all else as the stage has it."""
    old = opened.stage
    context = old.GetPathResolverContext()
    mask = old.GetPopulationMask()
    # Payloads are loaded only once the rules are those of the other stage.
    stage = _compose(
        lambda: Usd.Stage.OpenMasked(root, opened.session, context, mask, Usd.Stage.LoadNone), opened.source
    )
    stage.MuteAndUnmuteLayers(old.GetMutedLayers(), [])
    stage.SetLoadRules(old.GetLoadRules())
    stage.SetInterpolationType(old.GetInterpolationType())
    opened.stage = stage


def bring_in_documents(opened: OpenedStage, diagnostics: Diagnostics) -> None:
    """Bring the MaterialX documents that the stage refers to onto it, where USD itself does not read them."""
    if Sdf.FileFormat.FindByExtension(tokens.MATERIALX_EXTENSION):
        return
    while True:
        errors = _composition_errors(opened.stage)
        named = {document_name(str(error)) for error in errors if isinstance(error, _UNREAD)}
        # What is muted somebody does not want.
        known = {*opened.documents, *opened.stage.GetMutedLayers()}
        wanted = sorted(name for name in named if name is not None and name not in known)
        if not wanted:
            return
        with Ar.ResolverContextBinder(opened.stage.GetPathResolverContext()):
            for identifier in wanted:
                if not Ar.GetResolver().Resolve(identifier):
                    opened.documents[identifier] = None
                    continue
                try:
                    opened.documents[identifier] = read_document(identifier, diagnostics)
                except DocumentError as error:
                    opened.documents[identifier] = str(error)
            layers = {name: opened.documents[name] for name in wanted if isinstance(opened.documents[name], Sdf.Layer)}
            if not layers:
                return
            _own(opened)
            root, copies = substitute(opened.stage, opened.session, layers)
        opened.keep += copies
        _recompose(opened, root)


def document_name(text: str) -> str | None:
    """Return the identifier of the MaterialX document that a composition error is about, None if about none."""
    named = _ASSET.search(text)
    identifier = named[1].partition(_FORMAT_ARGUMENTS)[0] if named else ""
    extension = Ar.GetResolver().GetExtension(identifier).lower()
    return identifier if extension == tokens.MATERIALX_EXTENSION else None


def _apply(opened: OpenedStage, variants: Sequence[str], overrides: Overrides, diagnostics: Diagnostics) -> None:
    if isinstance(variants, str) or isinstance(overrides, str):
        raise UsageError("variants, overrides: are lists, not one string: put brackets around it")
    if not variants and not overrides:
        return
    _own(opened)
    if variants:
        with Usd.EditContext(opened.stage, Usd.EditTarget(opened.session)):
            for text in variants:
                _select_variant(opened, text)
        bring_in_documents(opened, diagnostics)
    with Usd.EditContext(opened.stage, Usd.EditTarget(opened.session)):
        items = overrides.items() if isinstance(overrides, Mapping) else [_split_override(text) for text in overrides]
        for target, value in items:
            _set_value(opened, target, value)


_VARIANT = re.compile(r"^(?P<prim>[^{}]+)\{(?P<set>[^{}=]+)=(?P<name>[^{}=]*)\}$")


def _select_variant(opened: OpenedStage, text: str) -> None:
    """Select a variant, given as ``/World/Ball{material=glass}``; USD itself would accept names that do not exist."""
    match = _VARIANT.match(text.strip())
    if not match:
        raise UsageError(
            f"variant '{text}': is not of the form PRIM{{SET=NAME}}, such as /World/Ball{{material=glass}}"
        )
    prim = _prim(opened, match["prim"], f"variant '{text}'")
    sets = prim.GetVariantSets()
    if match["set"] not in sets.GetNames():
        raise StageError(f"{place(prim)}: has no variant set '{match['set']}': {_choice('sets', sets.GetNames())}")
    variant_set = sets.GetVariantSet(match["set"])
    if match["name"] not in variant_set.GetVariantNames():
        choice = _choice("variants", variant_set.GetVariantNames())
        raise StageError(f"{place(prim)}{{{match['set']}}}: has no variant '{match['name']}': {choice}")
    variant_set.SetVariantSelection(match["name"])


def _choice(what: str, names: Sequence[str]) -> str:
    return f"choose one of {', '.join(sorted(names))}" if names else f"it has no {what}"


def _prim(opened: OpenedStage, path: str, option: str) -> Any:
    if not Sdf.Path.IsValidPathString(path) or not Sdf.Path(path).IsAbsoluteRootOrPrimPath():
        raise UsageError(f"{option}: '{path}' is no prim path: give one such as /World/Ball")
    prim = opened.stage.GetPrimAtPath(Sdf.Path(path).MakeAbsolutePath(Sdf.Path.absoluteRootPath))
    if not prim:
        raise StageError(f"<{path}>: there is no such prim in {opened.source}: correct {option}")
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        raise StageError(f"{place(prim)}: lies in an instance, which USD does not override: correct {option}")
    return prim


def _split_override(text: str) -> tuple[str, str]:
    target, equals, value = text.partition("=")
    if not equals:
        raise UsageError(f"override '{text}': is not of the form PRIM.ATTR=VALUE, such as /World/Glass.inputs:ior=1.6")
    return target.strip(), value.strip()


def _set_value(opened: OpenedStage, target: str, value: Any) -> None:
    """Set an attribute of the session layer; text is read as .usda has it, in the attribute's own type."""
    option = f"override '{target}'"
    prim_path, dot, name = target.partition(".")
    if not dot or not name:
        raise UsageError(f"{option}: is no attribute: give one such as /World/Glass.inputs:ior")
    prim = _prim(opened, prim_path, option)
    attribute = prim.GetAttribute(name)
    if not attribute:
        attribute = _our_attribute(prim, name)
    if not attribute:
        near = sorted(a.GetName() for a in prim.GetAuthoredAttributes())
        raise StageError(f"{place(prim)}: has no attribute '{name}': {_choice('authored attributes', near)}")
    if attribute.HasAuthoredConnections():
        driver = attribute.GetConnections()[0]
        raise StageError(f"{place(prim)}.{name}: is driven by {place(driver)}, so a value has no effect: set that one")
    type_name = attribute.GetTypeName()
    if isinstance(value, str):
        value = _parse(value, type_name, f"{place(prim)}.{name}")
    try:
        done = attribute.Set(value)
    except (TypeError, RuntimeError):
        done = False
    if not done:
        raise StageError(f"{place(prim)}.{name} = {value}: is no value of type {type_name}: correct {option}")


def _our_attribute(prim: Any, name: str) -> Any:
    """Return an attribute of our own schemas, declared where the prim's type may carry it; else None."""
    for schema, names in tokens.OUR_SCHEMAS.items():
        if prim.GetTypeName() == schema and name in names:
            return prim.CreateAttribute(name, Sdf.ValueTypeNames.Find(names[name]), False)
    return None


def _parse(text: str, type_name: Any, where: str) -> Any:
    """Return the value that ``text`` means for a type, read by USD's own parser."""
    name = str(type_name)
    if name in ("string", "token"):
        return _unquoted(text)
    if name == "asset":
        return Sdf.AssetPath(_unquoted(text.strip("@")))
    problem = StageError(f"{where} = {text}: is no value of type {name}: write it as .usda does")
    if "\n" in text or "\r" in text:
        raise problem
    if name == "bool":
        text = {"true": "1", "false": "0"}.get(text.lower(), text)
    layer = Sdf.Layer.CreateAnonymous("abbe-value.usda")
    try:
        read = layer.ImportFromString(f'#usda 1.0\nover "x"\n{{\n    {name} value = {text}\n}}\n')
    except RuntimeError:
        read = False
    spec = layer.GetAttributeAtPath("/x.value") if read else None
    if spec is None or spec.default is None or len(layer.rootPrims) != 1 or len(layer.rootPrims[0].properties) != 1:
        raise problem
    if not set(spec.ListInfoKeys()) <= {"custom", "default", "typeName", "variability"}:
        raise problem
    return spec.default


def _unquoted(text: str) -> str:
    return text[1:-1] if len(text) >= 2 and text[0] == text[-1] and text[0] in "\"'" else text


def stage_time(stage: Any, frame: float | str | None) -> tuple[Any, float | None]:
    """Return the time code to read at, and its number (None where it has none).

    None means the stage's authored start; without one the earliest sample of each attribute, as usdrecord has it, so
    that attributes with time samples alone still have a value. ``"default"`` means the default values.
    """
    if isinstance(frame, str):
        if frame != "default":
            raise UsageError(f"frame '{frame}': is neither a number nor 'default'")
        return Usd.TimeCode.Default(), None
    if frame is None:
        if not stage.HasAuthoredMetadata(tokens.START_TIME_CODE):
            return Usd.TimeCode.EarliestTime(), None
        start = _metadata_number(stage, tokens.START_TIME_CODE)
        if start is None:
            return Usd.TimeCode.EarliestTime(), None
        frame = start
    frame = float(frame)
    if not math.isfinite(frame):
        raise UsageError(f"frame {frame}: is not finite: give a time code")
    return Usd.TimeCode(frame), frame


def _metadata_number(stage: Any, name: str) -> float | None:
    """Return a number of the stage's metadata, of whatever type it was authored: USD throws at a float for a double.

    The session layer is stronger than the root layer, as in UsdStage.
    """
    for layer in (stage.GetSessionLayer(), stage.GetRootLayer()):
        if layer and layer.pseudoRoot.HasInfo(name):
            value = layer.pseudoRoot.GetInfo(name)
            if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
                return float(value)
    return None


# UsdGeom's fallback: centimetres.
_CENTIMETRES = 0.01


def stage_metadata(opened: OpenedStage, time_code: float | None, diagnostics: Diagnostics) -> dict[str, Any]:
    """Return what the description says of the stage as a whole."""
    stage = opened.stage
    metres = _metadata_number(stage, tokens.METERS_PER_UNIT)
    if metres is not None and metres <= 0.0:
        diagnostics.warn(
            "unreadable-attribute",
            f"{opened.source}.{tokens.METERS_PER_UNIT}",
            f"{metres:g} metres per unit is no length; centimetres are taken",
        )
        metres = None
    up_axis = stage.GetMetadata(tokens.UP_AXIS)
    if up_axis not in ("Y", "Z"):
        diagnostics.warn(
            "unreadable-attribute", f"{opened.source}.{tokens.UP_AXIS}", f"'{up_axis}' is no up axis; Y is taken"
        )
        up_axis = "Y"
    result: dict[str, Any] = {
        "source": opened.source,
        "meters_per_unit": _CENTIMETRES if metres is None else metres,
        "up_axis": str(up_axis),
    }
    if time_code is not None:
        result["time_code"] = time_code
    for name in (tokens.FRAMES_PER_SECOND, tokens.TIME_CODES_PER_SECOND):
        rate = _metadata_number(stage, name)
        if rate is not None:
            result["frames_per_second"] = rate
            break
    return result


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

"""What is wrong with a stage before it is rendered: one table of validators, for ``abbe validate`` and for USD's own.

A validator is a plain function from a :class:`~abbe.validators.reading.Reading` of a stage to findings; it works with
every USD that abbe works with. Where USD has ``UsdValidation`` that takes validators from Python (26.05 and later) they
are also registered there, as ``abbe:Camera`` and so on with the keyword ``abbe``, for usdchecker, usdview and others.

What the core checks is asked of the core: a material is compiled as for a render, settings are planned as for a render,
and what that says is the finding. The stage is looked at where ``abbe render`` begins: at its start time code.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .reading import Reading

__all__ = ["VALIDATORS", "Finding", "Validator", "register_validators", "registered_validators", "validate"]

KEYWORD = "abbe"

Severity = Literal["error", "warning", "info"]
"""An error: it does not render, or not what was meant. A warning: it is unlikely to be meant. Info: worth knowing."""


@dataclass(frozen=True)
class Finding:
    """One thing that a validator found; ``str(finding)`` is one line with its place first."""

    validator: str
    """Name of the validator, such as ``abbe:Camera``."""
    kind: str
    """What it is, such as ``missing-camera``: the same word for the same thing everywhere, for scripts."""
    severity: Severity
    path: str
    """Path of the prim or property as USD has it; ``/`` for the stage."""
    place: str
    """The same as messages show it: ``</World/Glass>.abbe:glass``, or the stage's file."""
    message: str
    """What is wrong, and what to do."""

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


@dataclass(frozen=True)
class Validator:
    """A row of the table."""

    name: str
    doc: str
    module: str
    """Submodule that has the rule; imported, and USD with it, when the rule is first used."""
    function: str

    def run(self, reading: Reading) -> Iterator[Finding]:
        """Look at a stage."""
        rule: Callable[[Reading], Iterator[Finding]] = getattr(
            importlib.import_module(f"{__name__}.{self.module}"), self.function
        )
        return rule(reading)


VALIDATORS = (
    Validator("abbe:Stage", "The stage can be read as a render reads it.", "rendering", "stage"),
    Validator(
        "abbe:Dispersion", "Indices and dispersion laws are possible and hold where needed.", "materials", "dispersion"
    ),
    Validator("abbe:GlassName", "Glasses named in abbe:glass are in the catalogue.", "materials", "glass_name"),
    Validator(
        "abbe:AttributeNames",
        "Attributes in the namespace abbe are known, and where abbe reads them.",
        "materials",
        "attribute_names",
    ),
    Validator(
        "abbe:UnusedDispersion",
        "Dispersion is authored on materials that something uses, and on glass.",
        "materials",
        "unused_dispersion",
    ),
    Validator(
        "abbe:Units", "metersPerUnit is authored where absorption is given for physical lengths.", "materials", "units"
    ),
    Validator("abbe:ClosedGlass", "Meshes of glass are closed and oriented alike.", "solids", "closed"),
    Validator("abbe:GlassThickness", "Glass has a thickness or is thin-walled.", "solids", "thickness"),
    Validator("abbe:GlassOrientation", "Faces of glass look outwards.", "solids", "orientation"),
    Validator(
        "abbe:OverlappingGlass",
        "Where different glasses overlap, priorities decide which is there.",
        "solids",
        "overlapping",
    ),
    Validator("abbe:Camera", "There is a camera to render from.", "rendering", "camera"),
    Validator("abbe:RenderVars", "Render variables have a source that abbe knows.", "rendering", "render_vars"),
    Validator(
        "abbe:RenderSettings",
        "Render settings are possible, and what they ask for is there.",
        "rendering",
        "render_settings",
    ),
)
"""Every validator, in the order in which findings are listed."""


def validate(
    stage_or_path: Any,
    *,
    frame: float | Literal["default"] | None = None,
    variants: Sequence[str] = (),
    overrides: Mapping[str, Any] | Sequence[str] = (),
    search_paths: Sequence[str | os.PathLike[str]] = (),
    session_layer: str | os.PathLike[str] | None = None,
    mask: Sequence[str] = (),
    payloads: str = "all",
    purposes: Sequence[str] | None = None,
    missing: str = "warn",
    validators: Sequence[str] | None = None,
) -> list[Finding]:
    """Look at a stage with every validator.

    Parameters
    ----------
    stage_or_path : path of a .usd, .usda, .usdc or .usdz file, or a ``pxr.Usd.Stage``, which is not changed
    frame, variants, overrides, search_paths, session_layer, mask, payloads, purposes, missing : as for
        :func:`abbe.render`
    validators : names of :data:`VALIDATORS`; all if None

    Returns
    -------
    list of Finding
        In the order of the table; empty if nothing is wrong.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    StageError
        The file cannot be opened as a stage at all.
    UsageError
        An argument is not understood.
    UsdMissingError
        No ``pxr`` can be imported.
    """
    from ..errors import UsageError
    from .reading import read

    known = {validator.name: validator for validator in VALIDATORS}
    unknown = [name for name in validators or () if name not in known]
    if unknown:
        raise UsageError(f"validators: there is no '{unknown[0]}': choose from {', '.join(known)}")
    chosen = VALIDATORS if validators is None else tuple(known[name] for name in validators)
    with read(
        stage_or_path,
        frame=frame,
        variants=variants,
        overrides=overrides,
        search_paths=search_paths,
        session_layer=session_layer,
        mask=mask,
        payloads=payloads,
        purposes=purposes,
        missing=missing,
    ) as reading:
        return [finding for validator in chosen for finding in validator.run(reading)]


def _validation_registry() -> Any:
    """Return USD's registry of validators; None where there is none, or none that Python can add to."""
    try:
        validation: Any = importlib.import_module("pxr.UsdValidation")
    except ImportError:
        return None
    registry = validation.ValidationRegistry()
    return registry if hasattr(registry, "RegisterStageValidator") else None


def register_validators() -> None:
    """Add the validators to USD's own registry, if there is one that takes them; those that are there stay."""
    registry = _validation_registry()
    if registry is None:
        return
    validation: Any = importlib.import_module("pxr.UsdValidation")
    for validator in VALIDATORS:
        if not registry.HasValidator(validator.name):
            metadata = validation.ValidatorMetadata(name=validator.name, doc=validator.doc, keywords=[KEYWORD])
            registry.RegisterStageValidator(metadata, _task(validator, validation))


def registered_validators() -> int | None:
    """Return how many of the validators USD's registry has; None where it takes none from Python."""
    registry = _validation_registry()
    return None if registry is None else sum(registry.HasValidator(validator.name) for validator in VALIDATORS)


def _task(validator: Validator, validation: Any) -> Callable[[Any, Any], list[Any]]:
    types = {
        "error": validation.ValidationErrorType.Error,
        "warning": validation.ValidationErrorType.Warn,
        "info": validation.ValidationErrorType.Info,
    }

    def task(stage: Any, _time_range: Any = None) -> list[Any]:
        sdf: Any = importlib.import_module("pxr.Sdf")
        errors = []
        for finding in validate(stage, validators=[validator.name]):
            site = validation.ValidationErrorSite(stage, sdf.Path(finding.path))
            name = finding.kind.title().replace("-", "")
            errors.append(validation.ValidationError(name, types[finding.severity], [site], str(finding)))
        return errors

    return task

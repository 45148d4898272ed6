"""Render USD stages with dispersive glass, and learn how everything seen moves with wavelength.

>>> import abbe
>>> film = abbe.render("prism.usda", aovs=["dispersion"])
>>> film["dispersion"].shape
(540, 960, 2)

Wavelengths are in nanometres, lengths in stage units; pixel vectors are +x right and +y up while array rows run down.
USD, OpenImageIO and Pillow are imported when they are needed; ``pip install 'abbe[all]'`` brings them. Importing this
package makes its USD schemas known to a USD that is there.
"""

from __future__ import annotations

from . import schemas as _schemas
from . import spectrum
from ._api import Plan, Progress, Scene, integrators, merge, progressive, render
from ._core import Film, __version__
from .catalog import Glass, glass, glasses, nearest_glass
from .errors import AbbeError, StageError, UsageError, UsdMissingError
from .manifest import Manifest
from .optics import Dispersion, Reflected, Refracted, Transferred, reflect, refract, transfer

__all__ = [
    "AbbeError",
    "Dispersion",
    "Film",
    "Glass",
    "Manifest",
    "Plan",
    "Progress",
    "Reflected",
    "Refracted",
    "Scene",
    "StageError",
    "Transferred",
    "UsageError",
    "UsdMissingError",
    "__version__",
    "glass",
    "glasses",
    "integrators",
    "merge",
    "nearest_glass",
    "progressive",
    "reflect",
    "refract",
    "render",
    "spectrum",
    "transfer",
]

_schemas.register()

"""Colours for numbers: the maps of the preview, as sRGB in 0..1."""

from __future__ import annotations

import numpy as np

__all__ = ["VIRIDIS", "hue_and_lightness", "srgb", "viridis"]

VIRIDIS = (
    np.frombuffer(
        bytes.fromhex(
            "440154 470d60 48186a 482374 472d7b 453781 424086 3e4989 3b528b 375b8d 33638d 2f6b8e 2c728e 297a8e 26828e "
            "23898e 21918c 1f988b 1fa088 22a785 28ae80 32b67a 3fbc73 4ec36b 5ec962 70cf57 84d44b 98d83e addc30 c2df23 "
            "d8e219 ece51b fde725"
        ),
        np.uint8,
    ).reshape(-1, 3)
    / 255
)


def viridis(t: np.ndarray) -> np.ndarray:
    """The colour map at 0..1, clamped; shape (..., 3)."""
    at = np.clip(t, 0, 1) * (len(VIRIDIS) - 1)
    low = np.minimum(at.astype(np.intp), len(VIRIDIS) - 2)
    part = (at - low)[..., np.newaxis]
    colours: np.ndarray = VIRIDIS[low] * (1 - part) + VIRIDIS[low + 1] * part
    return colours


def hue_and_lightness(angle: np.ndarray, amount: np.ndarray) -> np.ndarray:
    """OKLCh by direction and magnitude 0..1 (clamped) as sRGB; the greatest chroma that sRGB has for every hue."""
    amount = np.clip(amount, 0, 1)
    lightness = 0.75 * amount
    chroma = 0.127 * amount
    # Hue 0.5 rad, a red, points along +x.
    a, b = chroma * np.cos(angle + 0.5), chroma * np.sin(angle + 0.5)
    cone = np.stack(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ],
        axis=-1,
    )
    from_cone = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return srgb(cone**3 @ from_cone.T)


def srgb(linear: np.ndarray) -> np.ndarray:
    """Linear Rec.709, clamped to 0..1, as sRGB."""
    linear = np.clip(linear, 0, 1)
    coded: np.ndarray = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return coded

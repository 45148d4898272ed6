"""Makes the pictures of README.md with the product: ``python docs/pictures.py [NAME ...]`` writes docs/images/.

No light is computed. Every material has one flat colour here, looked up by `refracted_material_id`, so that a picture
shows where the glass leads the eye at each wavelength and nothing else.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

import abbe
from abbe.glass_plot import write_plot
from abbe.preview import write_preview

HERE = Path(__file__).parent
STAGES = HERE.parent / "stages"
IMAGES = HERE / "images"

# Linear colours of the stages' opaque materials.
COLOURS = {
    "White": (0.85, 0.83, 0.78),
    "Ink": (0.03, 0.03, 0.04),
    "Blue": (0.08, 0.2, 0.55),
    "Red": (0.6, 0.05, 0.04),
    "Grey": (0.35, 0.35, 0.35),
    "Dark": (0.1, 0.1, 0.1),
    "Black": (0.015, 0.015, 0.015),
    "Slate": (0.07, 0.08, 0.09),
    "Bright": (1.0, 1.0, 1.0),
}


def plate(film: abbe.Film) -> np.ndarray:
    """Return what is seen through the glass in flat linear colours, shape (height, width, 3)."""
    paths = json.loads(str(film.metadata["abbe:materialManifest"]))
    palette = [(0.0, 0.0, 0.0), *(COLOURS.get(path.rsplit("/", 1)[1], (0.0, 0.0, 0.0)) for path in paths)]
    return np.array(palette)[film["refracted_material_id"][..., 0]]


def fetch(image: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return one channel looked up at pixel + offset, bilinear; rows run down, offsets +y up."""
    height, width = image.shape
    y, x = np.mgrid[:height, :width]
    x = np.clip(x + offset[..., 0], 0, width - 1.001)
    y = np.clip(y - offset[..., 1], 0, height - 1.001)
    x0, y0 = x.astype(int), y.astype(int)
    u, v = x - x0, y - y0
    top = image[y0, x0] * (1 - u) + image[y0, x0 + 1] * u
    bottom = image[y0 + 1, x0] * (1 - u) + image[y0 + 1, x0 + 1] * u
    return top * (1 - v) + bottom * v


def response(nm: np.ndarray) -> np.ndarray:
    """Return linear Rec.709 of monochromatic light, shape (wavelengths, 3), equal energy scaled to white.

    Colour matching functions: Wyman, Sloan, Shirley 2013, multi-lobe fit.
    """

    def lobe(height: float, centre: float, below: float, above: float) -> np.ndarray:
        return height * np.exp(-0.5 * ((nm - centre) * np.where(nm < centre, below, above)) ** 2)

    x = lobe(0.362, 442, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.049, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437, 0.0845, 0.0278) + lobe(0.681, 459, 0.0385, 0.0725)
    matrix = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    rgb = np.stack([x, y, z], -1) @ np.transpose(matrix)
    return rgb / rgb.sum(0)


def pixels(image: np.ndarray, smaller: int = 2) -> np.ndarray:
    """Return linear colours as sRGB bytes, averaged over squares of `smaller` pixels."""
    height, width = (n // smaller * smaller for n in image.shape[:2])
    blocks = image[:height, :width].reshape(height // smaller, smaller, width // smaller, smaller, 3)
    linear = np.clip(blocks.mean((1, 3)), 0, 1)
    coded = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (coded * 255 + 0.5).astype(np.uint8)


def save(name: str, *images: np.ndarray) -> None:
    """Write images side by side."""
    gap = np.full((images[0].shape[0], 6, 3), 255, np.uint8)
    row = [part for image in images for part in (gap, image)][1:]
    Image.fromarray(np.concatenate(row, 1)).quantize(255).save(IMAGES / f"{name}.png", optimize=True)


def spectrum(
    stage: str, crop: tuple[int, int, int, int], count: int, **options: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the view at the reference wavelength, and the sum of `count` views over 400 to 680 nm."""
    scene = abbe.Scene.from_stage(STAGES / stage)
    request = {"width": 1280, "crop": crop, "aovs": ["refracted_material_id"], **options}
    wavelengths = np.linspace(400, 680, count)
    weights = response(wavelengths)
    total = sum(
        plate(scene.render(wavelength=nm, **request)) * weight for nm, weight in zip(wavelengths, weights, strict=True)
    )
    return pixels(plate(scene.render(**request))), pixels(total)


def prism() -> None:
    """The target through the prism, at one wavelength and over the spectrum."""
    save("prism", *spectrum("prism.usda", (400, 0, 1120, 720), 57))


def gem() -> None:
    """Fire."""
    save("gem", *spectrum("gem.usda", (240, 60, 1040, 720), 29))


def composite() -> None:
    """Clean plate, plate with fetch offsets applied, and what the renderer sees at the three wavelengths."""
    scene = abbe.Scene.from_stage(STAGES / "ball.usda")
    request = {"width": 1280, "dispersion_scale": 8, "crop": (340, 60, 940, 660)}
    film = scene.render(aovs=["refracted_material_id", "dispersion_r", "dispersion_g", "dispersion_b"], **request)
    clean = plate(film)
    dispersed = np.stack([fetch(clean[..., i], film[f"dispersion_{c}"]) for i, c in enumerate("rgb")], -1)
    wavelengths = [float(text.split()[1]) for text in str(film.metadata["abbe:channelWavelengths"]).split(",")]
    exact = np.stack(
        [
            plate(scene.render(wavelength=nm, aovs=["refracted_material_id"], **request))[..., i]
            for i, nm in enumerate(wavelengths)
        ],
        -1,
    )
    save("composite", pixels(clean), pixels(dispersed), pixels(exact))


def layers() -> None:
    """Contact sheets, as --preview writes them."""
    chosen = {"gem": ["dispersion", "dispersion_footprint"], "lens": ["dispersion", "dispersion2"]}
    for stage, aovs in chosen.items():
        film = abbe.render(STAGES / f"{stage}.usda", width=800, aovs=aovs)
        write_preview(film, IMAGES / f"{stage}_layers.png")


def glass() -> None:
    """Curves of a glass, as `abbe glass show --plot` draws them."""
    write_plot(IMAGES / "glass.png", abbe.glass("SCHOTT:N-SF11"))


PICTURES = {make.__name__: make for make in (prism, gem, composite, layers, glass)}

if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    for wanted in sys.argv[1:] or PICTURES:
        PICTURES[wanted]()

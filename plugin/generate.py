"""Makes plugInfo.json and generatedSchema.usda from schema.usda, with the usdGenSchema that usd-core brings.

    python plugin/generate.py [FOLDER]

Needs usd-core and jinja2. FOLDER is where the two files go, by default beside this script.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent


def generate(folder: Path) -> None:
    """Write the generated files of the plug-in.

    Parameters
    ----------
    folder : existing folder for plugInfo.json and generatedSchema.usda

    Raises
    ------
    subprocess.CalledProcessError
        usdGenSchema refused schema.usda; its output says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        # The generator must not find an older version of these very schemas.
        environment = {name: value for name, value in os.environ.items() if name != "PXR_PLUGINPATH_NAME"}
        subprocess.run(
            [sys.executable, "-m", "pxr.Usd.usdGenSchema", str(HERE / "schema.usda"), scratch],
            check=True,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        shutil.copyfile(Path(scratch, "generatedSchema.usda"), folder / "generatedSchema.usda")
        # The generator precedes its JSON with comments, which only USD's own reader accepts.
        lines = Path(scratch, "plugInfo.json").read_text(encoding="utf-8").splitlines()
    document = json.loads("\n".join(line for line in lines if not line.lstrip().startswith("#")))
    for plugin in document["Plugins"]:
        # One flat folder without a library, found through PXR_PLUGINPATH_NAME or Plug.Registry().RegisterPlugins.
        plugin.pop("LibraryPath", None)
        plugin.update(Type="resource", Root=".", ResourcePath=".")
    text = json.dumps(document, indent=4, sort_keys=True) + "\n"
    (folder / "plugInfo.json").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    generate(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)

"""Make the three shipped datasets again, byte for byte: `python datasets/make.py` (or with a folder of your own)."""

import sys
from pathlib import Path

from eaid.options import EXPERIMENTS, SynthOptions
from eaid.synth.files import write
from eaid.synth.synthesize import synthesize


def make(folder: Path, force: bool = False) -> dict[str, Path]:
    """Write all three into a folder; by kind, where."""
    paths = {str(kind): folder / f"{kind}.h5" for kind in EXPERIMENTS}
    for kind, path in zip(EXPERIMENTS, paths.values(), strict=True):
        write(path, synthesize(SynthOptions(kind=kind)), force)
    return paths


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for kind, path in make(folder, force=True).items():
        print(f"{path}: {kind}, {path.stat().st_size / 1e6:.2f} MB")

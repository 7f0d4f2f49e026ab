"""Make the three shipped datasets again, byte for byte: `python datasets/make.py` (or with a folder of your own)."""

import sys
from pathlib import Path

from eaid.synth.datasets import make

if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for kind, path in make(folder, force=True).items():
        print(f"{path}: {kind}, {path.stat().st_size / 1e6:.2f} MB")

"""`python -m eaid`, and the `eaid` script."""

import sys

from eaid.cli.signals import breaking_off


def main() -> None:
    """Entry point of the `eaid` script."""
    try:
        with breaking_off():
            from eaid.cli.main import run

            code = run()
    except KeyboardInterrupt:  # while modules were still being imported
        print("error: interrupted; nothing half-written is left", file=sys.stderr)
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    main()

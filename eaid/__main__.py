"""`python -m eaid`."""

from eaid.cli.main import main

if __name__ == "__main__":
    main()

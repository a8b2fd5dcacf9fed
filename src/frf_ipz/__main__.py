"""``python -m frf_ipz``: the command line without its script."""

from frf_ipz.cli.main import main

if __name__ == "__main__":
    main()

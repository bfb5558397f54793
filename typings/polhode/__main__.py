"""``python -m polhode`` is the command `polhode`."""

from polhode.harness.cli import main

if __name__ == "__main__":
    main()

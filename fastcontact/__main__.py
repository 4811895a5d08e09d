"""Entry point of ``python -m fastcontact``."""

from fastcontact.cli import entry_point

if __name__ == "__main__":
    entry_point()

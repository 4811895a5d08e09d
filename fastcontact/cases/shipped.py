"""Ready-made cases: the case files that come with the package, available by name."""

from __future__ import annotations

from pathlib import Path

from fastcontact.errors import CaseError, check_known

_PACKAGE = Path(__file__).resolve().parents[1]
# The folders in an installed package and in a checkout.
_FOLDERS = (_PACKAGE / "data" / "cases", _PACKAGE.parent / "data" / "cases")


def shipped_cases() -> dict[str, Path]:
    """Return the case files that come with fastcontact by name, in alphabetical order."""
    folder = next((folder for folder in _FOLDERS if folder.is_dir()), None)
    return {} if folder is None else {path.stem: path for path in sorted(folder.glob("*.toml"))}


def shipped_case(name: str) -> Path:
    """Return the case file of a ready-made case; raises CaseError if there is none, with the nearest names."""
    cases = shipped_cases()
    check_known("ready-made case", name, cases, CaseError)
    return cases[name]


def case_path(given: str | Path) -> Path:
    """Return the file of a path, or of the name of a ready-made case if there is no such file; raises CaseError if none."""
    path = Path(given)
    try:
        if path.exists() or path.suffix or path.name != str(given):
            return path
        if path.name == "-":  # the standard input, to other programs
            return Path("/dev/stdin")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"cannot look for the case file '{str(given)[:200]}' ({reason}): check its name") from None
    try:
        return shipped_case(path.name)
    except CaseError as error:
        raise CaseError(f"cannot read the case file '{given}': it does not exist, and {error}") from None

"""Commands of the command line."""

from fastcontact.cli import main


def output_of(capsys, arguments, code=0):
    """Run a command that must end with an exit code, and return what it prints: to standard error where it fails."""
    assert main(arguments) == code
    shown = capsys.readouterr()
    return shown.err if code else shown.out

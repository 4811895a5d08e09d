"""Run the code blocks of README and docs page by page, each page in a separate folder.

A page is run from top to bottom. Fences ``python`` share one namespace; lines of fences ``sh`` that begin with
``fastcontact`` run in this process, ``python`` lines with this interpreter, and the rest in bash. A ``{code-block}`` with
the option ``caption: NAME`` is the file NAME. A block that needs something says so in a comment right above it::

    <!-- needs: network -->          run by hand only
    <!-- needs: mpiexec mpi4py -->   run where these programs and modules are there

``python tests/docs/pages.py`` runs all pages that show pictures and stores the pictures that their commands made.
"""

import contextlib
import importlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FENCE = re.compile(r"^(?P<fence>`{3,})(?P<language>\S*)[ \t]*(?P<argument>[^\n`]*)$")
NEEDS = re.compile(r"^<!--\s*needs:\s*(?P<what>.*?)\s*-->$")
PICTURE = re.compile(r"!\[[^\]]*\]\((?P<path>[^)\s]+\.png)\)")
# What a stored picture may have: bytes, dots across, colours.
LARGEST, WIDEST, COLOURS = 60_000, 1000, 256
FILE = re.compile(r"^:caption:\s*(?P<name>\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, text, first line in the page, and what it needs."""

    language: str
    text: str
    line: int
    needs: tuple[str, ...] = ()
    file: str = ""

    @property
    def missing(self) -> list[str]:
        """What the block needs and is not there."""
        return [name for name in self.needs if not available(name)]


PLACES = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])


def available(name: str) -> bool:
    """Whether a program or module is there and can be used; the network never is."""
    if name == "network":
        return False
    if shutil.which(name, path=PLACES) is not None:
        return True
    try:
        importlib.import_module(name)
    except (ImportError, OSError):  # gmsh is installed, but a library of the system that it needs is not
        return False
    return True


def pages() -> list[Path]:
    """Return the README and all pages of the documentation."""
    return [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)]


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page."""
    found: list[Block] = []
    needs: tuple[str, ...] = ()
    opening: re.Match[str] | None = None
    start, inside = 0, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        match = FENCE.match(line.strip())
        if opening is None and match:
            opening, start, inside = match, number, []
        elif opening is not None and line.strip() == opening["fence"]:
            found.append(_block(opening, inside, start, needs))
            opening, needs = None, ()
        elif opening is not None:
            inside.append(line)
        elif said := NEEDS.match(line.strip()):
            needs = tuple(said["what"].split())
        elif line.strip() and not line.startswith("<!--"):
            needs = ()
    assert opening is None, f"{page}:{start}: the fence is not closed"
    return found


def _block(opening: re.Match[str], lines: list[str], start: int, needs: tuple[str, ...]) -> Block:
    text = "\n".join(lines) + "\n"
    if opening["language"] != "{code-block}":
        return Block(opening["language"], text, start, needs)
    named = FILE.search(text)
    body = re.sub(r"^:[a-z-]+:.*\n", "", text, flags=re.MULTILINE).lstrip("\n")
    return Block(opening["argument"].strip(), body, start, needs, named["name"] if named else "")


def runnable(block: Block) -> bool:
    """Whether running a page does something with the block."""
    return bool(block.file) or block.language in ("python", "sh")


def pictures(page: Path) -> list[Path]:
    """Return the files of the pictures that a page shows."""
    text = page.read_text(encoding="utf-8")
    return [(page.parent / found["path"]).resolve() for found in PICTURE.finditer(text)]


def run_page(page: Path, folder: Path) -> list[Block]:
    """Run all blocks of a page in `folder`; return those left out because something is missing."""
    if not (folder / "data").exists():
        (folder / "data").symlink_to(ROOT / "data")
    namespace: dict[str, Any] = {"__name__": f"blocks of {page.name}"}
    left_out = []
    with contextlib.chdir(folder):
        for block in blocks(page):
            if runnable(block) and block.missing:
                left_out.append(block)
            elif runnable(block):
                run_block(block, page, namespace)
    return left_out


def run_block(block: Block, page: Path, namespace: dict[str, Any]) -> None:
    """Run one block in the current folder."""
    if block.file:
        Path(block.file).write_text(block.text, encoding="utf-8")
    elif block.language == "python":
        # Empty lines before it, so that a traceback shows the line of the page.
        exec(compile("\n" * block.line + block.text, str(page), "exec"), namespace)
    else:
        for command in commands(block):
            run_command(command, f"{page.name}:{block.line}")


def commands(block: Block) -> Iterator[str]:
    """Give the commands of a ``sh`` block, continued lines joined; one with other programs is one script."""
    lines = [line for line in block.text.replace("\\\n", " ").splitlines() if line.strip() and line[0] != "#"]
    if all(line.split()[0] in ("fastcontact", "python") for line in lines):
        yield from lines
    else:
        yield block.text


def run_command(command: str, where: str) -> None:
    """Run a command; it must end well."""
    words = shlex.split(command, comments=True)
    if words[0] == "fastcontact":
        from fastcontact.cli import main

        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                code = main(words[1:])
            except SystemExit as done:  # --version and --help
                code = done.code
        assert not code, f"{where}: '{command}' returned {code}:\n{said.getvalue()}"
        return
    whole = [sys.executable, *words[1:]] if words[0] == "python" else ["bash", "-euo", "pipefail", "-c", command]
    environment = {**os.environ, "PATH": PLACES}
    done = subprocess.run(whole, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, f"{where}: '{command}' returned {done.returncode}:\n{done.stdout}{done.stderr}"


def store_small(made: Path, path: Path) -> None:
    """Store a picture in few colours, and as wide as leaves it below LARGEST."""
    from PIL import Image

    with Image.open(made) as found:
        picture = found.convert("RGB")
    for width in range(min(WIDEST, picture.width), 300, -40):
        height = round(picture.height * width / picture.width)
        small = picture.resize((width, height), Image.Resampling.LANCZOS)
        # Rare colours stay, such as that of a ring around a place.
        few = small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE)
        few.save(path, optimize=True)
        if path.stat().st_size <= LARGEST:
            return


def store_pictures() -> None:
    """Run every page that shows pictures and keep those its commands made."""
    for page in pages():
        shown = pictures(page)
        if not shown:
            continue
        with tempfile.TemporaryDirectory() as folder:
            run_page(page, Path(folder))
            for path in shown:
                made = Path(folder) / path.name
                if made.is_file():
                    path.parent.mkdir(exist_ok=True)
                    store_small(made, path)
                    print(f"{page.relative_to(ROOT)}: {path.relative_to(ROOT)}")


if __name__ == "__main__":
    store_pictures()

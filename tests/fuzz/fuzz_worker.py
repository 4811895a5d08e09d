"""A process that generates and reads damaged files under limits of memory and time.

Takes numbers from its standard input, a line each, and answers with a line of JSON.
"""

import ctypes
import json
import os
import resource
import sys
import time
import warnings
from pathlib import Path

import fuzz_files
import fuzz_readers

import fastcontact

MEMORY = 1 << 30  # bytes more than before a file is read
SECONDS = int(os.environ.get("FUZZ_SECONDS", 10))  # of CPU time, a file
# Files that are read in this process, and one of those that are read in a process of their own.
FIRST_READ = (".med", ".rmed", ".vtkhdf", ".toml", ".deck", ".inp")
_OPENED = 0x20 | 0x2 | 0x100 | 0x200  # IN_OPEN, IN_MODIFY, IN_CREATE, IN_DELETE


# Where Python, the libraries and fastcontact itself read from.
CODE = (sys.prefix, sys.base_prefix, os.path.dirname(fastcontact.__file__), "/proc", "/sys", "/dev", "/usr/lib")


class Watch:
    """Tells whether anything was opened or changed in a folder, also by libraries (Linux only)."""

    def __init__(self, folder: Path) -> None:
        library = ctypes.CDLL(None, use_errno=True)
        self._file = library.inotify_init1(os.O_NONBLOCK) if hasattr(library, "inotify_init1") else -1
        if self._file >= 0:
            library.inotify_add_watch(self._file, os.fsencode(folder), _OPENED)

    def touched(self) -> bool:
        try:
            return bool(os.read(self._file, 1 << 16)) if self._file >= 0 else False
        except BlockingIOError:
            return False


class Opened:
    """Collects the files that Python opens or changes while it is on, other than those in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.on, self.names, self._folder = False, [], os.fspath(folder)
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple) -> None:
        if not self.on or event not in ("open", "os.remove", "os.rename", "os.mkdir", "subprocess.Popen", "os.system"):
            return
        name = arguments[0]
        if not isinstance(name, (str, bytes)):
            return
        full = os.path.realpath(os.fsdecode(name).replace("\0", "?"))
        known = full.startswith((self._folder, *CODE))
        if not known and "__pycache__" not in full and not full.endswith((".py", ".pyc", ".med")):
            self.names.append(f"{event} {full}")


def _address_space() -> int:
    """Return what this process has taken so far [bytes]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


def _made(number: int, seed: int, seeds: dict[str, Path], folder: Path, outside: Path) -> tuple[str, Path]:
    """Make a file in a child: what HDF5 does to itself on the way there is no matter of who reads the file."""
    child = os.fork()
    if not child:
        status = 1
        try:
            fuzz_files.make_file(number, seed, seeds, folder, outside)
            status = 0
        finally:
            os._exit(status)
    os.waitpid(child, 0)  # what it had written when it died is a damaged file as well
    _, name, file_name = fuzz_files.chosen(number, seed, seeds)
    return name, folder / file_name


def main() -> None:
    """Answer until the input ends."""
    seed, seeds_folder, folder, outside = int(sys.argv[1]), *map(Path, sys.argv[2:5])
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    seeds = {name: seeds_folder / file for name, file in json.loads((seeds_folder / "seeds.json").read_text()).items()}
    warnings.simplefilter("ignore")
    for path in {path.suffix: path for path in seeds.values() if path.suffix in FIRST_READ}.values():
        fuzz_readers.outcome(path)  # what it imports and compiles is no matter of a damaged file
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    opened = Opened(folder)
    print(json.dumps({"ready": True}), file=answers, flush=True)
    for line in sys.stdin:
        number = int(line)
        name, path = _made(number, seed, seeds, folder, outside)
        # Named before it is read, so that the file is known if reading kills this process.
        print(json.dumps({"number": number, "name": name, "path": str(path)}), file=answers, flush=True)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + SECONDS + 1, hard))
        resource.setrlimit(resource.RLIMIT_AS, (_address_space() + MEMORY, most))
        watch, started = Watch(outside), time.process_time()
        opened.on, opened.names = True, []
        kind, message = fuzz_readers.outcome(path)
        opened.on = False
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        if watch.touched() or opened.names:
            kind, message = "outside", f"{opened.names} {message}"
        if watch._file >= 0:
            os.close(watch._file)
        seconds = time.process_time() - started
        print(json.dumps({"kind": kind, "message": message[:500], "seconds": seconds}), file=answers, flush=True)


if __name__ == "__main__":
    main()

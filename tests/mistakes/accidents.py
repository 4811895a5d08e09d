"""Failures of output files: functions that provoke them, the command, and a pattern of the message."""

import errno
import os

from fastcontact._tools import hdf5, paths
from fastcontact.results import file_lock


def full_disk(patch, folder):
    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    patch.setattr(hdf5.DriverFile, "_put", refuse)


def protected_folder(patch, folder):
    patch.setattr(paths, "_may_write", lambda path: not path.is_dir())


def protected_file(patch, folder):
    (folder / "old.vtkhdf").touch()
    patch.setattr(paths, "_may_write", lambda path: path.is_dir())


def other_writer(patch, folder):
    # Kept by the patch until the test ends.
    patch.setattr(file_lock, "held_by_a_test", file_lock.PathLock(folder / "busy.vtkhdf"), raising=False)


def other_results(patch, folder):
    (folder / "text.vtkhdf").write_text("these are no results\n")


def pipe(patch, folder):
    os.mkfifo(folder / "pipe.vtkhdf")


# fmt: off
ACCIDENTS = [
    ("the disk is full", full_disk, ["run", "case.toml"],
     r"'.*case\.vtkhdf' cannot be written \(No space left on device\): check the disk space"),
    ("the folder is write-protected", protected_folder, ["run", "case.toml"],
     r"folder '.*' is write-protected: name a file in another folder"),
    ("the result file is write-protected", protected_file, ["run", "case.toml", "-o", "old.vtkhdf"],
     r"'.*old\.vtkhdf' is write-protected: remove the protection or name another file"),
    ("another run writes the result file", other_writer, ["run", "case.toml", "-o", "busy.vtkhdf"],
     r"'.*busy\.vtkhdf' is being written by process \d+: wait for it or name another file"),
    ("the result file exists and is another kind of file", other_results, ["run", "case.toml", "-o", "text.vtkhdf"],
     r"'.*text\.vtkhdf' exists and is not a result file: name another file or remove it first"),
    ("the result file is a pipe", pipe, ["run", "case.toml", "-o", "pipe.vtkhdf"],
     r"'.*pipe\.vtkhdf' is a device or a pipe: name a regular file"),
]
# fmt: on

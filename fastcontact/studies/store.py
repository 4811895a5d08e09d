"""How finished runs are kept: a folder with one JSON file a run, so that an interrupted study goes on where it stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fastcontact.errors import FileError
from fastcontact.mesh.files.paths import replacing
from fastcontact.studies.job import Job


class Store:
    """A folder of finished runs, named by the keys of their jobs; made if it is not there.

    Raises FileError if it cannot be made.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"the folder '{folder}' cannot be made: {error.strerror}; name another store") from error

    def path(self, job: Job) -> Path:
        """Return where the result of a run is kept."""
        return self.folder / f"{job.key}.json"

    def get(self, job: Job) -> dict[str, Any] | None:
        """Return the result of a run, or None if it is not there or was not written whole."""
        try:
            stored = json.loads(self.path(job).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        result = stored.get("result") if isinstance(stored, dict) else None
        return result if isinstance(result, dict) and "values" in result else None

    def put(self, job: Job, result: dict[str, Any]) -> None:
        """Keep the result of a run; the file appears whole or not at all.

        Raises FileError if it cannot be written.
        """
        text = json.dumps({"label": job.label, "case": job.name, "marks": job.marks, "result": result}, default=str)
        with replacing(self.path(job)) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

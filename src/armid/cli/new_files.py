"""Write results whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from armid.model import ArmidError


class NewFiles:
    """Write files beside a folder and move them in when all are there, so that nothing half-written is found.

    names: the files so far. A folder that is made for them goes again when nothing comes into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: list[str] = []

    def __enter__(self) -> "NewFiles":
        if self.folder.exists() and not self.folder.is_dir():
            raise ArmidError(f"--out {self.folder} is a file: a folder is expected")
        self._is_new = not self.folder.exists()
        self.folder.mkdir(parents=True, exist_ok=True)
        self._beside = TemporaryDirectory(dir=self.folder, prefix=".armid-")
        return self

    @property
    def place(self) -> Path:
        """Where the files are until all are there."""
        return Path(self._beside.name)

    def path(self, name: str) -> Path:
        """Return where to write a file for now.

        Raises ArmidError when a folder has its name.
        """
        if (self.folder / name).is_dir():
            raise ArmidError(f"--out {self.folder} holds a folder {name}: a place for a file of that name is expected")
        self.names.append(name)
        path = self.place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            for name in self.names:
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(self.place / name, self.folder / name)
        self._beside.cleanup()
        if self._is_new:
            with suppress(OSError):
                self.folder.rmdir()


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder before the work, not after it.

    Raises ArmidError for a file, OSError for a place where nothing can be written.
    """
    with NewFiles(folder):
        pass

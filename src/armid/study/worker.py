"""A process that performs runs for another one: `python -m armid.study.worker FILE_DESCRIPTOR PARENT`."""

import os
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path

from armid.errors import INTERRUPTED, ArmidError, MachineError
from armid.study.cases import RunCache
from armid.study.spec import study_registry
from armid.study.tasks import perform, task_type

READY, REFUSED, FINISHED = "ready", "refused", "finished"
# How often a worker looks whether the process that it works for still lives [s].
LOOKS_EVERY_S = 1.0


def main(descriptor: int, parent: int) -> None:
    """Receive kind, plug-ins and folder, then perform one run after the other until the other end is closed."""
    # Ctrl-C and its like are for the process that decides: a run is made whole, or not at all
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    connection = Connection(descriptor)
    try:
        kind, plugins, folder = connection.recv()
        # what runs need is imported before the first: where that fails no worker starts, and no run is to blame
        task_type(kind)
        try:
            cache = RunCache(study_registry(plugins), Path(folder))
        except ArmidError as error:
            connection.send((REFUSED, str(error)))
            return
        connection.send((READY, None))
        while True:
            connection.send((FINISHED, perform(connection.recv(), cache)))
    except MachineError as error:
        connection.send((REFUSED, str(error)))
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)
    except (EOFError, OSError):
        # the process that we work for has closed its end, or has ended
        os._exit(0)


def _end_with(parent: int) -> None:
    """End this process soon after the one that it works for has ended, also in the middle of a run."""
    while os.getppid() == parent:
        time.sleep(LOOKS_EVERY_S)
    os._exit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))

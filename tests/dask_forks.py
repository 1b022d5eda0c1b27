"""A script that starts the commands of Dask as forks of its process, which has all their imports.

A line of its input is the words of a command, as JSON: `["worker", "--nthreads", "1"]`. A line of
its output is the number of the process.
"""

import json
import os
import signal
import sys

from distributed.cli import dask_scheduler, dask_worker

from blast_env import evaluation  # noqa: F401
from blast_env.evaluation.engines import particles  # noqa: F401
from blast_env.particles.event import engine  # noqa: F401

COMMANDS = {"scheduler": dask_scheduler.main, "worker": dask_worker.main}

if __name__ == "__main__":
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them
    for line in sys.stdin:
        name, *options = json.loads(line)
        process = os.fork()
        if process == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.close(0)
            COMMANDS[name](options)
        print(process, flush=True)

"""A script that runs Python code in copies of its process, which has all imports of a command.

Each line of its input is code, as JSON; each line of its output how a copy ended that ran the code:
exit code, output and errors.
"""

import json
import os
import sys
from tempfile import TemporaryFile

import typer  # noqa: F401

from blast_env.cli import command, interruptions, output  # noqa: F401

if __name__ == "__main__":
    for line in sys.stdin:
        with TemporaryFile("w+") as out, TemporaryFile("w+") as errors:
            process = os.fork()
            if process == 0:
                os.dup2(out.fileno(), 1)
                os.dup2(errors.fileno(), 2)
                exec(json.loads(line), {"__name__": "work"})
                sys.exit()
            code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
            found = [file.seek(0) or file.read() for file in (out, errors)]
        print(json.dumps([code, *found]), flush=True)

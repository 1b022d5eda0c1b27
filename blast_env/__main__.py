"""`python -m blast_env`: the command line, where `blast-env` is not on the path."""

from blast_env_command import main

main()

"""Loads modules and compiled code by its import, for the processes that are forked from here."""

from contextlib import suppress

with suppress(Exception):  # else no task could start; each says itself what is missing
    from blast_env.app.blasts import warm_engine
    from blast_env.app.tasks import SearchTask as SearchTask

    warm_engine()

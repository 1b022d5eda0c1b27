"""The option `--cluster` of all commands and studies that run many blasts."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Final

import typer

from blast_env.cli.output import message_console, printable
from blast_env.cluster import on_cluster

CLUSTER_HELP: Final = (
    "Address or scheduler file of a Dask cluster, which then runs the blasts in the place of "
    "worker processes (docs/howto/cluster.md)."
)

ClusterAddress = Annotated[str | None, typer.Option("--cluster", help=CLUSTER_HELP)]


@contextmanager
def running_on(cluster: str | None) -> Iterator[None]:
    """Run the blasts of this block on a cluster, if one is given; see `on_cluster`."""
    if cluster is None:
        yield
        return
    # What happens to workers, Dask says in its own words; what matters of it becomes an error.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with on_cluster(cluster) as size:
        now = f"{size.workers} workers with {size.threads} threads now"
        text = f"cluster {cluster}: {now if size.workers else 'waits for the first worker'}"
        message_console().print(printable(text))
        yield

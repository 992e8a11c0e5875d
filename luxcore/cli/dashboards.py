"""`lux dashboards`: mlflow's and Prefect's pages on loopback."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="dashboards")
@click.option("--mlflow-port", default=5000, show_default=True, type=click.IntRange(1, 65535))
@click.option("--prefect-port", default=4200, show_default=True, type=click.IntRange(1, 65535))
def command(mlflow_port: int, prefect_port: int) -> None:
    """Start mlflow's and Prefect's pages for this folder and print their addresses.

    Both listen on 127.0.0.1 only, and end with this command.
    """
    from luxcore.dashboards import serve_dashboards

    serve_dashboards(Path.cwd(), mlflow_port, prefect_port, click.echo)

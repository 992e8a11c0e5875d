"""The workflow: the DAG as data, the Prefect flow over it, plans and schedules."""

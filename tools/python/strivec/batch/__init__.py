"""Batches of scenes on Ray: each scene is a job of stages, whose results are kept in a store of any kind that fsspec knows.

    strivec-batch scenes.toml --address auto

`specification` reads what is to be done, `store` keeps what is done, `stages` does it, `schedule` hands it to Ray, `report` tells of it.
Scheduling, retries, resources and the object store are Ray's.
"""

"""Who performs the runs of a study: worker processes on this machine, or a Dask cluster.

In reading order:
pool        worker processes on this machine, each run with a time limit
worker      the program of such a process
dask_pool   a cluster instead of own processes
"""

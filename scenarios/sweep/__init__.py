"""Many runs: a sweep file, its tasks, worker processes or a Dask cluster, one data set."""

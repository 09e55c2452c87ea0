"""Many recordings at once: what each says is worked out again, on all cores or a cluster, and kept as one data set.

`job` is what one recording needs and what comes of it; `dataset` is where that is kept, and what is there already;
`run` hands out the work.
"""

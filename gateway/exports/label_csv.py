"""CSV of labels: the rows and columns of the Parquet table of labels, with a heading."""

from pathlib import Path

from pyarrow.csv import CSVWriter

from gateway.exports import Job
from gateway.exports.labels import SCHEMA, batches


def export(job: Job, path: Path) -> str:
    """Write a file; a row an ARINC 429 word, an empty cell where there is nothing."""
    rows = 0
    with CSVWriter(path, SCHEMA) as writer:
        for batch in batches(job.words()):
            writer.write_batch(batch)
            rows += batch.num_rows
    return f"{rows} ARINC 429 words; radar words have no place in it"

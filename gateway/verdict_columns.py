"""The columns of a verdict in tables."""

import pyarrow as pa

VERDICTS = pa.schema(
    [
        ("utc_ns", pa.int64()),
        ("sequence", pa.uint64()),
        ("scan", pa.int64()),
        ("verdict", pa.string()),
        ("reasons", pa.list_(pa.string())),
        ("method", pa.string()),
        ("p_fa", pa.float64()),
        ("n_pairs", pa.int64()),
        ("scans", pa.int64()),
        *(
            (name, pa.float64())
            for name in (
                "t_bins2",
                "t_normalised",
                "q",
                "threshold",
                "mean_bins",
                "mean_stderr_bins",
                "shift",
                "shift_limit",
                "unmatched_radar",
                "unmatched_radar_limit",
                "unmatched_dem",
                "unmatched_dem_limit",
                "level",
                "mdb_bins",
                "offset_north_m",
                "offset_east_m",
                "offset_confidence",
            )
        ),
        ("calibration", pa.string()),
    ]
)

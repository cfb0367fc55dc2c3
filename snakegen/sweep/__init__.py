"""Margins of many postures: samples, batches, Parquet parts that resume, maps, the worst one."""

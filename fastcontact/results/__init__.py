"""Results of load steps: plain data, result files, tables, pictures."""

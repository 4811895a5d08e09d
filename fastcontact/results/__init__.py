"""Results of load steps: plain data (step), the result file (layout, writer, reader), tables, other formats, pictures."""

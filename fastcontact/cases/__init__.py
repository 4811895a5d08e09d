"""Case files: a whole problem as TOML, the shipped cases, checks and summaries."""

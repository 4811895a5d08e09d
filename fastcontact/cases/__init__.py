"""Case files in TOML and input decks, the ready-made cases, checks of results, and summaries."""

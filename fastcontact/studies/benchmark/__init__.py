"""The runner of the benchmark suite; its subjects lie in ``bench/subjects`` of the checkout, one file each."""

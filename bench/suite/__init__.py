"""The runner of `fastcontact bench`; the subjects are in ``bench/subjects``, one file each."""

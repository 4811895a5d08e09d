"""The runner behind `fastcontact bench`; what it measures lies in ``bench/subjects``, one file each."""

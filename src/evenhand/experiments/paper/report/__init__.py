"""The report of the experiment of the paper."""

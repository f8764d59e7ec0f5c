"""All that is compiled by numba: arrays in, arrays out, and nothing of the rest of seecr."""

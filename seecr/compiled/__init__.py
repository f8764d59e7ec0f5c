"""Everything that numba compiles: arrays in, arrays out, without imports from the rest of seecr."""

"""The command line of seecr, and what command lines share."""

"""Hold the statics of a cable robot against MuJoCo and against measurements."""

"""Studies: many maps, sweeps, diagnoses and twins, each a task; what is done is not done again."""

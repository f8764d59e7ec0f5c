"""What effects are worth in a linear model, where the evidence of any set is a sum of squares."""

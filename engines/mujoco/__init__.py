"""MuJoCo on the bicycle: a ladder of models, from its defaults to what its solver can be pushed to."""

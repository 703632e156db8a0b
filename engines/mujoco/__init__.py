"""MuJoCo on the bicycle: the model as its users build it."""

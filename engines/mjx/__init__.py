"""Model the bicycle in MJX, MuJoCo's port to JAX: its own soft contacts, and its tree under exact rolling forces."""

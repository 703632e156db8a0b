"""Model the bicycle in MuJoCo Warp, MuJoCo's port to Warp for GPUs: its own soft contacts in single precision."""

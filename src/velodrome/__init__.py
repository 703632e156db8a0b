"""Cross-validation of multibody engines on a bicycle that rides hands-free in circles inside a bowl."""

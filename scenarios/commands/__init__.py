"""The commands of `velodrome`; each imports what it needs, and none of them waits for the others'."""

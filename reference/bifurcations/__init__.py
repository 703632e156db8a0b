"""What happens where stable circles end: Hopf points on a level set of energy, and periodic orbits born there."""

"""Pinocchio's tree of bodies and its constraint solver, with contacts that move with the wheels."""

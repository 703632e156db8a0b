"""What to run: declared scenarios, the runner and the command."""

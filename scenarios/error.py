"""What a user's input can be told."""


class ScenarioError(ValueError):
    """Input that cannot be used: one line that says what, where and what would be right."""

"""The error that is raised for a user's input."""


class ScenarioError(ValueError):
    """Raised for input that cannot be used; one line says what is wrong, where, and what would be right."""

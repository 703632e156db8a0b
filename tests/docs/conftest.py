import sys
from pathlib import Path

# The site's extensions, as Sphinx loads them.
sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "_ext"))

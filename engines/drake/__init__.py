"""Drake's multibody plant as two engines: its own discrete contacts, and its tree under the exact forces of rolling."""

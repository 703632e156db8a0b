from hypothesis import settings

# Kernels compile inside an example on a fresh machine, and a gate must judge the same examples every day.
settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")
